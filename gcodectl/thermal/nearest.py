"""Nearest: where no plan keeps every location inside the band, the plan that leaves it by the least.

    T_high + w  - - - - - - - - -       w: the same for both sides and all locations, as small as can be
    T_high  ------x--------------       x: a location that leaves the band, by so much
    T_low   ------------------x--
    T_low  - w  - - - - - - - - -

The way is found on the same graph as the cheapest one, by the same recursion, with the largest departure of any
location in place of the sum of costs: W[j, t, v0] = min over v1 of max(departure of the arc, W[j + 1, ...]). What was
laid after the head comes by bounds the start whatever the band, so t >= t0 holds throughout.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.thermal.dynamic import Route, follow_kernel, lands_kernel
from gcodectl.thermal.graph import Graph, lifted_kernel
from gcodectl.thermal.problem import Problem
from gcodectl.thermal.refine import Found, refine

PRECISE = 1e-4
LATE = 100.0
"""degC a second that a location is met before it was laid: what is left of that is rounding."""


def departures(problem: Problem, times: Floats, low: Floats, high: Floats) -> Floats:
    """Return by how much each location is outside its bounds (degC from the best) at its time; 0: inside."""
    off = problem.under + problem.lift * np.exp(problem.b1 * (times - problem.t0))
    return np.asarray(np.maximum(np.maximum(off - high, low - off), 0.0))


def smallest_widening(problem: Problem, earliest: float, low: Floats, high: Floats) -> tuple[float, Found] | None:
    """Return by how much the band must be widened, degC, and a plan that shows it; None if nothing helps.

    `low`, `high`: each location's bounds, degC from the best.
    """
    open_ended = dataclasses.replace(problem, opens=np.array(problem.t0), shuts=np.full(len(problem.t0), math.inf))

    def finder(graph: Graph) -> Route:
        return least_departure(graph, low, high)

    def measure(posed: Problem, _border: Floats, times: Floats) -> float:
        late = max(float(np.max(posed.t0 - times)), 0.0)
        return float(departures(posed, times, low, high).max()) + LATE * late

    found = refine(open_ended, earliest, finder, measure, PRECISE)
    return None if found is None else (float(departures(problem, found.times, low, high).max()), found)


def least_departure(graph: Graph, low: Floats, high: Floats) -> Route:
    """Return the route whose worst location leaves its bounds by the least; its cost is by how much, degC."""
    problem, lattice = graph.problem, graph.lattice
    n = len(problem.length)
    value = np.full((n + 1, lattice.times, lattice.speeds), math.inf)
    policy = np.full((n, lattice.times, lattice.speeds), -1, dtype=np.int64)
    room = np.empty(int(np.diff(problem.first).max()))
    minimax_kernel(
        problem.first, problem.under, problem.lift, problem.b1, problem.t0, low, high, graph.speed, graph.duration,
        graph.opens, graph.shuts, graph.decay, graph.offset, graph.free, lattice.time_base, lattice.time_step,
        lattice.time_first, value, policy, room,
    )  # fmt: skip
    i, a = np.unravel_index(int(value[0].argmin()), value[0].shape)
    cost, speeds = float(value[0, i, a]), np.full(n, math.nan)
    if math.isfinite(cost):
        follow_kernel(
            int(i), int(a), graph.speed, graph.duration, graph.free, lattice.time_step, lattice.time_first, policy,
            speeds,
        )  # fmt: skip
    start = lattice.time_base + lattice.time_step * int(lattice.time_first[0] + i)
    return Route(cost, start, speeds, value.size)


@jit_lean
def minimax_kernel(
    first: Ints, under: Floats, lift: Floats, b1: Floats, t0: Floats, low: Floats, high: Floats, speed: Floats,
    duration: Floats, opens: Floats, shuts: Floats, decay: Floats, offset: Ints, free: Ints, base: float, step: float,
    time_first: Ints, value: Floats, policy: Ints, lifted: Floats,
) -> None:  # fmt: skip
    """Fill the least departure to go of every node, and the speed to change to; both come as inf and -1."""
    stages, times, speeds = policy.shape
    for i in range(times):
        for b in range(speeds):
            if not math.isnan(speed[stages, b]):
                value[stages, i, b] = 0.0
    for j in range(stages - 1, -1, -1):
        n = first[j + 1] - first[j]
        for i in range(times):
            t = base + step * (time_first[j] + i)
            lifted_kernel(first[j], first[j + 1], t, lift, b1, t0, lifted)
            for a in range(1 if free[j] else speeds):
                best = math.inf
                which = -1
                for b in range(speeds):
                    lasts = duration[j, a, b]
                    if not (t >= opens[j, a, b] and t <= shuts[j, a, b] and lasts >= 0.0):
                        continue
                    lands = lands_kernel(i, lasts, step, time_first[j], time_first[j + 1])
                    if lands < 0 or lands >= times:
                        continue
                    worst = value[j + 1, lands, b]
                    where = offset[j] + (a * speeds + b) * n
                    for k in range(n):
                        if worst >= best:
                            break
                        off = under[first[j] + k] + lifted[k] * decay[where + k]
                        worst = max(worst, off - high[first[j] + k], low[first[j] + k] - off)
                    if worst < best:
                        best, which = worst, b
                value[j, i, a], policy[j, i, a] = best, which
            if free[j]:
                for a in range(1, speeds):
                    value[j, i, a], policy[j, i, a] = value[j, i, 0], policy[j, i, 0]
