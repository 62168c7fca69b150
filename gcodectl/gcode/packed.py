"""Packed: a composed chunk as a few plain arrays and a carry, for the kernels that write lines of it.

floats[column, row], ints[column, row]    the moves, a chunk of them
phases[column, phase]                     their motion over time; a move's phases follow each other
row[column], whole[column]                the one move that is written now, and what follows from it
carry[column]                             what goes on from row to row

A column lies in one piece, so that putting a chunk side by side is a copy of memory; `row` and `whole` begin with the
same columns as `floats` and `ints`, and are filled for the rows alone whose lines are written anew.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.gcode.bounds import NOZZLE, PRINT_ACCEL, SQUARE_CORNER, SWITCH_DWELL, TRAVEL_ACCEL
from gcodectl.gcode.write import comment_kernel
from gcodectl.jit import jit_lean
from gcodectl.records import Flag, Kind, Moves, Profile, SpeedPlan

Array = TypeVar("Array", Bytes, Floats, Ints)

INCH = 25.4
FINE, SHORT = 0.01, 0.1
LEAST_DIGITS, MOST_DIGITS = 3, 6
LEAST_E_DIGITS, MOST_E_DIGITS = 5, 8
RELATIVE_XYZ, RELATIVE_E, INCHES = int(Flag.RELATIVE_XYZ), int(Flag.RELATIVE_E), int(Flag.INCHES)
TOOL_CHANGE = int(Kind.TOOL)

E, AREA, E_END, FLOW, SWEEP, DISTANCE, FEEDRATE, SPEED_FACTOR = 0, 1, 2, 3, 4, 5, 6, 7
"""Columns of `floats`: E, its area, logical E after, M221, an arc's angle, path (0 where none), mm/s, M220."""
ACCEL, ACCEL_TRAVEL, CORNER_SPEED, N_FLOATS = 8, 9, 10, 11
"""And what the file says of accelerations and corners, NaN where nothing; in `row` ACCEL is what firmware does it at,
mm/s^2, and CORNER_SPEED the square corner velocity in force, mm/s."""
X0, X1, CENTER, POINT, FEED, STEADY, BEGIN, FINISH, TAKES, N_ROW = 11, 14, 17, 19, 22, 23, 24, 25, 26, 27
"""Further columns of `row`: start and end (3 each), centre (2), room for a point (3), what turns mm/s into the file's
units, 1 / K, when the move begins and ends, and the seconds of it that the line itself waits."""
START, END, KIND, FLAGS, PLANE, DIGITS, E_DIGITS, TOOL, SLOW, N_INTS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
"""Columns of `ints`: the line's bytes, what it is, its digits, its tool, and whether (not 0) the plan speeds up and
brakes more slowly than firmware would."""
PHASE, PHASES, COMMENT, STOP, N_WHOLE = 9, 10, 11, 12, 13
"""Further columns of `whole`: its phases (the last not included), where a comment begins that is still to be written,
and where the line's own ending does."""
E_OUT, F_OUT, E_IN, F_IN, OWED, NOMINAL, X_OUT, MARKED, MOVED = 0, 1, 2, 3, 4, 5, 6, 9, 10
OPEN, RETURNS, RATIO, TOOL_IN, CARRY = 11, 12, 13, 14, 15
"""Carried: logical E and F of the output and of the file (file units), volume owed, nominal flow, position of the
output (3), whether our mark is out, what the last E word moved, whether the last line out has no end yet, whether the
file's lines end in CRLF, the mm of E a mm of path of the last line out, and the tool in place."""
T, DURATION, S, V, A, J, N_PHASE = 0, 1, 2, 3, 4, 5, 6
"""Columns of `phases`."""


def pack(moves: Moves, speeds: SpeedPlan, profile: Profile) -> tuple[Floats, Ints, Floats]:
    """Put what the kernels need side by side: floats, ints and phases."""
    floats = np.stack((
        moves.e, moves.area, moves.e_end, moves.flow_factor, moves.sweep, speeds.distance * (moves.length > 0),
        moves.feed, moves.speed_factor, moves.accel, moves.travel_accel, moves.corner_speed,
    ))  # fmt: skip
    ints = np.stack(
        (
            moves.start, moves.end, moves.kind, moves.flags, moves.plane, moves.decimals[:, 0], moves.decimals[:, 1],
            moves.tool, speeds.ruled_by,
        ), dtype=np.int64,
    )  # fmt: skip
    return floats, ints, np.stack((profile.t, profile.duration, profile.s, profile.v, profile.a, profile.j))


def fixed(array: Array) -> Array:
    """The same array, read-only and in one piece: kernels are compiled for one kind of array."""
    array = np.ascontiguousarray(array).view()
    array.flags.writeable = False
    return array


@jit_lean
def file_feed_kernel(floats: Floats, ints: Ints, i: int) -> float:
    """The F in force after a row, in the file's units a minute, to four digits as files have it."""
    unit = 1.0 / INCH if ints[FLAGS, i] & INCHES else 1.0
    return float(np.rint(floats[FEEDRATE, i] * 60.0 * (unit / floats[SPEED_FACTOR, i]) * 1e4) / 1e4)


@jit_lean
def e_digits_kernel(area: float, nozzle: float) -> int:
    """Digits after the point that E needs, by the mm^2 that it pushes: the last is FINE of SHORT mm of nozzle^2."""
    digits = math.ceil(math.log10(max(area, 1e-9) / (FINE * SHORT * (nozzle * nozzle))))
    return min(max(digits, LEAST_E_DIGITS), MOST_E_DIGITS)


@jit_lean
def load_row_kernel(
    text: Bytes, floats: Floats, ints: Ints, p0: Floats, p1: Floats, center: Floats, steady: Floats, phases: Floats,
    i: int, first: int, last: int, bounds: Floats, carry: Floats, row: Floats, whole: Ints,
) -> None:  # fmt: skip
    """Fill `row` and `whole` with the move `i`, phases first to last (not included): what writing its lines takes."""
    for c in range(N_FLOATS):
        row[c] = floats[c, i]
    for c in range(N_INTS):
        whole[c] = ints[c, i]
    for axis in range(3):
        row[X0 + axis], row[X1 + axis] = p0[i, axis], p1[i, axis]
    row[CENTER], row[CENTER + 1] = center[i, 0], center[i, 1]
    row[FEED] = (1.0 / INCH if whole[FLAGS] & INCHES else 1.0) / row[SPEED_FACTOR]
    row[STEADY] = steady[min(max(whole[TOOL], 0), len(steady) - 1)]
    if np.isnan(row[CORNER_SPEED]):
        row[CORNER_SPEED] = bounds[SQUARE_CORNER]
    if not row[E] > 0.0:
        row[ACCEL] = bounds[TRAVEL_ACCEL] if np.isnan(row[ACCEL_TRAVEL]) else row[ACCEL_TRAVEL]
    elif np.isnan(row[ACCEL]):
        row[ACCEL] = bounds[PRINT_ACCEL]
    row[TAKES] = takes_kernel(ints, i, bounds, carry)
    if last > first:
        row[BEGIN], row[FINISH] = phases[T, first], phases[T, last - 1] + phases[DURATION, last - 1]
    whole[PHASE], whole[PHASES] = first, last
    whole[DIGITS] = min(max(whole[DIGITS], LEAST_DIGITS), MOST_DIGITS)
    whole[E_DIGITS] = min(max(whole[E_DIGITS], e_digits_kernel(row[AREA], bounds[NOZZLE])), MOST_E_DIGITS)
    stop = whole[END]
    while stop > whole[START] and (text[stop - 1] == 10 or text[stop - 1] == 13):
        stop -= 1
    whole[STOP] = stop
    whole[COMMENT] = comment_kernel(text, whole[START], stop)


@jit_lean
def takes_kernel(ints: Ints, i: int, bounds: Floats, carry: Floats) -> float:
    """Seconds that a line itself waits: a change of tools."""
    return bounds[SWITCH_DWELL] if ints[KIND, i] == TOOL_CHANGE and ints[TOOL, i] != carry[TOOL_IN] else 0.0
