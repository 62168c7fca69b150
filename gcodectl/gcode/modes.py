"""Modal words and settings: what stays in force after the line that says it.

Where firmwares differ:
- E mode. M82/M83 set it everywhere. Klipper: E is relative after M83 or while G91 holds (klippy/extras/gcode_move.py).
  RepRapFirmware: G90/G91 leave E alone. Marlin 2: G90/G91 set E too (gcode.h, set_relative_mode), so G90 after M83
  makes E absolute; Marlin 1 and Prusa's own leave E relative there. One file cannot mean both, so after that pair the
  E mode is unknown until M82 or M83 says it.
- M204: Marlin S sets printing and travel, P and T one each; Klipper takes S, or the smaller of P and T.
- M201, M205, M203: Marlin and RepRapFirmware. The smaller of M201's X and Y caps the accelerations. M205 X Y is a
  speed step per axis, which at a right angle is the corner speed; M205 J is Marlin's junction deviation, whose corner
  speed at a right angle is sqrt(a J sin45/(1 - sin45)). M566 is RepRapFirmware's M205, in mm/min.
- SET_VELOCITY_LIMIT: ACCEL holds for all moves. Its VELOCITY is a limit of the machine, no commanded speed: left out.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Bytes, Floats
from gcodectl.gcode import state as at
from gcodectl.gcode.codes import Code, Mode
from gcodectl.jit import jit_inline, jit_lean

MARLIN, KLIPPER, REPRAPFIRMWARE = 0, 1, 2
_JUNCTION = math.sin(math.pi / 4) / (1 - math.sin(math.pi / 4))
_G17, _G18, _G19, _G20, _G21 = int(Mode.G17), int(Mode.G18), int(Mode.G19), int(Mode.G20), int(Mode.G21)
_G90, _G91, _G90_1, _G91_1 = int(Mode.G90), int(Mode.G91), int(Mode.G90_1), int(Mode.G91_1)
_M82, _M83 = int(Mode.M82), int(Mode.M83)
_M200, _M201, _M204, _M205 = int(Code.M200), int(Code.M201), int(Code.M204), int(Code.M205)
_M220, _M221, _M566, _VELOCITY = int(Code.M220), int(Code.M221), int(Code.M566), int(Code.VELOCITY_LIMIT)
_D, _J, _P, _S, _T, _X, _Y = 3, 9, 15, 18, 19, 23, 24


@jit_lean
def modes_kernel(modes: int, state: Floats, dialect: int) -> None:
    """Put the modal words of a line in force."""
    if modes & (_G17 | _G18 | _G19):
        state[at.PLANE] = 0 if modes & _G17 else (1 if modes & _G18 else 2)
    if modes & (_G20 | _G21):
        unit = 25.4 if modes & _G20 else 1.0
        state[at.E] *= state[at.UNIT] / unit
        state[at.UNIT] = unit
    if modes & (_G90 | _G91):
        absolute = 1 if modes & _G90 else 0
        state[at.ABSOLUTE] = absolute
        if dialect == MARLIN:
            state[at.E_ABSOLUTE] = -1 if absolute and state[at.E_WORD] == 0 else absolute
    if modes & (_G90_1 | _G91_1):
        state[at.CENTER_ABSOLUTE] = 1 if modes & _G90_1 else 0
    if modes & (_M82 | _M83):
        state[at.E_WORD] = 1 if modes & _M82 else 0
        state[at.E_ABSOLUTE] = state[at.E_WORD]


@jit_inline
def relative_e_kernel(state: Floats, dialect: int) -> int:
    """Tell how an E word is to be read: 1 relative, 0 absolute, -1 unknown."""
    mode = state[at.E_ABSOLUTE]
    if dialect == KLIPPER:
        if mode == 0 or state[at.ABSOLUTE] == 0:
            return 1
        return 0 if mode == 1 and state[at.ABSOLUTE] == 1 else -1
    return -1 if mode < 0 else (1 if mode == 0 else 0)


@jit_lean
def smaller_kernel(a: float, b: float) -> float:
    """Return the smaller of the positive ones of two numbers, NaN where neither is."""
    a = a if a > 0 else np.nan
    b = b if b > 0 else np.nan
    return b if np.isnan(a) or b < a else a


@jit_lean
def accel_kernel(words: Floats, state: Floats, dialect: int) -> None:
    """Carry out M204."""
    both = words[_S]
    if dialect == KLIPPER and not both > 0:
        both = smaller_kernel(words[_P], words[_T]) if words[_P] > 0 and words[_T] > 0 else np.nan
    if both > 0:
        state[at.ACCEL] = both
        state[at.TRAVEL] = both
    if dialect != KLIPPER:
        state[at.ACCEL] = words[_P] if words[_P] > 0 else state[at.ACCEL]
        state[at.TRAVEL] = words[_T] if words[_T] > 0 else state[at.TRAVEL]


@jit_lean
def capped_kernel(asked: float, own: float, cap: float) -> float:
    """Return the acceleration in force under M201's cap; NaN where the machine's own holds."""
    current = own if np.isnan(asked) else asked
    return cap if current > cap else asked


@jit_lean
def settings_kernel(
    code: int, words: Floats, letters: int, state: Floats, dialect: int, own_accel: float, own_travel: float
) -> None:
    """Carry out M200 to M221, M566 and SET_VELOCITY_LIMIT; `letters` are M220's B (1) and R (2)."""
    if code == _M204:
        accel_kernel(words, state, dialect)
    elif code == _VELOCITY:
        if words[0] > 0:
            state[at.ACCEL] = words[0]
            state[at.TRAVEL] = words[0]
        if words[_S] >= 0:
            state[at.CORNER] = words[_S]
    elif code == _M220:
        if letters & 1:
            state[at.SPEED_SAVED] = state[at.SPEED]
        if letters & 2:
            state[at.SPEED] = state[at.SPEED_SAVED]
        if words[_S] > 0:
            state[at.SPEED] = words[_S] / 100
    elif code == _M221:
        if words[_S] >= 0 and (np.isnan(words[_T]) or words[_T] == state[at.TOOL]):
            state[at.FLOW] = words[_S] / 100
    elif dialect != KLIPPER:
        if code == _M200:
            if words[_D] >= 0:
                state[at.VOLUMETRIC] = 1 if words[_D] > 0 else 0
            if words[_S] >= 0:
                state[at.VOLUMETRIC] = 1 if words[_S] > 0 else 0
        elif code == _M201:
            cap = smaller_kernel(words[_X], words[_Y])
            state[at.ACCEL_CAP] = state[at.ACCEL_CAP] if np.isnan(cap) else cap
        elif code in (_M205, _M566):
            step = smaller_kernel(words[_X], words[_Y]) / (60 if code == _M566 else 1)
            if dialect == MARLIN and words[_J] > 0:
                step = math.sqrt((own_accel if np.isnan(state[at.ACCEL]) else state[at.ACCEL]) * words[_J] * _JUNCTION)
            state[at.CORNER] = state[at.CORNER] if np.isnan(step) else step
    state[at.ACCEL_NOW] = capped_kernel(state[at.ACCEL], own_accel, state[at.ACCEL_CAP])
    state[at.TRAVEL_NOW] = capped_kernel(state[at.TRAVEL], own_travel, state[at.ACCEL_CAP])


@jit_lean
def letters_kernel(text: Bytes, i: int, end: int) -> int:
    """Tell which of B (1) and R (2) stand on an M220 line without a value, which is how they are written."""
    found = 0
    while i < end and text[i] != 59 and text[i] != 40:
        letter = int(text[i]) & 0xDF
        found |= 1 if letter == 66 else (2 if letter == 82 else 0)
        i += 1
    return found
