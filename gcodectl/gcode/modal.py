"""Lines to Moves: the modal state machine, one row a line, in mm and seconds; words are taken as they are read.

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

from gcodectl.columns import Bools, Bytes, Floats, Ints
from gcodectl.config import Machine
from gcodectl.gcode import state as at
from gcodectl.gcode.codes import Code
from gcodectl.gcode.commands import NO_MOTION, command_kernel, forget_kernel
from gcodectl.gcode.dialects import DIALECT_NUMBER, EFFECTS, FEATURE_HASHES, NAME_HASHES, TEXT_COMMANDS, Effect
from gcodectl.gcode.marks import mark_kernel
from gcodectl.gcode.modes import letters_kernel, modes_kernel, settings_kernel
from gcodectl.gcode.motions import flags_kernel, motion_kernel
from gcodectl.gcode.parse import Lines, block_kernel
from gcodectl.gcode.refusals import refusal
from gcodectl.gcode.state import start_state
from gcodectl.gcode.words import OF_MOTION, letter_bits, spaces_kernel
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Flag, Kind, Moves

_NONE, _BARE, _VELOCITY, _M220 = int(Code.NONE), int(Code.BARE), int(Code.VELOCITY_LIMIT), int(Code.M220)
_M200, _M221, _M566 = int(Code.M200), int(Code.M221), int(Code.M566)
_TOOL, _BARRIER = int(Kind.TOOL), int(Kind.BARRIER)
_KNOWN, _G92 = int(Flag.KNOWN), int(Code.G92)
_FORGETS = int(Effect.FORGETS)
_MOVES = OF_MOTION & ~letter_bits("F")

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
_REAL_INDEX = np.array([index for _, index in _REALS])


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
    present: int,
    p0: Floats,
    letters: int,
    state: Floats,
    machine: Floats,
    effects: NDArray[np.int8],
) -> int:
    """Carry out one line from `p0` (machine: dialect, accel, travel_accel); returns a problem number."""
    dialect = int(machine[0])
    blank_kernel(state)
    if modes:
        modes_kernel(modes, state, dialect)
    problem = 0
    if code == _BARE:
        code, problem = bare_kernel(words, present, state)
    if 0 <= code <= 30 and code % 10 == 0:
        state[at.MOTION] = code
        problem = motion_kernel(code, words, present, modes, p0, state, dialect)
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
def bare_kernel(words: Floats, present: int, state: Floats) -> tuple[int, int]:
    """Take words without a command for the last motion, or for an F alone: (code to carry out, problem number)."""
    if present & _MOVES:
        return (_BARE, NO_MOTION) if state[at.MOTION] < 0 else (int(state[at.MOTION]), 0)
    if words[5] > 0:
        state[at.FEED] = words[5] * state[at.UNIT] / 60
    return _BARE, 0


@jit_inline
def label_kernel(
    code: int, text: Bytes, start: int, end: int, places: int, e_places: int, features: Ints, state: Floats
) -> int:
    """Take in what a line tells beside its words: marks, digits; returns the letters of M220."""
    if code == _NONE:
        first = spaces_kernel(text, start, end)
        if first < end and text[first] == 59:
            mark_kernel(text, first, end, features, state)
    elif code <= 30 and (code >= 0 or code == _BARE):
        state[at.PLACES] = max(state[at.PLACES], min(places, MOST_DECIMALS))
        state[at.E_PLACES] = max(state[at.E_PLACES], min(e_places, MOST_DECIMALS))
    return letters_kernel(text, start, end) if code == _M220 else 0


@jit_lean
def interpret_kernel(
    text: Bytes,
    reading: tuple[Ints, Bools],
    tables: tuple[NDArray[np.int8], Ints, Floats],
    pass_unknown: bool,
    state: Floats,
    words: Floats,
    cuts: Ints,
    vectors: tuple[Floats, Floats],
    reals: Floats,
    wholes: tuple[NDArray[np.int32], NDArray[np.int16], NDArray[np.int8], NDArray[np.int8]],
) -> tuple[int, int, int]:
    """Fill one row a line, `state` carried on; returns (rows filled; problem number of the next or 0; its code)."""
    names, texts = reading
    effects, features, machine = tables
    path, center = vectors
    layer, shorts, small, places = wholes
    n, dialect = len(text), int(machine[0])
    row = i = 0
    cuts[0] = 0
    path[0, 0], path[0, 1], path[0, 2] = state[at.X], state[at.Y], state[at.Z]
    while i < n:
        start = i
        i, present, code, modes, digits, e_digits = block_kernel(text, i, n, names, texts, words)
        i = min(i + 1, n)
        cuts[row + 1] = i
        letters = label_kernel(code, text, start, i, digits, e_digits, features, state)
        problem = step_kernel(code, modes, words, present, path[row], letters, state, machine, effects)
        if problem:
            if not pass_unknown:
                return row, problem, code
            blank_kernel(state)
            forget_kernel(_FORGETS, state)
            state[at.FLAGS] = flags_kernel(state, dialect)
        path[row + 1, 0], path[row + 1, 1], path[row + 1, 2] = state[at.X], state[at.Y], state[at.Z]
        center[row, 0], center[row, 1] = state[at.CENTER_A], state[at.CENTER_B]
        for k in range(len(_REAL_INDEX)):
            reals[k, row] = state[_REAL_INDEX[k]]
        reals[len(_REAL_INDEX), row] = state[at.FEED] * state[at.SPEED]
        reals[len(_REAL_INDEX) + 1, row] = 1.0 if state[at.VOLUMETRIC] == 1 else machine[3]
        layer[row] = int(state[at.LAYER])
        shorts[0, row], shorts[1, row] = int(state[at.FLAGS]), int(state[at.TOOL])
        shorts[2, row] = int(state[at.FEATURE])
        small[0, row], small[1, row] = int(state[at.KIND]), int(state[at.PLANE])
        places[row, 0], places[row, 1] = int(state[at.PLACES]), int(state[at.E_PLACES])
        row += 1
    return row, 0, _NONE


def interpret(
    lines: Iterable[Lines],
    machine: Machine,
    *,
    pass_unknown: bool = False,
    relative_e: bool | None = None,
    source: str = "",
) -> Iterator[Moves]:
    """Yield the Moves of every chunk of Lines, one row a line.

    Raises InputError at the first line that cannot be followed safely, after the rows before it; with `pass_unknown`
    such a line becomes a BARRIER. `relative_e` is the E mode before the first M82 or M83, where it is known; `source`
    is the file's name, for the message.
    """
    state = start_state()
    if relative_e is not None:
        state[at.E_WORD] = state[at.E_ABSOLUTE] = 0.0 if relative_e else 1.0
    about = np.array([DIALECT_NUMBER[machine.dialect], machine.accel, machine.travel_accel, machine.area])
    words = np.empty(26)
    row = 0
    for part in lines:
        count = len(part)
        path, center = np.empty((count + 1, 3)), np.empty((count, 2))
        reals = np.empty((len(_REALS) + 2, count))
        layer, shorts = np.empty(count, np.int32), np.empty((3, count), np.int16)
        small, places = np.empty((2, count), np.int8), np.empty((count, 2), np.int8)
        cuts = np.empty(count + 1, np.int64)
        filled, problem, code = interpret_kernel(
            part.text,
            (NAME_HASHES, TEXT_COMMANDS),
            (EFFECTS, FEATURE_HASHES, about),
            pass_unknown,
            state,
            words,
            cuts,
            (path, center),
            reals,
            (layer, shorts, small, places),
        )
        columns: dict[str, Any] = {name: reals[k] for k, (name, _) in enumerate((*_REALS, ("feed", 0), ("area", 0)))}
        columns |= {"p0": path[:-1], "p1": path[1:], "center": center, "layer": layer, "decimals": places}
        columns |= {"flags": shorts[0], "tool": shorts[1], "feature": shorts[2], "kind": small[0], "plane": small[1]}
        columns |= {"heat": np.zeros(count), "text": part.text, "start": cuts[:-1], "end": cuts[1:]}
        columns |= {"row": np.arange(row, row + count), "line": np.arange(part.line, part.line + count)}
        moves = Moves(**columns)
        row += count
        if filled:
            yield moves if filled == count else moves[:filled]
        if problem:
            raw = part.text[cuts[filled] : cuts[filled + 1]].tobytes()
            raise refusal(problem, code, raw, part.line + filled, source)
