"""Profile: the jerk-limited motion of every move over time, one row a phase of constant jerk.

Ruckig finds the time-optimal motion of each run between the speeds that look-ahead gave it; the phases are then cut
where one move of the run ends and the next begins:

    v |    ___________          run: up to 7 phases      |j|0|-j|   0   |-j|0|j|
      |   /           \\         its moves                | move 0 |  move 1  |m 2|
      |__/             \\__      rows of the profile      |.|.|..|.|    .     |.|.|..

A run at one speed is one phase and needs no solver; equal runs are solved once. Where a run's length is just what its
ramp takes (look-ahead leaves it no more), the ramp is written down directly: a solver at the edge of what is feasible
may answer with a motion that runs backwards.

Standing still is a phase too: dwells and tool changes; so that a learned Stop may run out before the machine does
something else, up to `settle` seconds at a barrier that follows deposition too closely; and so that a learned Start may
begin in time, up to `lead` seconds at a hold (a dwell without a line) that comes too soon after a barrier.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Ruckig, RuckigError, Trajectory

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.config import Machine
from gcodectl.errors import GcodectlError
from gcodectl.jit import jit
from gcodectl.motion.ramp import peak_kernel, ramp_distance_kernel
from gcodectl.records import Kind, Moves, Profile, SpeedPlan

ONLY_JUST = 1e-4
"""Share of a run that its one ramp may leave over, where the solver need not find a way."""
Phase = tuple[float, float, float, float, float]
"""Seconds it lasts, then where it begins: mm, mm/s, mm/s^2; and its jerk, mm/s^3."""


def run_phases(length: float, entry: float, exit_: float, cruise: float, accel: float, jerk: float) -> list[Phase]:
    """Time-optimal phases of one run: `length` mm from speed `entry` to `exit_`, never over `cruise`.

    Raises GcodectlError where the speeds do not fit the length: look-ahead's promise broken.
    """
    needed = float(ramp_distance_kernel(entry, exit_, accel, jerk))
    if math.isinf(jerk) or length - needed <= 1e-7 * length:
        return _ramps(length, entry, exit_, cruise, accel, jerk)
    return _solve(length, entry, exit_, cruise, accel, jerk)


@lru_cache(maxsize=65536)
def _solve(length: float, entry: float, exit_: float, cruise: float, accel: float, jerk: float) -> list[Phase]:
    solver, trajectory = Ruckig(1), Trajectory(1)
    problem = InputParameter(1)
    problem.current_position, problem.target_position = [0.0], [length]
    problem.current_velocity, problem.target_velocity = [entry], [exit_]
    problem.max_velocity, problem.max_acceleration, problem.max_jerk = [cruise], [accel], [jerk]
    try:
        solver.calculate(problem, trajectory)
    except RuckigError as error:
        if length - float(ramp_distance_kernel(entry, exit_, accel, jerk)) <= ONLY_JUST * length:
            return _ramps(length, entry, exit_, cruise, accel, jerk)  # the solver's own rounding is coarser than ours
        raise GcodectlError(f"no motion of {length} mm from {entry} to {exit_} mm/s was found: {error}") from error
    solved = trajectory.profiles[0][0]
    phases = [
        (duration, s, v, a, j)
        for duration, s, v, a, j in zip(solved.t, solved.p, solved.v, solved.a, solved.j, strict=False)
        if duration > 1e-12
    ]
    if not phases or solved.brake.duration > 0 or min(phase[2] for phase in phases) < -1e-6:
        return _ramps(length, entry, exit_, cruise, accel, jerk)
    return phases


def _ramps(length: float, entry: float, exit_: float, cruise: float, accel: float, jerk: float) -> list[Phase]:
    """The same motion from the ramp's closed form: up, along, down."""
    peak = float(peak_kernel(entry, exit_, cruise, length, accel, jerk))
    up = float(ramp_distance_kernel(entry, peak, accel, jerk))
    along = length - up - float(ramp_distance_kernel(peak, exit_, accel, jerk))
    phases = _one_ramp(0.0, entry, peak, accel, jerk)
    if along > 1e-9 * length:
        phases.append((along / peak, up, peak, 0.0, 0.0))
    return phases + _one_ramp(up + max(along, 0.0), peak, exit_, accel, jerk)


def _one_ramp(s: float, v0: float, v1: float, accel: float, jerk: float) -> list[Phase]:
    """The phases of a change of speed: three, two, or none where there is no change."""
    if v0 == v1:
        return []
    dv, sign = abs(v1 - v0), math.copysign(1.0, v1 - v0)
    if math.isinf(jerk):
        return [(dv / accel, s, v0, sign * accel, 0.0)]
    rise = min(accel / jerk, math.sqrt(dv / jerk))
    flat = max(0.0, dv / accel - accel / jerk) if dv * jerk >= accel * accel else 0.0
    phases: list[Phase] = []
    v, a = v0, 0.0
    for duration, j in ((rise, sign * jerk), (flat, 0.0), (rise, -sign * jerk)):
        if duration > 0:
            phases.append((duration, s, v, a, j))
            s += duration * (v + duration * (a / 2 + duration * j / 6))
            v += duration * (a + duration * j / 2)
            a += duration * j
    return phases


@jit
def time_at_kernel(ds: float, v: float, a: float, j: float, longest: float) -> float:
    """Seconds into a phase until it has gone ds mm; between 0 and `longest`."""
    low, high = 0.0, longest
    t = min(longest, ds / v) if v > 0.0 else 0.5 * longest
    for _ in range(60):
        error = t * (v + t * (a / 2.0 + t * j / 6.0)) - ds
        if error > 0.0:
            high = t
        else:
            low = t
        speed = v + t * (a + t * j / 2.0)
        step = t - error / speed if speed > 0.0 else -1.0
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - t) <= 1e-15 * longest or high - low <= 1e-15 * longest:
            return step
        t = step
    return t


@jit
def cut_kernel(
    rows: Ints, distance: Floats, stand: Floats, run: Ints, settle: Bools, deposits: Bools, holds: Bools, begins: Bools,
    longest_settle: float, longest_lead: float,
    phase_run: Ints, phases: Floats, carry: Floats, out_row: Ints, out: Floats,
) -> int:  # fmt: skip
    """Cut the phases of runs at the ends of their moves; fills `out` (t, duration, s, v, a, j), returns the rows made.

    `carry` is (time now, time of the last deposition's end or -inf, begin of the passage) and is brought up to date.
    """
    n = 0
    p = 0
    used = 0.0  # seconds of phase p that earlier moves of the run have had
    now = carry[0]
    for i in range(len(rows)):
        wait = stand[i]
        if settle[i] and carry[1] > -math.inf:
            wait += max(0.0, longest_settle - (now - carry[1]))
            carry[1] = -math.inf
        if holds[i]:
            wait += max(0.0, longest_lead - (now - carry[2]))
        if wait > 0.0:
            out_row[n] = rows[i]
            out[n, 0], out[n, 1] = now, wait
            out[n, 2], out[n, 3], out[n, 4], out[n, 5] = 0.0, 0.0, 0.0, 0.0
            n += 1
            now += wait
        if begins[i]:
            carry[2] = now
        if distance[i] <= 0.0:
            continue
        while p < len(phase_run) and phase_run[p] < run[i]:
            p += 1
            used = 0.0
        gone = 0.0
        last_of_run = i + 1
        while last_of_run < len(rows) and distance[last_of_run] <= 0.0:
            last_of_run += 1
        ends_run = last_of_run >= len(rows) or run[last_of_run] != run[i]
        while p < len(phase_run) and phase_run[p] == run[i]:
            v = phases[p, 2] + used * (phases[p, 3] + used * phases[p, 4] / 2.0)
            a = phases[p, 3] + used * phases[p, 4]
            j = phases[p, 4]
            left = phases[p, 0] - used
            reach = left * (v + left * (a / 2.0 + left * j / 6.0))
            fits = ends_run or gone + reach <= distance[i]
            took = left if fits else time_at_kernel(distance[i] - gone, v, a, j, left)
            if took > 0.0:
                out_row[n] = rows[i]
                out[n, 0], out[n, 1], out[n, 2] = now, took, gone
                out[n, 3], out[n, 4], out[n, 5] = v, a, j
                n += 1
                now += took
                gone += took * (v + took * (a / 2.0 + took * j / 6.0))
            if not fits:
                used += took
                break
            p += 1
            used = 0.0
        if deposits[i]:
            carry[1] = now
    carry[0] = now
    return n


def profile(
    chunks: Iterable[tuple[Moves, SpeedPlan]], machine: Machine, settle: float = 0.0, lead: float = 0.0
) -> Iterator[tuple[Moves, SpeedPlan, Profile]]:
    """Give each planned move its phases over time, s, with at most `settle` more at barriers and `lead` at holds."""
    carry = np.array([0.0, -np.inf, 0.0])
    tool = 0
    for moves, speeds in chunks:
        stand = np.where(moves.kind == Kind.DWELL, moves.dwell, 0.0)
        stand = np.where(moves.switches(tool), machine.switch_dwell, stand)
        tool = int(moves.tool[-1]) if len(moves) else tool
        settles = np.isin(moves.kind, (Kind.TOOL, Kind.BARRIER))
        phase_run, phases = _all_phases(speeds)
        most = len(moves) * 2 + len(phases)
        out_row, out = np.empty(most, dtype=np.int64), np.empty((most, 6))
        deposits = moves.deposits
        made = cut_kernel(
            moves.row, speeds.distance, stand, speeds.run, settles, deposits, moves.holds, moves.starts_passage,
            settle, lead, phase_run, phases, carry, out_row, out,
        )  # fmt: skip
        t, duration, s, v, a, j = out[:made].T.copy()
        yield moves, speeds, Profile(row=out_row[:made].copy(), t=t, duration=duration, s=s, v=v, a=a, j=j)


def _all_phases(speeds: SpeedPlan) -> tuple[Ints, Floats]:
    """Phases of every run in `speeds`, in order: the run's number, and (duration, s, v, a, j)."""
    moving = np.flatnonzero(speeds.distance > 0)
    if not len(moving):
        return np.empty(0, dtype=np.int64), np.empty((0, 5))
    runs, first = np.unique(speeds.run[moving], return_index=True)
    length = np.add.reduceat(speeds.distance[moving], first)
    row = moving[first]
    entry, exit_, cruise = speeds.entry[row], speeds.exit[row], speeds.cruise[row]
    steady = (entry == cruise) & (exit_ == cruise)
    counts: NDArray[np.int64] = np.ones(len(runs), dtype=np.int64)
    solved: list[list[Phase]] = []
    for k in range(len(runs)):
        if steady[k]:
            solved.append([(length[k] / cruise[k], 0.0, cruise[k], 0.0, 0.0)])
            continue
        problem = (length[k], entry[k], exit_[k], cruise[k], speeds.accel[row[k]], speeds.jerk[row[k]])
        solved.append(run_phases(*map(float, problem)))
        counts[k] = len(solved[-1])
    return np.repeat(runs, counts), np.array([phase for phases in solved for phase in phases], dtype=np.float64)
