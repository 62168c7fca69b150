"""Polish: from a plan off a lattice to the nearest that no small change betters, in exact times.

    time at border     shift one border (j a little slower, j + 1 as much faster)      .___.-.___.
                       shift all behind one (j a little slower)                        .___.--'''''
                       shift all (a later start), or the start alone                   ''''''''''''
                       all behind one slower by one factor (keeps the ratios of speeds)

Pattern search: every direction has a step of its own, doubled where it helped and halved where it did not; in times,
since what a change of speed is worth is what it does to times. A change is taken if the head can do it and it costs
less, a second outside of a location's window being dearer than any temperature.

Source: Hooke and Jeeves, Journal of the ACM 8, 1961.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.thermal.problem import Problem, drive_kernel

SWEEPS = 400
LEAST = 1e-7
"""s; steps below it are no change."""
PENALTY = 1e5
"""degC^2 a second that a location is met outside its window."""


def polish(problem: Problem, earliest: float, start: float, speeds: Floats, step: float) -> tuple[float, Floats]:
    """Return a start and speeds that cost no more; `step`: s, how far from the best the plan may be."""
    n = len(speeds)
    plan, tried = np.append(start, speeds), np.empty(n + 1)
    border, times = np.empty(n + 1), np.empty(len(problem.way))
    polish_kernel(
        problem.first, problem.way, problem.under, problem.lift, problem.b1, problem.t0, problem.opens, problem.shuts,
        problem.weight, problem.length, problem.pause, problem.slowest, problem.fastest, problem.free.astype(np.int64),
        problem.entry, problem.accel, problem.change, problem.start_weight, problem.end_weight, problem.of_mean,
        earliest, np.full(3 * n + 2, step), plan, tried, border, times,
    )  # fmt: skip
    return float(plan[0]), plan[1:]


@jit_lean
def exact_kernel(
    first: Ints, way: Floats, under: Floats, lift: Floats, b1: Floats, t0: Floats, opens: Floats, shuts: Floats,
    weight: Floats, length: Floats, pause: Floats, slowest: Floats, fastest: Floats, free: Ints, entry: float,
    accel: float, change: float, start_weight: float, end_weight: float, of_mean: bool, earliest: float, plan: Floats,
    border: Floats, times: Floats,
) -> float:  # fmt: skip
    """What a plan (start, speeds) costs in exact times; inf: the head cannot do it."""
    if plan[0] < earliest:
        return math.inf
    before = entry
    for j in range(len(length)):
        speed = plan[1 + j]
        if not (speed >= slowest[j] and speed <= fastest[j]):
            return math.inf
        if not free[j]:
            if abs(speed * speed - before * before) > 2.0 * accel * length[j] * (1.0 + 1e-9):
                return math.inf
            if abs(speed - before) > change * before * (1.0 + 1e-9):
                return math.inf
        before = speed
    drive_kernel(plan[0], entry, first, way, length, pause, free, accel, plan[1:], border, times)
    total = start_weight * border[0] + end_weight * border[len(length)]
    for j in range(len(length)):
        sum_ = 0.0
        for row in range(first[j], first[j + 1]):
            t = times[row]
            off = under[row] + lift[row] * math.exp(b1[row] * (t - t0[row]))
            sum_ += off if of_mean else weight[row] * off * off
            if t < opens[row]:
                total += PENALTY * (opens[row] - t)
            elif t > shuts[row]:
                total += PENALTY * (t - shuts[row])
        if of_mean:
            sum_ = weight[first[j]] * (sum_ / (first[j + 1] - first[j])) ** 2
        total += sum_
    return float(total)


@jit_lean
def slower_kernel(plan: Floats, j: int, length: Floats, seconds: float) -> None:
    """Make partition j take so many seconds longer, as if at one speed; impossible: a speed of 0."""
    lasts = length[j] / plan[1 + j] + seconds if plan[1 + j] > 0.0 else 0.0
    plan[1 + j] = length[j] / lasts if lasts > 0.0 and length[j] > 0.0 else (plan[1 + j] if lasts > 0.0 else 0.0)


@jit_lean
def polish_kernel(
    first: Ints, way: Floats, under: Floats, lift: Floats, b1: Floats, t0: Floats, opens: Floats, shuts: Floats,
    weight: Floats, length: Floats, pause: Floats, slowest: Floats, fastest: Floats, free: Ints, entry: float,
    accel: float, change: float, start_weight: float, end_weight: float, of_mean: bool, earliest: float, steps: Floats,
    plan: Floats, tried: Floats, border: Floats, times: Floats,
) -> float:  # fmt: skip
    """Better `plan` (start, speeds) where it stands; `steps`: s, one a direction (3 N + 2); returns what it costs."""
    n = len(length)
    best = exact_kernel(
        first, way, under, lift, b1, t0, opens, shuts, weight, length, pause, slowest, fastest, free, entry, accel,
        change, start_weight, end_weight, of_mean, earliest, plan, border, times,
    )  # fmt: skip
    for _ in range(SWEEPS):
        still = True
        for way_ in range(3 * n + 2):
            step = steps[way_]
            if abs(step) < LEAST:
                continue
            still = False
            better = False
            for _ in range(2):
                for one in range(n + 1):
                    tried[one] = plan[one]
                if way_ < n:  # all behind j
                    slower_kernel(tried, way_, length, step)
                elif way_ < 2 * n - 1:  # the border behind j
                    slower_kernel(tried, way_ - n, length, step)
                    slower_kernel(tried, way_ - n + 1, length, -step)
                elif way_ < 2 * n + 2:  # the start with all; or the first or the second partition makes up for it
                    tried[0] = max(plan[0] + step, earliest)
                    if way_ > 2 * n - 1:
                        slower_kernel(tried, min(way_ - 2 * n, n - 1), length, plan[0] - tried[0])
                else:  # all behind j, by one factor
                    lasts = 0.0
                    for j in range(way_ - 2 * n - 2, n):
                        lasts += length[j] / plan[1 + j]
                    for j in range(way_ - 2 * n - 2, n):
                        tried[1 + j] = plan[1 + j] * lasts / max(lasts + step, 0.5 * lasts)
                for j in range(n):
                    tried[1 + j] = min(max(tried[1 + j], slowest[j]), fastest[j])
                cost = exact_kernel(
                    first, way, under, lift, b1, t0, opens, shuts, weight, length, pause, slowest, fastest, free,
                    entry, accel, change, start_weight, end_weight, of_mean, earliest, tried, border, times,
                )  # fmt: skip
                if cost < best:
                    best, better = cost, True
                    for one in range(n + 1):
                        plan[one] = tried[one]
                    break
                step = -step
            steps[way_] = 2.0 * step if better else 0.5 * step
        if still:
            break
    return float(best)
