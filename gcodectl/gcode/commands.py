"""Everything but motion: dwells, retracts, G92, homing, tools, waits, macros; and what each leaves known.

Kinds of not knowing (Effect in dialects.py): MOVES loses X, Y, Z; PAUSES loses X and Y (a slicer that does not repeat Z
counts on the height being kept); FORGETS loses position, E, feed and modes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats
from gcodectl.gcode import state as at
from gcodectl.gcode.codes import T_BASE, Code, Mode
from gcodectl.gcode.dialects import Effect
from gcodectl.gcode.modes import KLIPPER, MARLIN
from gcodectl.gcode.motions import ABSURD
from gcodectl.jit import jit_lean
from gcodectl.records import Flag, Kind

FINE, UNSAFE, REFUSED, CYCLE, NO_MOTION = 0, 11, 12, 13, 14
"""Problem numbers, after those of arcs.py and motions.py."""

_NOTHING, _DWELL, _RETRACT, _UNRETRACT = int(Kind.NOTHING), int(Kind.DWELL), int(Kind.RETRACT), int(Kind.UNRETRACT)
_TOOL, _BARRIER = int(Kind.TOOL), int(Kind.BARRIER)
_SETS_E = int(Flag.SETS_E)
_ODD = int(Mode.ODD)
_MOVES, _HARMLESS, _WAITS, _PAUSES = int(Effect.MOVES), int(Effect.HARMLESS), int(Effect.WAITS), int(Effect.PAUSES)
_FORGETS, _REFUSED, _CYCLE = int(Effect.FORGETS), int(Effect.REFUSED), int(Effect.CYCLE)
_C_RETURNS, _C_UNSAFE, _C_NONE = int(Code.RETURNS), int(Code.UNSAFE), int(Code.NONE)
_C_HARMLESS, _C_VELOCITY = int(Code.HARMLESS), int(Code.VELOCITY_LIMIT)
_G4, _G10, _G11, _G92 = int(Code.G4), int(Code.G10), int(Code.G11), int(Code.G92)
_M6, _M101, _M103 = int(Code.M6), int(Code.M101), int(Code.M103)
_E, _L, _P, _R, _S, _T, _X, _Y, _Z = 4, 11, 15, 17, 18, 19, 23, 24, 25


@jit_lean
def forget_kernel(effect: int, state: Floats) -> None:
    """Make the row a barrier and lose what `effect` says."""
    state[at.KIND] = _BARRIER
    if effect == _WAITS:
        return
    state[at.X] = np.nan
    state[at.Y] = np.nan
    if effect == _PAUSES:
        return
    state[at.Z] = np.nan
    if effect == _FORGETS:
        state[at.E] = np.nan
        state[at.FEED] = np.nan
        state[at.ABSOLUTE] = -1
        state[at.E_ABSOLUTE] = -1
        state[at.E_WORD] = -1
        state[at.MOTION] = -1


@jit_lean
def set_position_kernel(words: Floats, modes: int, state: Floats, dialect: int) -> int:
    """Carry out G92: E's count is set quietly, X, Y and Z make a barrier; returns a problem number."""
    axes = not (np.isnan(words[_X]) and np.isnan(words[_Y]) and np.isnan(words[_Z]))
    if modes & _ODD or (dialect == MARLIN and not axes and np.isnan(words[_E])):
        # Words without numbers; or a bare G92, which older Marlins take for zeros and newer ones for nothing.
        forget_kernel(_MOVES, state)
        state[at.E] = np.nan
        state[at.FLAGS] = _SETS_E
        return FINE
    bare = not axes and np.isnan(words[_E])
    for axis in range(3):
        word = 0.0 if bare else words[_X + axis]
        if abs(word) > 1e7:
            return ABSURD
        if not np.isnan(word):
            state[axis] = word * state[at.UNIT]
            state[at.KIND] = _BARRIER
    if bare or not np.isnan(words[_E]):
        if abs(words[_E]) > 1e7:
            return ABSURD
        state[at.E] = 0.0 if bare else words[_E]
        state[at.FLAGS] = _SETS_E
    return FINE


@jit_lean
def dwell_kernel(words: Floats, state: Floats, dialect: int) -> int:
    """Carry out G4: P in ms, S in s where the firmware has it (S wins, as in Marlin); returns a problem number."""
    seconds = words[_P] / 1000
    if dialect != KLIPPER and not np.isnan(words[_S]):
        seconds = words[_S]
    if seconds > 1e6:
        return ABSURD
    state[at.KIND] = _DWELL
    state[at.DWELL] = seconds if seconds > 0 else 0.0
    return FINE


@jit_lean
def tool_kernel(number: float, state: Floats) -> None:
    """Change to tool `number`; a number that no machine has is a macro's."""
    if 0 <= number < 100:
        forget_kernel(_PAUSES, state)
        state[at.KIND] = _TOOL
        state[at.TOOL] = number
    else:
        forget_kernel(_MOVES, state)
    state[at.E] = np.nan


@jit_lean
def retract_kernel(code: int, words: Floats, state: Floats) -> None:
    """Carry out G10 and G11 where they retract: G10 P S R is a tool's temperatures, with L or axes its offsets."""
    axes = not (np.isnan(words[_X]) and np.isnan(words[_Y]) and np.isnan(words[_Z]))
    if axes or not np.isnan(words[_L]):
        forget_kernel(_MOVES, state)
    elif code == _G11 or (np.isnan(words[_P]) and np.isnan(words[_R])):
        state[at.KIND] = _UNRETRACT if code == _G11 else _RETRACT


@jit_lean
def command_kernel(code: int, words: Floats, modes: int, state: Floats, dialect: int, effects: NDArray[np.int8]) -> int:
    """Carry out a command that is no motion and no setting; returns a problem number."""
    if code in (_C_NONE, _C_HARMLESS, _C_VELOCITY):
        return FINE
    if code == _C_UNSAFE:
        return UNSAFE
    if code < 0:
        forget_kernel(_PAUSES if code == _C_RETURNS else _FORGETS, state)
        return FINE
    if code == _G92:
        return set_position_kernel(words, modes, state, dialect)
    if code == _G4:
        return dwell_kernel(words, state, dialect)
    if code in (_G10, _G11):
        retract_kernel(code, words, state)
    elif code in (_M101, _M103):
        state[at.KIND] = _UNRETRACT if code == _M101 else _RETRACT
    elif code >= T_BASE:
        tool_kernel(code - T_BASE, state)
    elif code == _M6:
        tool_kernel(words[_T], state)
    else:
        effect = int(effects[code]) if code < len(effects) else _MOVES
        if effect == _REFUSED:
            return REFUSED
        if effect == _CYCLE:
            if not np.isnan(words[_X]) or not np.isnan(words[_Y]) or not np.isnan(words[_Z]):
                return CYCLE
            state[at.MOTION] = -1
        if effect != _HARMLESS:
            forget_kernel(_MOVES if effect == _CYCLE else effect, state)
    return FINE
