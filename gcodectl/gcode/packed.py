"""Packed: what the kernels that write lines share: a chunk's columns, and one vector for all that they know and keep.

    Table     the columns of a chunk, as they are: nothing is copied but the rows' own numbers, one row at a time
    state     what the machine allows (see `gcode.bounds`) | the move that is written now | what goes on from row to row
    phases    phases[k, column], the phases of that move over time

A kernel that is handed five arrays spends longer on taking them than on its work, and longer still on being compiled:
so numbers of every kind stand in `state`, whole ones too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.config import Machine
from gcodectl.gcode.bounds import (
    N_BOUNDS,
    NOZZLE,
    PRINT_ACCEL,
    SQUARE_CORNER,
    SWITCH_DWELL,
    TRAVEL_ACCEL,
    bounds_of,
)
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Command, Composed, Flag, Kind

INCH = 25.4
FINE, SHORT = 0.01, 0.1
LEAST_DIGITS, MOST_DIGITS = 3, 6
LEAST_E_DIGITS, MOST_E_DIGITS = 5, 8
QUIET = 1e-6
"""mm^3/s; what a signal adds below this is rounding."""
INCHES, ARC, TOOL_CHANGE = int(Flag.INCHES), int(Kind.ARC), int(Kind.TOOL)

X0, X1, CENTER, POINT = (N_BOUNDS + k for k in (0, 3, 6, 8))
"""Columns of `state`: the move's start and end (3 each), centre (2), room for a point (3)."""
SWEEP, DISTANCE, E, AREA, E_END, FLOW, FEEDRATE, FEED, UNIT, STEADY = range(N_BOUNDS + 11, N_BOUNDS + 21)
"""Angle of an arc; path (0 where none), E, its area, logical E after, M221, mm/s, what turns mm/s into the file's
units a minute, mm in one of its units, 1 / K."""
ACCEL, CORNER_SPEED, BEGIN, FINISH, TAKES, SLOW = range(N_BOUNDS + 21, N_BOUNDS + 27)
"""What firmware does the move at, mm/s^2, the square corner velocity, mm/s; when it begins and ends, the seconds of it
that the line itself waits; whether the plan speeds up and brakes more slowly than firmware would (not 0)."""
START, END, STOP, COMMENT, KIND, FLAGS, PLANE, DIGITS, E_DIGITS, PHASES = range(N_BOUNDS + 27, N_BOUNDS + 37)
"""The line's bytes, where its own ending begins and where a comment that is still to be written; what it is; its
digits; how many phases the move has."""
E_OUT, F_OUT, E_IN, F_IN, OWED, NOMINAL, MARKED, MOVED, OPEN, RETURNS, RATIO = range(N_BOUNDS + 37, N_BOUNDS + 48)
"""Carried: logical E and F of the output and of the file before the row (file units), volume owed, nominal flow,
whether our mark is out, what the last E word moved, whether the last line out has no end yet, whether the file's lines
end in CRLF, the mm of E a mm of path of the last line out."""
TOOL_IN, AREA_IN, AREA_DIGITS, X_OUT, N_STATE = (N_BOUNDS + 48 + k for k in (0, 1, 2, 3, 6))
"""Carried: the tool in place, the area that E's digits were last reckoned for and those, position of the output (3)."""
T, DURATION, S, V, A, J, N_PHASE = range(7)
"""Columns of `phases`."""


class Table(NamedTuple):
    """The columns of a chunk that lines are written from, as the records have them."""

    text: Bytes
    start: Ints
    end: Ints
    row: Ints
    kind: NDArray[np.int8]
    flags: NDArray[np.int16]
    plane: NDArray[np.int8]
    decimals: NDArray[np.int8]
    tool: NDArray[np.int16]
    p0: Floats
    p1: Floats
    center: Floats
    sweep: Floats
    length: Floats
    e: Floats
    area: Floats
    e_end: Floats
    flow_factor: Floats
    feed: Floats
    speed_factor: Floats
    accel: Floats
    travel_accel: Floats
    corner_speed: Floats
    distance: Floats
    ruled_by: NDArray[np.int8]
    phase_row: Ints
    t: Floats
    duration: Floats
    s: Floats
    v: Floats
    a: Floats
    j: Floats
    rates: Floats
    """mm^3/s that the signal adds to the reference, without what is rounding; see `gcode.bounds` for their time."""

    def behind(self, row: int) -> Table:
        """The rows from the one at `row` on; the text, the phases and the signal stay whole."""
        columns: Iterable[tuple[str, NDArray[Any]]] = zip(self._fields, self, strict=True)
        return Table._make(column if name in WHOLE else column[row:] for name, column in columns)


WHOLE = ("text", "phase_row", "t", "duration", "s", "v", "a", "j", "rates")
"""Columns of a table that are not by row."""


def table_of(chunk: Composed) -> Table:
    """A chunk's columns, each in one piece: kernels are compiled for one kind of array."""
    moves, speeds, profile, _tasks, command = chunk
    own = {name: getattr(moves, name) for name in Table._fields if hasattr(moves, name)}
    plan = {name: getattr(speeds, name) for name in ("distance", "ruled_by")}
    time = {name: getattr(profile, name) for name in ("t", "duration", "s", "v", "a", "j")}
    columns = Table(**own, **plan, **time, phase_row=profile.row, rates=_rates(command))
    return Table._make(map(np.ascontiguousarray, columns))


@jit_lean
def rates_kernel(u: Floats, reference: Floats, out: Floats) -> None:
    """Fill `out` with what the signal adds, without what is rounding."""
    for k in range(len(u)):
        added = u[k] - reference[k]
        out[k] = 0.0 if abs(added) < QUIET else added


def _rates(command: Command) -> Floats:
    rates = np.empty(len(command.u))
    rates_kernel(np.ascontiguousarray(command.u), np.ascontiguousarray(command.reference), rates)
    return rates


def new_state(machine: Machine) -> Floats:
    """The state before the first line, shape (N_STATE,)."""
    state = np.full(N_STATE, np.nan)
    state[:N_BOUNDS] = bounds_of(machine)
    for name in (OWED, NOMINAL, MARKED, OPEN, RETURNS, RATIO, TOOL_IN):
        state[name] = 0.0
    return state


@jit_lean
def e_digits_kernel(area: float, nozzle: float) -> int:
    """Digits after the point that E needs, by the mm^2 that it pushes: the last is FINE of SHORT mm of nozzle^2."""
    digits = math.ceil(math.log10(max(area, 1e-9) / (FINE * SHORT * (nozzle * nozzle))))
    return min(max(digits, LEAST_E_DIGITS), MOST_E_DIGITS)


@jit_inline
def load_row_kernel(table: Table, i: int, steady: Floats, state: Floats) -> None:
    """Put a row's own numbers into `state`, as far as every row needs them."""
    flags, tool = table.flags[i], table.tool[i]
    for axis in range(3):
        state[X1 + axis] = table.p1[i, axis]
    state[DISTANCE] = table.distance[i] if table.length[i] > 0.0 else 0.0
    state[E], state[AREA], state[E_END] = table.e[i], table.area[i], table.e_end[i]
    state[UNIT] = INCH if flags & INCHES else 1.0
    state[FEEDRATE], state[FEED] = table.feed[i], 1.0 / state[UNIT] / table.speed_factor[i]
    state[STEADY] = steady[min(max(tool, 0), len(steady) - 1)]
    state[START], state[END], state[KIND], state[FLAGS] = table.start[i], table.end[i], table.kind[i], flags
    if state[AREA] != state[AREA_IN]:
        state[AREA_IN], state[AREA_DIGITS] = state[AREA], e_digits_kernel(state[AREA], state[NOZZLE])
    state[E_DIGITS] = min(max(float(table.decimals[i, 1]), state[AREA_DIGITS]), float(MOST_E_DIGITS))
    state[TAKES] = state[SWITCH_DWELL] if table.kind[i] == TOOL_CHANGE and tool != state[TOOL_IN] else 0.0
    state[TOOL_IN] = tool


@jit_inline
def load_motion_kernel(table: Table, i: int, state: Floats) -> None:
    """Put into `state` what is needed beside it of a row that is written anew."""
    for axis in range(3):
        state[X0 + axis] = table.p0[i, axis]
    if table.kind[i] == ARC:
        state[CENTER], state[CENTER + 1] = table.center[i, 0], table.center[i, 1]
        state[SWEEP], state[PLANE] = table.sweep[i], table.plane[i]
    corner_speed = table.corner_speed[i]
    state[CORNER_SPEED] = state[SQUARE_CORNER] if np.isnan(corner_speed) else corner_speed
    accel, default = table.accel[i], state[PRINT_ACCEL]
    if not state[E] > 0.0:
        accel, default = table.travel_accel[i], state[TRAVEL_ACCEL]
    state[ACCEL] = default if np.isnan(accel) else accel
    state[FLOW], state[SLOW] = table.flow_factor[i], table.ruled_by[i]
    state[DIGITS] = min(max(table.decimals[i, 0], LEAST_DIGITS), MOST_DIGITS)


@jit_inline
def load_phases_kernel(table: Table, first: int, last: int, state: Floats, phases: Floats) -> None:
    """Put the phases first to last (not included) of the row into `phases`, and their time into `state`."""
    for k in range(first, last):
        phase = phases[k - first]
        phase[T], phase[DURATION], phase[S] = table.t[k], table.duration[k], table.s[k]
        phase[V], phase[A], phase[J] = table.v[k], table.a[k], table.j[k]
    state[PHASES] = last - first
    if last > first:
        state[BEGIN], state[FINISH] = table.t[first], table.t[last - 1] + table.duration[last - 1]
