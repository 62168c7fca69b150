"""Blocks to Moves: the modal state machine, one row a block, in mm and seconds.

    modes (G90 G21 M83 ...) -> what the line commands: motion | setting | anything else | comment's mark -> row

Every row starts where the one before it ended: p0[k] == p1[k - 1], NaN where unknown; G92 X Y Z, homing and the like
are rows whose p1 is what is known after them. The state is an array (state.py) that the kernel carries from chunk to
chunk, so any chunking gives the same rows. What must not be guessed at stops it with InputError, or, with
`pass_unknown`, becomes a barrier after which nothing is known.

Rules: motions.py (G0-G3), modes.py (modes and settings), commands.py (the rest), dialects.py (tables), marks.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.config import Machine
from gcodectl.gcode import state as at
from gcodectl.gcode.codes import Code
from gcodectl.gcode.commands import NO_MOTION, command_kernel, forget_kernel
from gcodectl.gcode.dialects import DIALECT_NUMBER, EFFECTS, FEATURE_HASHES, Effect
from gcodectl.gcode.marks import mark_kernel
from gcodectl.gcode.modes import letters_kernel, modes_kernel, settings_kernel
from gcodectl.gcode.motions import flags_kernel, motion_kernel
from gcodectl.gcode.refusals import refusal
from gcodectl.gcode.state import start_state
from gcodectl.gcode.words import spaces_kernel
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Blocks, Flag, Kind, Moves

_NONE, _BARE, _VELOCITY, _M220 = int(Code.NONE), int(Code.BARE), int(Code.VELOCITY_LIMIT), int(Code.M220)
_M200, _M221, _M566 = int(Code.M200), int(Code.M221), int(Code.M566)
_TOOL, _BARRIER = int(Kind.TOOL), int(Kind.BARRIER)
_KNOWN, _G92 = int(Flag.KNOWN), int(Code.G92)
_FORGETS = int(Effect.FORGETS)
_OF_BARE = np.array([0, 1, 2, 4, 8, 9, 10, 17, 20, 21, 22, 23, 24, 25])  # A B C E I J K R U V W X Y Z

MOST_DECIMALS = 6
"""The finest precision that a file is taken to have: more digits are a program's rounding noise."""

_REALS = (
    ("length", at.LENGTH),
    ("sweep", at.SWEEP),
    ("e", at.DE),
    ("e_end", at.E),
    ("speed_factor", at.SPEED),
    ("flow_factor", at.FLOW),
    ("dwell", at.DWELL),
    ("accel", at.ACCEL_NOW),
    ("travel_accel", at.TRAVEL_NOW),
    ("corner_speed", at.CORNER),
    ("width", at.WIDTH),
    ("height", at.HEIGHT),
)
_WHOLES = (
    ("kind", at.KIND),
    ("flags", at.FLAGS),
    ("plane", at.PLANE),
    ("tool", at.TOOL),
    ("layer", at.LAYER),
    ("feature", at.FEATURE),
)
_REAL_INDEX = np.array([index for _, index in _REALS])
_WHOLE_INDEX = np.array([index for _, index in _WHOLES])


@jit_inline
def blank_kernel(state: Floats) -> None:
    """Begin a row: nothing moves; flags of -1 are still to be made."""
    for index in range(at.KIND, at.SIZE):
        state[index] = 0.0
    state[at.CENTER_A], state[at.CENTER_B] = np.nan, np.nan
    state[at.FLAGS] = -1


@jit_inline
def step_kernel(
    code: int,
    modes: int,
    words: Floats,
    p0: Floats,
    letters: int,
    state: Floats,
    machine: Floats,
    effects: NDArray[np.int8],
) -> int:
    """Carry out one block from `p0` (machine: dialect, accel, travel_accel); returns a problem number."""
    dialect = int(machine[0])
    blank_kernel(state)
    if modes:
        modes_kernel(modes, state, dialect)
    problem = 0
    if code == _BARE:
        code, problem = bare_kernel(words, state)
    if 0 <= code <= 30 and code % 10 == 0:
        state[at.MOTION] = code
        problem = motion_kernel(code, words, modes, p0, state, dialect)
    elif _M200 <= code <= _M221 or code in (_M566, _VELOCITY):
        settings_kernel(code, words, letters, state, dialect, machine[1], machine[2])
    elif code != _NONE and code != _BARE:
        problem = command_kernel(code, words, modes, state, dialect, effects)
    if state[at.FLAGS] < 0 or code == _G92:
        sets = max(int(state[at.FLAGS]), 0)
        flags = flags_kernel(state, dialect) | sets
        barrier = state[at.KIND] == _BARRIER or state[at.KIND] == _TOOL
        state[at.FLAGS] = flags & ~_KNOWN if barrier else flags
    return problem


@jit_lean
def bare_kernel(words: Floats, state: Floats) -> tuple[int, int]:
    """Take words without a command for the last motion, or for an F alone: (code to carry out, problem number)."""
    for letter in _OF_BARE:
        if not np.isnan(words[letter]):
            return (_BARE, NO_MOTION) if state[at.MOTION] < 0 else (int(state[at.MOTION]), 0)
    if words[5] > 0:
        state[at.FEED] = words[5] * state[at.UNIT] / 60
    return _BARE, 0


@jit_lean
def interpret_kernel(
    lines: tuple[Bytes, Ints, Ints],
    blocks: tuple[Ints, Ints, Floats, NDArray[np.int8]],
    tables: tuple[NDArray[np.int8], Ints, Floats],
    pass_unknown: bool,
    state: Floats,
    vectors: tuple[Floats, Floats, Floats],
    reals: Floats,
    wholes: Ints,
    places: NDArray[np.int8],
) -> tuple[int, int]:
    """Fill one row a block, `state` carried on; returns (rows filled, problem number of the next one or 0)."""
    text, start, end = lines
    codes, modes, words, decimals = blocks
    effects, features, machine = tables
    p0, p1, center = vectors
    for row in range(len(codes)):
        code = int(codes[row])
        for axis in range(3):
            p0[row, axis] = state[axis]
        letters = letters_kernel(text, start[row], end[row]) if code == _M220 else 0
        if code == _NONE:
            first = spaces_kernel(text, start[row], end[row])
            if first < end[row] and text[first] == 59:
                mark_kernel(text, first, end[row], features, state)
        elif code <= 30 and (code >= 0 or code == _BARE):
            state[at.PLACES] = max(state[at.PLACES], min(decimals[row, 0], MOST_DECIMALS))
            state[at.E_PLACES] = max(state[at.E_PLACES], min(decimals[row, 1], MOST_DECIMALS))
        problem = step_kernel(code, int(modes[row]), words[row], p0[row], letters, state, machine, effects)
        if problem:
            if not pass_unknown:
                return row, problem
            blank_kernel(state)
            forget_kernel(_FORGETS, state)
            state[at.FLAGS] = flags_kernel(state, int(machine[0]))
        for axis in range(3):
            p1[row, axis] = state[axis]
        center[row, 0], center[row, 1] = state[at.CENTER_A], state[at.CENTER_B]
        for k in range(len(_REAL_INDEX)):
            reals[k, row] = state[_REAL_INDEX[k]]
        for k in range(len(_WHOLE_INDEX)):
            wholes[k, row] = int(state[_WHOLE_INDEX[k]])
        reals[len(_REAL_INDEX), row] = state[at.FEED] * state[at.SPEED]
        reals[len(_REAL_INDEX) + 1, row] = 1.0 if state[at.VOLUMETRIC] == 1 else machine[3]
        places[row, 0], places[row, 1] = int(state[at.PLACES]), int(state[at.E_PLACES])
    return len(codes), 0


def interpret(
    blocks: Iterable[Blocks],
    machine: Machine,
    *,
    pass_unknown: bool = False,
    relative_e: bool | None = None,
    source: str = "",
) -> Iterator[Moves]:
    """Yield the Moves of every chunk of Blocks, one row a block.

    Raises InputError at the first line that cannot be followed safely, after the rows before it; with `pass_unknown`
    such a line becomes a BARRIER. `relative_e` is the E mode before the first M82 or M83, where it is known; `source`
    is the file's name, for the message.
    """
    state = start_state()
    if relative_e is not None:
        state[at.E_WORD] = state[at.E_ABSOLUTE] = 0.0 if relative_e else 1.0
    about = np.array([DIALECT_NUMBER[machine.dialect], machine.accel, machine.travel_accel, machine.area])
    row = 0
    for part in blocks:
        count = len(part)
        columns: dict[str, Any] = {name: np.empty((count, 3)) for name in ("p0", "p1")}
        columns["center"] = np.empty((count, 2))
        columns["decimals"] = np.empty((count, 2), dtype=np.int8)
        reals = np.empty((len(_REALS) + 2, count))
        wholes = np.empty((len(_WHOLES), count), dtype=np.int64)
        filled, problem = interpret_kernel(
            (part.text, part.start, part.end),
            (part.code, part.modes, part.words, part.decimals),
            (EFFECTS, FEATURE_HASHES, about),
            pass_unknown,
            state,
            (columns["p0"], columns["p1"], columns["center"]),
            reals,
            wholes,
            columns["decimals"],
        )
        columns |= {name: reals[k] for k, (name, _) in enumerate((*_REALS, ("feed", 0), ("area", 0)))}
        columns |= {name: wholes[k] for k, (name, _) in enumerate(_WHOLES)}
        columns |= {"text": part.text, "start": part.start, "end": part.end, "line": part.line}
        columns["row"] = np.arange(row, row + count)
        moves = Moves(**columns)
        row += count
        if filled:
            yield moves if filled == count else moves[:filled]
        if problem:
            raise refusal(problem, int(part.code[filled]), part.raw(filled), int(part.line[filled]), source)
