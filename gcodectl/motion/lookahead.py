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
distance. A run is closed after RUN_RAMPS ramps from rest to its cruising speed, which keeps it bounded too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.config import Machine
from gcodectl.jit import jit
from gcodectl.motion.edges import Ceiling, edges
from gcodectl.motion.follow import Follow
from gcodectl.motion.junction import junction_kernel
from gcodectl.motion.limits import MotionLimits, motion_limits, stops_at
from gcodectl.motion.ramp import ramp_distance_kernel, reachable_kernel
from gcodectl.path import tangents
from gcodectl.records import Moves, SpeedPlan

RUN_RAMPS = 4.0


@jit
def runs_kernel(
    distance: Floats, cruise: Floats, accel: Floats, own: Floats, corner: Floats, jerk: float, on_path: Bools,
    stops: Bools, start: Floats, end: Floats, first: Ints, junction: Floats,
) -> int:  # fmt: skip
    """Group rows into runs: fills `first` with each run's first row and `junction` with the speed it may begin at.

    Rows that neither move nor stop belong to the run before them; returns how many runs there are.
    """
    runs = 0
    last = -1  # last row that moved with nothing stopping since
    travelled = 0.0
    for i in range(len(distance)):
        if distance[i] <= 0.0 and not stops[i]:
            continue
        speed = 0.0
        if last >= 0 and not stops[i] and on_path[i] and on_path[last]:
            cosine = end[last, 0] * start[i, 0] + end[last, 1] * start[i, 1] + end[last, 2] * start[i, 2]
            speed = junction_kernel(cosine, own[last], own[i], corner[last], corner[i], distance[last], distance[i])
            speed = min(speed, cruise[last], cruise[i])
        same = speed >= cruise[i] and last >= 0 and cruise[i] == cruise[last] and accel[i] == accel[last]
        if not (same and travelled < RUN_RAMPS * ramp_distance_kernel(0.0, cruise[i], accel[i], jerk)):
            first[runs] = i
            junction[runs] = speed
            runs += 1
            travelled = 0.0
        travelled += distance[i]
        last = -1 if stops[i] else i
    return runs


@jit
def backward_kernel(
    length: Floats, cruise: Floats, accel: Floats, junction: Floats, jerk: float, final: float, most: Floats
) -> None:
    """Fill `most` with the fastest each run may begin, if the last may end at `final` mm/s."""
    speed = final
    for r in range(len(length) - 1, -1, -1):
        speed = min(speed, cruise[r])
        if length[r] > 0.0:
            speed = min(cruise[r], reachable_kernel(speed, length[r], accel[r], jerk))
        speed = min(speed, junction[r])
        most[r] = speed


@jit
def forward_kernel(
    length: Floats, cruise: Floats, accel: Floats, most: Floats, jerk: float, entry0: float, entry: Floats
) -> None:
    """Fill `entry` with the speed each run begins at, the first at `entry0`."""
    speed = entry0
    for r in range(len(length)):
        speed = min(speed, most[r])
        entry[r] = speed
        speed = min(cruise[r], reachable_kernel(speed, length[r], accel[r], jerk)) if length[r] > 0.0 else 0.0


def plan(chunks: Iterable[Moves], machine: Machine, follow: Follow | None = None) -> Iterator[tuple[Moves, SpeedPlan]]:
    """Plan speeds for a stream of moves, holding back what later moves may still slow down.

    Yields every row once, in order, with its plan. mm, mm/s, mm/s^2, mm/s^3; `machine.jerk` may be inf (trapezoids).
    With `follow`, rows are cut where the acceleration that the extruder can follow changes, and later ones numbered on.
    """
    pending, ceiling = Moves.empty(), Ceiling.empty()
    entry, run = 0.0, 0
    for chunk, above in edges(chunks, machine, follow):
        pending, ceiling = Moves.concat([pending, chunk]), Ceiling.concat([ceiling, above])
        done, speeds, entry = _settle(pending, ceiling, machine, entry, run, ended=False)
        if done:
            yield pending[:done], speeds
            run, pending, ceiling = int(speeds.run[-1]) + 1, pending[done:], ceiling[done:]
    if len(pending):
        _, speeds, _ = _settle(pending, ceiling, machine, entry, run, ended=True)
        yield pending, speeds


def _settle(
    moves: Moves, ceiling: Ceiling, machine: Machine, entry0: float, run0: int, *, ended: bool
) -> tuple[int, SpeedPlan, float]:
    """Plan `moves`; returns how many rows no later move can change, their plan, and the speed the next begins at."""
    limits = motion_limits(moves, machine, ceiling.accel, ceiling.speed)
    first, junction = np.empty(len(moves), dtype=np.int64), np.empty(len(moves))
    runs = runs_kernel(
        limits.distance, limits.cruise, limits.accel, limits.corner_accel, limits.corner_speed, machine.jerk,
        moves.length > 0, stops_at(moves), *tangents(moves), first, junction,
    )  # fmt: skip
    first, junction = first[:runs], junction[:runs]
    if not runs:
        return len(moves), _speed_plan(moves, limits, ceiling, machine, first, np.empty(0), np.empty(0), run0), entry0
    junction[0] = np.inf  # already in entry0
    length = np.add.reduceat(limits.distance, first)
    cruise, accel = limits.cruise[first], limits.accel[first]
    most, hopeful, entry = np.empty(runs), np.empty(runs), np.empty(runs)
    backward_kernel(length, cruise, accel, junction, machine.jerk, 0.0, most)
    forward_kernel(length, cruise, accel, most, machine.jerk, entry0, entry)
    exit_ = np.append(entry[1:], 0.0)
    if ended:
        return len(moves), _speed_plan(moves, limits, ceiling, machine, first, entry, exit_, run0), 0.0
    backward_kernel(length, cruise, accel, junction, machine.jerk, np.inf, hopeful)
    # the last run may still grow: it, and what braking for its end may change, stays
    settled = int(np.flatnonzero(np.append(most[:-1] == hopeful[:-1], False) | (np.arange(runs) == 0)).max())
    done = int(first[settled])
    speeds = _speed_plan(
        moves[:done], limits, ceiling, machine, first[:settled], entry[:settled], exit_[:settled], run0
    )
    return done, speeds, float(entry[settled])


def _speed_plan(
    moves: Moves, limits: MotionLimits, ceiling: Ceiling, machine: Machine, first: Ints, entry: Floats, exit_: Floats,
    run0: int,
) -> SpeedPlan:  # fmt: skip
    """Spread what was planned by run over its rows."""
    n = len(moves)
    of_run = np.searchsorted(first, np.arange(n), side="right") - 1
    moving = (limits.distance[:n] > 0) & (of_run >= 0)
    index = np.maximum(of_run, 0) if len(first) else np.zeros(n, dtype=np.int64)

    def at(values: Floats) -> Floats:
        return np.where(moving, values[index], 0.0) if len(first) else np.zeros(n)

    return SpeedPlan(
        row=moves.row,
        run=run0 + of_run,
        distance=limits.distance[:n],
        entry=at(entry),
        cruise=limits.cruise[:n],
        exit=at(exit_),
        accel=np.where(moving, limits.accel[:n], 0.0),
        jerk=np.where(moving, machine.jerk, 0.0),
        rests=stops_at(moves),
        limited_by=limits.limited_by[:n],
        ruled_by=ceiling.ruled_by[:n],
    )
