"""Packed: a composed chunk as three plain arrays and a carry, for the kernels that write lines of it.

floats[row, column]   numbers of a move        phases[phase, column]   its motion over time (PHASE to PHASES)
ints[row, column]     where its line is, what it is, how it is written
carry[column]         what goes on from row to row
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.config import Machine
from gcodectl.records import Flag, Moves, Profile, SpeedPlan

INCH = 25.4
FINE, SHORT = 0.01, 0.1
LEAST_E_DIGITS, MOST_E_DIGITS = 5, 8
RELATIVE_XYZ, RELATIVE_E, INCHES = int(Flag.RELATIVE_XYZ), int(Flag.RELATIVE_E), int(Flag.INCHES)

X0, X1, CENTER, SWEEP, DISTANCE, E, AREA, E_END = 0, 3, 6, 8, 9, 10, 11, 12
"""Columns of `floats`: start and end (3 each), centre (2) and angle of an arc, path, E, its area, logical E after."""
FEED, FLOW, STEADY, F_FILE, TAKES = 13, 14, 15, 16, 17
"""What turns mm/s into the file's units, M221, 1 / K, the file's F, seconds that the line itself waits."""
SLOW, OWN_ACCEL, CORNER_SPEED, N_FLOATS = 18, 19, 20, 21
"""Whether the plan speeds up and brakes more slowly than firmware would (1, else 0), what firmware does it at, mm/s^2,
and the square corner velocity, mm/s."""
START, END, KIND, FLAGS, PLANE, DIGITS, E_DIGITS, PHASE, PHASES, N_INTS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
"""Columns of `ints`: the line's bytes, what it is, its digits, and its phases (the last not included)."""
E_OUT, F_OUT, E_IN, F_IN, OWED, NOMINAL, X_OUT, MARKED, MOVED = 0, 1, 2, 3, 4, 5, 6, 9, 10
OPEN, RETURNS, RATIO, CARRY = 11, 12, 13, 14
"""Carried: logical E and F of the output and of the file (file units), volume owed, nominal flow, position of the
output (3), whether our mark is out, what the last E word moved, whether the last line out has no end yet, whether the
file's lines end in CRLF, and the mm of E a mm of path of the last line out."""
T, DURATION, S, V, A, J, N_PHASE = 0, 1, 2, 3, 4, 5, 6
"""Columns of `phases`."""


def pack(
    moves: Moves,
    speeds: SpeedPlan,
    profile: Profile,
    steady: Floats,
    takes: Floats,
    machine: Machine,
) -> tuple[Floats, Ints, Floats]:
    """Put what the kernels need side by side; `steady` by tool, `takes` by row."""
    n = len(moves)
    floats, ints = np.zeros((n, N_FLOATS)), np.zeros((n, N_INTS), dtype=np.int64)
    floats[:, X0 : X0 + 3], floats[:, X1 : X1 + 3] = moves.p0, moves.p1
    floats[:, CENTER : CENTER + 2], floats[:, SWEEP] = moves.center, moves.sweep
    floats[:, DISTANCE] = np.where(moves.length > 0, speeds.distance, 0.0)
    floats[:, E], floats[:, AREA], floats[:, E_END] = moves.e, moves.area, moves.e_end
    inches = (moves.flags & INCHES) != 0
    floats[:, FEED] = np.where(inches, 1.0 / INCH, 1.0) / moves.speed_factor
    floats[:, FLOW] = moves.flow_factor
    floats[:, STEADY] = steady[np.clip(moves.tool, 0, len(steady) - 1)]
    floats[:, F_FILE] = np.round(moves.feed * 60.0 * floats[:, FEED], 4)
    floats[:, TAKES] = takes
    floats[:, CORNER_SPEED] = np.where(np.isnan(moves.corner_speed), machine.corner_speed, moves.corner_speed)
    floats[:, SLOW] = speeds.ruled_by > 0
    printing = np.where(np.isnan(moves.accel), machine.accel, moves.accel)
    travelling = np.where(np.isnan(moves.travel_accel), machine.travel_accel, moves.travel_accel)
    floats[:, OWN_ACCEL] = np.where(moves.e > 0, printing, travelling)
    ints[:, START], ints[:, END] = moves.start, moves.end
    ints[:, KIND], ints[:, FLAGS], ints[:, PLANE] = moves.kind, moves.flags, moves.plane
    ints[:, DIGITS] = np.clip(moves.decimals[:, 0], 3, 6)
    ints[:, E_DIGITS] = np.clip(moves.decimals[:, 1], e_digits(moves.area, machine.nozzle), MOST_E_DIGITS)
    ints[:, PHASE] = np.searchsorted(profile.row, moves.row)
    ints[:, PHASES] = np.searchsorted(profile.row, moves.row, side="right")
    phases = np.column_stack([profile.t, profile.duration, profile.s, profile.v, profile.a, profile.j])
    assert phases.shape[1] == N_PHASE
    return floats, ints, np.ascontiguousarray(phases)


def e_digits(area: Floats, nozzle: float) -> Ints:
    """Digits after the point that E needs, by the mm^2 that it pushes: the last is FINE of SHORT mm of nozzle^2."""
    digits = np.ceil(np.log10(np.maximum(area, 1e-9) / (FINE * SHORT * nozzle**2)))
    return np.clip(digits, LEAST_E_DIGITS, MOST_E_DIGITS).astype(np.int64)
