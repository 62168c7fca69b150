"""Relaxation: what no motion of the head can beat, however it speeds up and slows down within its limits of speed.

    cells of time   |__|__|__|__|__|        location k is passed in some cell c of h seconds; of k + 1 it is known only
    location k          c                   that it comes between k's gap at the fastest and at the slowest later, so
    location k + 1         [c' ... c'']     in the cells c + floor(gap_fast / h) ... c + 1 + floor(gap_slow / h)

L[k, c] = least of (T_k - T_best)^2 over cell c + min over those c' of L[k + 1, c']. T is monotone in t, so the least of
a square over a cell is at one of its ends, or 0. Any motion whose speed is within the limits everywhere, ramps or
jumps, passes one cell after another that this admits, and costs at least as much in each: the minimum over c of L[0, c]
is a lower bound of every plan, with or without acceleration, by partition or by location, for any h; it is tight as
h goes to 0. (The published bound, speeds constant by partition, is none: a ramp inside a partition can gain by it.)
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.errors import UsageError
from gcodectl.jit import jit_lean
from gcodectl.thermal.problem import Problem
from gcodectl.thermal.refine import start_range, ways

CELLS = 20_000


def lower_bound(problem: Problem, earliest: float = -math.inf, cells: int = CELLS) -> float:
    """Return what every plan costs at least; inf: there is none. Raises UsageError for costs by means."""
    if problem.of_mean:
        raise UsageError("a bound is known for costs by location only")
    low, high = start_range(problem, earliest)
    slow, fast = ways(problem)
    h = max((high + float(slow[-1]) - low) / cells, 1e-9)
    gaps = np.diff(np.concatenate(([0.0], fast))), np.diff(np.concatenate(([0.0], slow)))
    near, far = np.floor(gaps[0] / h - 1e-9).astype(np.int64), np.floor(gaps[1] / h + 1e-9).astype(np.int64) + 1
    border = problem.length / problem.fastest
    rest = float(np.sum(problem.pause + border)) - float(fast[-1])
    value, after, room = np.empty(cells + 2), np.empty(cells + 2), np.empty(cells + 2, dtype=np.int64)
    relax_kernel(
        problem.under, problem.lift, problem.b1, problem.t0, problem.opens, problem.shuts, problem.weight, near, far,
        low, h, problem.end_weight, rest, value, after, room,
    )  # fmt: skip
    start = low + h * np.arange(len(value))
    return float(np.min(np.where(start <= high, problem.start_weight * start, math.inf) + value))


@jit_lean
def relax_kernel(
    under: Floats, lift: Floats, b1: Floats, t0: Floats, opens: Floats, shuts: Floats, weight: Floats, near: Ints,
    far: Ints, base: float, h: float, end_weight: float, rest: float, value: Floats, after: Floats, queue: Ints,
) -> None:  # fmt: skip
    """Fill what it costs at least to go on from each cell at the start; `near`, `far`: cells to the next location."""
    cells = len(value)
    for c in range(cells):
        after[c] = end_weight * (base + h * c + rest)
    for k in range(len(under) - 1, -1, -1):
        for c in range(cells):
            low, high = max(base + h * c, opens[k]), min(base + h * (c + 1), shuts[k])
            if low > high:
                after[c] = math.inf
                continue
            hot = under[k] + lift[k] * math.exp(b1[k] * (low - t0[k]))
            cold = under[k] + lift[k] * math.exp(b1[k] * (high - t0[k]))
            if hot * cold > 0.0:
                after[c] += weight[k] * min(hot * hot, cold * cold)
        head = tail = 0  # of a queue of cells whose values rise: the least of a sliding window is at its head
        take = cells - 1
        for c in range(cells - 1, -1, -1):
            while take >= c + near[k] and take >= 0:
                while tail > head and after[queue[tail - 1]] >= after[take]:
                    tail -= 1
                queue[tail] = take
                tail += 1
                take -= 1
            while tail > head and queue[head] > c + far[k]:
                head += 1
            value[c] = after[queue[head]] if tail > head else math.inf
        for c in range(cells):
            after[c] = value[c]
