"""Profile: the jerk-limited motion of every move over time, one row a phase of constant jerk.

A run goes from one speed to another in the least time, both ends without acceleration: a ramp up to its peak, along at
that speed where it is the cruising speed, a ramp down. Each ramp is `ramp.py`'s, so all is closed form but the peak of
runs too short to reach the acceleration asked for. The phases are then cut where one move of the run ends and the next
begins:

    v |    ___________          run: up to 7 phases      |j|0|-j|   0   |-j|0|j|
      |   /           \\         its moves                | move 0 |  move 1  |m 2|
      |__/             \\__      rows of the profile      |.|.|..|.|    .     |.|.|..

Standing still is a phase too: dwells and tool changes; so that a learned Stop may run out before the machine does
something else, up to `settle` seconds at a barrier that follows deposition too closely; and so that a learned Start may
begin in time, up to `lead` seconds at a hold (a dwell without a line) that comes too soon after a barrier.

That nothing is faster is tested against ruckig's time-optimal solutions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats, Ints
from gcodectl.config import Machine
from gcodectl.jit import jit_lean
from gcodectl.motion.ramp import peak_kernel, ramp_distance_kernel
from gcodectl.records import Kind, Moves, Profile, SpeedPlan, deposits_kernel, starts_passage_kernel

DWELL, TOOL, BARRIER = int(Kind.DWELL), int(Kind.TOOL), int(Kind.BARRIER)

MOST = 7
"""Phases of a run."""
P_DURATION, P_S, P_V, P_A, P_J, PHASE = range(6)
"""What is known of a phase: seconds it lasts; then where it begins: mm, mm/s, mm/s^2; and its jerk, mm/s^3."""
T, DURATION, S, V, A, J, COLUMNS = range(7)
"""Rows of the kernel's output."""
NOW, LAID, PASSAGE, IN_PLACE = range(4)
"""The time, when deposition last ended (-inf: long ago), when the passage began, and the tool in place."""
SWITCH, SETTLE, LEAD = range(3)
"""What may be waited for, s: a change of tools, what is left of a road's flow, a road's flow to come."""


@jit_lean
def phase_kernel(phases: Floats, n: int, duration: float, s: float, v: float, a: float, j: float) -> int:
    """Append a phase where it lasts; returns how many there are."""
    if duration <= 0.0:
        return n
    phases[n, P_DURATION], phases[n, P_S], phases[n, P_V], phases[n, P_A], phases[n, P_J] = duration, s, v, a, j
    return n + 1


@jit_lean
def one_ramp_kernel(phases: Floats, n: int, s: float, v0: float, v1: float, accel: float, jerk: float) -> int:
    """Append the phases of a change of speed: three, two, or none where there is no change."""
    dv, sign = abs(v1 - v0), 1.0 if v1 > v0 else -1.0
    if dv == 0.0:
        return n
    if math.isinf(jerk):
        return phase_kernel(phases, n, dv / accel, s, v0, sign * accel, 0.0)
    rise = min(accel / jerk, math.sqrt(dv / jerk))
    flat = max(0.0, dv / accel - accel / jerk) if dv * jerk >= accel * accel else 0.0
    a, j = sign * rise * jerk, sign * jerk
    s1, v1 = s + rise * (v0 + rise * rise * j / 6.0), v0 + 0.5 * rise * a
    s2, v2 = s1 + flat * (v1 + 0.5 * flat * a), v1 + flat * a
    n = phase_kernel(phases, n, rise, s, v0, 0.0, j)
    n = phase_kernel(phases, n, flat, s1, v1, a, 0.0)
    return phase_kernel(phases, n, rise, s2, v2, a, -j)


@jit_lean
def run_kernel(
    phases: Floats, length: float, entry: float, leave: float, cruise: float, accel: float, jerk: float
) -> int:
    """Fill the time-optimal phases of `length` mm from speed `entry` to `leave`, never over `cruise`; how many."""
    if entry == cruise and leave == cruise:
        return phase_kernel(phases, 0, length / cruise, 0.0, cruise, 0.0, 0.0)
    peak = peak_kernel(entry, leave, cruise, length, accel, jerk)
    up = ramp_distance_kernel(entry, peak, accel, jerk)
    along = length - up - ramp_distance_kernel(peak, leave, accel, jerk)
    n = one_ramp_kernel(phases, 0, 0.0, entry, peak, accel, jerk)
    if along > 1e-9 * length:
        n = phase_kernel(phases, n, along / peak, up, peak, 0.0, 0.0)
    return one_ramp_kernel(phases, n, up + max(along, 0.0), peak, leave, accel, jerk)


@jit_lean
def time_at_kernel(ds: float, v: float, a: float, j: float, longest: float) -> float:
    """Seconds into a phase until it has gone ds mm; between 0 and `longest`."""
    if j == 0.0:
        root = math.sqrt(max(0.0, v * v + 2.0 * a * ds))
        return min(longest, 2.0 * ds / (v + root)) if v + root > 0.0 else longest
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


@jit_lean
def stand_kernel(kind: int, dwell: float, silent: bool, switches: bool, waits: Floats, carry: Floats) -> float:
    """Return how long the machine stands at a row; a `silent` one has no line, one that `switches` brings a tool."""
    now, wait = carry[NOW], 0.0
    if kind == DWELL:
        wait = dwell
    elif switches:
        wait = waits[SWITCH]
    if kind in (TOOL, BARRIER) and carry[LAID] > -math.inf:
        wait += max(0.0, waits[SETTLE] - (now - carry[LAID]))
        carry[LAID] = -math.inf
    if kind == DWELL and silent and dwell == 0.0:  # a hold: where a Start may be waited for (`flow.holds`)
        wait += max(0.0, waits[LEAD] - (now - carry[PASSAGE]))
    return wait


@jit_lean
def run_length_kernel(distance: Floats, run: Ints, i: int) -> tuple[float, int]:
    """Return the length of the run whose first moving row is i, and its last moving row."""
    length, last = 0.0, i
    for k in range(i, len(run)):
        if run[k] != run[i]:
            break
        if distance[k] > 0.0:
            length += distance[k]
            last = k
    return length, last


@jit_lean
def profile_kernel(
    distance: Floats, entry: Floats, leave: Floats, cruise: Floats, accel: Floats, jerk: Floats, run: Ints,
    rows: Ints, kind: NDArray[np.int8], flags: NDArray[np.int16], tool: NDArray[np.int16], dwell: Floats, e: Floats,
    path: Floats, begin: Ints, end: Ints, waits: Floats, phases: Floats, carry: Floats, out_row: Ints, out: Floats,
) -> int:  # fmt: skip
    """Profile every run and cut its phases at the ends of its moves; fills `out`, returns the phases made.

    text[begin:end] is a row's line. `carry` is brought up to date; `phases` is room for those of one run.
    """
    n = p = count = last = 0
    under_way = -2  # the run that `phases` holds
    used = 0.0  # seconds of phase p that earlier moves of the run have had
    for i in range(len(rows)):
        switches = kind[i] == TOOL and tool[i] != carry[IN_PLACE]
        wait = stand_kernel(kind[i], dwell[i], begin[i] == end[i], switches, waits, carry)
        now, carry[IN_PLACE] = carry[NOW], tool[i]
        if wait > 0.0:
            out_row[n] = rows[i]
            out[T, n], out[DURATION, n] = now, wait
            out[S, n], out[V, n], out[A, n], out[J, n] = 0.0, 0.0, 0.0, 0.0
            n += 1
            now += wait
        if starts_passage_kernel(kind[i], path[i], flags[i]):
            carry[PASSAGE] = now
        carry[NOW] = now
        if distance[i] <= 0.0:
            continue
        if run[i] != under_way:
            under_way, p, used = run[i], 0, 0.0
            length, last = run_length_kernel(distance, run, i)
            count = run_kernel(phases, length, entry[i], leave[i], cruise[i], accel[i], jerk[i])
        gone = 0.0
        while p < count:
            j = phases[p, P_J]
            v = phases[p, P_V] + used * (phases[p, P_A] + used * j / 2.0)
            a = phases[p, P_A] + used * j
            left = phases[p, P_DURATION] - used
            reach = left * (v + left * (a / 2.0 + left * j / 6.0))
            fits = i == last or gone + reach <= distance[i]
            took = left if fits else time_at_kernel(distance[i] - gone, v, a, j, left)
            if took > 0.0:
                out_row[n] = rows[i]
                out[T, n], out[DURATION, n], out[S, n] = now, took, gone
                out[V, n], out[A, n], out[J, n] = v, a, j
                n += 1
                now += took
                gone += took * (v + took * (a / 2.0 + took * j / 6.0))
            if not fits:
                used += took
                break
            p += 1
            used = 0.0
        carry[NOW] = now
        if deposits_kernel(e[i], path[i], flags[i]):
            carry[LAID] = now
    return n


def profile(
    chunks: Iterable[tuple[Moves, SpeedPlan]], machine: Machine, settle: float = 0.0, lead: float = 0.0
) -> Iterator[tuple[Moves, SpeedPlan, Profile]]:
    """Give each planned move its phases over time, s, with at most `settle` more at barriers and `lead` at holds."""
    carry = np.array([0.0, -np.inf, 0.0, 0.0])
    waits = np.array([machine.switch_dwell, settle, lead])
    for moves, speeds in chunks:
        runs = int(speeds.run[-1] - speeds.run[0]) + 2 if len(speeds) else 0
        most = 2 * len(moves) + MOST * runs
        out_row, out = np.empty(most, dtype=np.int64), np.empty((COLUMNS, most))
        made = profile_kernel(
            speeds.distance, speeds.entry, speeds.exit, speeds.cruise, speeds.accel, speeds.jerk, speeds.run,
            moves.row, moves.kind, moves.flags, moves.tool, moves.dwell, moves.e, moves.length, moves.start, moves.end,
            waits, np.empty((MOST, PHASE)), carry, out_row, out,
        )  # fmt: skip
        t, duration, s, v, a, j = out[:, :made]
        yield moves, speeds, Profile(row=out_row[:made], t=t, duration=duration, s=s, v=v, a=a, j=j)
