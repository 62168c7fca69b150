"""Look-ahead: how fast each run of moves may begin and end, so that the machine can always stop in time.

    speed
      |      ____cruise_____
      |     /               \\      junction      backward: what can still brake for what comes after
      |    /                 \\____ v             forward:  what can be reached from what came before
      |___/                       \\___________
        run 0        run 1          run 2

Moves at one cruising speed whose junctions do not slow them form a run, and a run is planned as one long move: a ramp
may span many short moves. The speed at which a corner may be taken is `junction.py`'s. Where an extruder cannot follow
the acceleration asked for, the moves come cut and with a ceiling (`edges.py`).

What comes later is not known while the input streams. The backward pass runs twice over what is pending, once as if the
machine stopped at the end of what is known and once as if it never had to slow down there; where both agree, no future
can change the result, and the moves leave. So any chunking gives the same plan, and what is held back is a braking
distance. A run is closed after RUN_RAMPS ramps from rest to its cruising speed, and at the IDLE-th row without motion,
which keeps it bounded too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.config import Machine
from gcodectl.jit import jit_lean
from gcodectl.motion.edges import Ceiling, edges
from gcodectl.motion.follow import Follow
from gcodectl.motion.junction import junction_kernel
from gcodectl.motion.limits import ACCEL, ARC, CORNER_SPEED, CRUISE, DISTANCE, OWN_ACCEL, motion_limits
from gcodectl.motion.ramp import ramp_distance_kernel, reachable_kernel
from gcodectl.path import tangent_kernel
from gcodectl.records import Moves, SpeedPlan

RUN_RAMPS = 4.0
IDLE = 10_000
"""Rows without motion or rest, comments say, before which firmware is taken to have come to rest for want of moves."""
R_LENGTH, R_CRUISE, R_ACCEL, R_JUNCTION, R_MOST, R_ENTRY, RUN_FLOATS = range(7)
"""What is known of a run: mm, mm/s, mm/s^2; how fast it may begin by its corner, by what comes after, and does."""


@jit_lean
def runs_kernel(
    limits: Floats, rests: Bools, kind: NDArray[np.int8], plane: NDArray[np.int8], p0: Floats, p1: Floats,
    center: Floats, sweep: Floats, length: Floats, jerk: float, heading: Floats, first: Ints, runs: Floats,
) -> int:  # fmt: skip
    """Group rows into runs: fills `first` with each run's first row and `runs` with what it is planned from.

    Rows that neither move nor stop belong to the run before them; returns how many runs there are. `heading` is room
    for two directions: where the last move went, and where this one goes.
    """
    count = 0
    last = -1  # last row that moved with nothing stopping since
    idle = 0  # rows since then
    enough = 0.0
    for i in range(len(kind)):
        distance, cruise, accel = limits[DISTANCE, i], limits[CRUISE, i], limits[ACCEL, i]
        if distance <= 0.0:
            idle += 1
            if not rests[i] and (idle < IDLE or last < 0):
                continue
            last = -1
        on_path = distance > 0.0 and length[i] > 0.0
        arc = kind[i] == ARC
        if on_path:
            tangent_kernel(p0[i], p1[i], center[i], sweep[i], plane[i], arc, 0.0, heading[1])
        speed = 0.0
        if last >= 0 and on_path and length[last] > 0.0:
            cosine = heading[0, 0] * heading[1, 0] + heading[0, 1] * heading[1, 1] + heading[0, 2] * heading[1, 2]
            speed = junction_kernel(
                cosine, limits[OWN_ACCEL, last], limits[OWN_ACCEL, i], limits[CORNER_SPEED, last],
                limits[CORNER_SPEED, i], limits[DISTANCE, last], distance,
            )  # fmt: skip
            speed = min(speed, limits[CRUISE, last], cruise)
        same = (
            last >= 0 and speed >= cruise and cruise == runs[R_CRUISE, count - 1] and accel == runs[R_ACCEL, count - 1]
        )
        if not (same and runs[R_LENGTH, count - 1] < enough):
            first[count] = i
            runs[R_LENGTH, count], runs[R_CRUISE, count], runs[R_ACCEL, count] = 0.0, cruise, accel
            runs[R_JUNCTION, count] = speed
            enough = RUN_RAMPS * ramp_distance_kernel(0.0, cruise, accel, jerk) if distance > 0.0 else 0.0
            count += 1
        runs[R_LENGTH, count - 1] += distance
        if distance > 0.0:
            last, idle = i, 0
            if arc:
                tangent_kernel(p0[i], p1[i], center[i], sweep[i], plane[i], arc, 1.0, heading[0])
            else:
                for axis in range(3):
                    heading[0, axis] = heading[1, axis]
    return count


@jit_lean
def before_kernel(runs: Floats, r: int, speed: float, jerk: float) -> float:
    """The fastest that run r may begin, if it must end at `speed`."""
    most = min(runs[R_CRUISE, r], runs[R_JUNCTION, r])
    length = runs[R_LENGTH, r]
    if speed >= most or length <= 0.0 or ramp_distance_kernel(speed, most, runs[R_ACCEL, r], jerk) <= length:
        return float(min(speed, most) if length <= 0.0 else most)
    return float(min(most, reachable_kernel(speed, length, runs[R_ACCEL, r], jerk)))


@jit_lean
def backward_kernel(runs: Floats, count: int, jerk: float) -> int:
    """Fill how fast each run may begin if the machine stops behind the last; returns the last run that is settled.

    A run is settled where it may begin as fast if nothing behind the last ever slows the machine down; run 0 always is.
    """
    speed = 0.0
    for r in range(count - 1, -1, -1):
        speed = before_kernel(runs, r, speed, jerk)
        runs[R_MOST, r] = speed
    speed = math.inf
    for r in range(count - 1, 0, -1):
        speed = before_kernel(runs, r, speed, jerk)
        if r < count - 1 and speed == runs[R_MOST, r]:
            return r
    return 0


@jit_lean
def forward_kernel(runs: Floats, count: int, jerk: float, speed: float) -> None:
    """Fill the speed each run begins at, the first at `speed`, and one more: the speed behind the last."""
    for r in range(count):
        speed = min(speed, runs[R_MOST, r])
        runs[R_ENTRY, r] = speed
        length, cruise, accel = runs[R_LENGTH, r], runs[R_CRUISE, r], runs[R_ACCEL, r]
        most = min(cruise, runs[R_MOST, r + 1] if r + 1 < count else 0.0)
        if length <= 0.0:
            speed = 0.0
        elif speed >= most or ramp_distance_kernel(speed, most, accel, jerk) <= length:
            speed = most
        else:
            speed = min(most, reachable_kernel(speed, length, accel, jerk))
    runs[R_ENTRY, count] = 0.0


@jit_lean
def spread_kernel(
    limits: Floats, first: Ints, runs: Floats, count: int, jerk: float, done: int, rows: Floats, run: Ints
) -> None:
    """Spread what was planned by run over `done` rows: fills `rows` (entry, exit, accel, jerk) and each row's run."""
    r = -1
    for i in range(done):
        while r + 1 < count and first[r + 1] == i:
            r += 1
        moves = r >= 0 and limits[DISTANCE, i] > 0.0
        rows[0, i] = runs[R_ENTRY, r] if moves else 0.0
        rows[1, i] = runs[R_ENTRY, r + 1] if moves else 0.0
        rows[2, i] = limits[ACCEL, i] if moves else 0.0
        rows[3, i] = jerk if moves else 0.0
        run[i] = r


@jit_lean
def plan_kernel(
    limits: Floats, rests: Bools, kind: NDArray[np.int8], plane: NDArray[np.int8], p0: Floats, p1: Floats,
    center: Floats, sweep: Floats, length: Floats, jerk: float, entry: float, ended: bool, heading: Floats,
    first: Ints, runs: Floats, rows: Floats, run: Ints,
) -> tuple[int, int, float]:  # fmt: skip
    """Plan rows that begin at `entry` mm/s: (rows and runs that no later row can change, the next one's speed)."""
    count = runs_kernel(limits, rests, kind, plane, p0, p1, center, sweep, length, jerk, heading, first, runs)
    if count == 0:
        spread_kernel(limits, first, runs, 0, jerk, len(kind), rows, run)
        return len(kind), 0, entry
    runs[R_JUNCTION, 0] = math.inf  # already in entry
    settled = backward_kernel(runs, count, jerk)
    forward_kernel(runs, count, jerk, entry)
    ended = ended or runs[R_LENGTH, count - 1] <= 0.0  # nothing slows a machine down that rests
    settled, done = (count, len(kind)) if ended else (settled, int(first[settled]))
    spread_kernel(limits, first, runs, settled, jerk, done, rows, run)
    return done, settled, runs[R_ENTRY, settled]


def plan(chunks: Iterable[Moves], machine: Machine, follow: Follow | None = None) -> Iterator[tuple[Moves, SpeedPlan]]:
    """Plan speeds for a stream of moves, holding back what later moves may still slow down.

    Yields every row once, in order, with its plan. mm, mm/s, mm/s^2, mm/s^3; `machine.jerk` may be inf (trapezoids).
    With `follow`, rows are cut where the acceleration that the extruder can follow changes, and later ones numbered on.
    """
    pending, ceiling = Moves.empty(), Ceiling.empty()
    entry, run = 0.0, 0

    def held() -> Moves:
        return pending

    for joined, above in edges(chunks, machine, follow, held):
        pending = joined
        ceiling = Ceiling.concat([ceiling, above])
        speeds, runs, entry = _settle(pending, ceiling, machine, entry, run, ended=False)
        if done := len(speeds):
            yield pending[:done], speeds
            run, pending, ceiling = run + runs, pending[done:], ceiling[done:]
    if len(pending):
        yield pending, _settle(pending, ceiling, machine, entry, run, ended=True)[0]


def _settle(
    moves: Moves, ceiling: Ceiling, machine: Machine, entry: float, run0: int, *, ended: bool
) -> tuple[SpeedPlan, int, float]:
    """Plan the rows of `moves` that no later one can change: their plan and runs, and the speed the next begins at."""
    n = len(moves)
    limits = motion_limits(moves, machine, ceiling.accel, ceiling.speed)
    rows, run = np.empty((4, n)), np.empty(n, dtype=np.int64)
    done, runs, entry = plan_kernel(
        limits.table, limits.rests, moves.kind, moves.plane, moves.p0, moves.p1, moves.center, moves.sweep,
        moves.length, float(machine.jerk), float(entry), ended, np.zeros((2, 3)), np.empty(n, dtype=np.int64),
        np.empty((RUN_FLOATS, n + 1)), rows, run,
    )  # fmt: skip
    entries, exits, accel, jerk = rows[:, :done]
    speeds = SpeedPlan(
        row=moves.row[:done], run=run0 + run[:done], distance=limits.distance[:done], entry=entries,
        cruise=limits.cruise[:done], exit=exits, accel=accel, own_accel=limits.own_accel[:done],
        jerk=jerk, rests=limits.rests[:done],
        limited_by=limits.limited_by[:done], ruled_by=ceiling.ruled_by[:done],
    )  # fmt: skip
    return speeds, runs, entry
