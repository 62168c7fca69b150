"""Backward dynamic programming over the graph of `graph.py`: the cheapest way on from every node.

    J[N, t, v]  = end_weight t
    J[j, t, v0] = min over v1 of  cost of the arc (t, v0 -> v1) + J[j + 1, t + its duration, v1]
    plan        = min over t, v0 of  start_weight t + J[0, t, v0], and forward from there

Every node and arc takes part, so this is also what A* is checked against.

Source: Bellman; Fathizadan, dissertation (Arizona State University, 2022), eq. (4.47), (4.48).
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.thermal.graph import Graph, cost_kernel, lifted_kernel


@dataclasses.dataclass(frozen=True)
class Route:
    """A way through the graph."""

    cost: float
    """On the graph, its times rounded; inf: there is none."""
    start: float
    """s."""
    speeds: Floats
    """One a partition."""
    nodes: int
    """How many nodes were opened to find it."""


def dynamic(graph: Graph) -> Route:
    """Return the cheapest route by backward dynamic programming."""
    problem, lattice = graph.problem, graph.lattice
    n = len(problem.length)
    value = np.full((n + 1, lattice.times, lattice.speeds), math.inf)
    policy = np.full((n, lattice.times, lattice.speeds), -1, dtype=np.int64)
    room = np.empty(int(np.diff(problem.first).max()))
    backward_kernel(
        problem.first, problem.under, problem.lift, problem.b1, problem.t0, problem.weight, problem.of_mean,
        problem.end_weight, graph.speed, graph.duration, graph.opens, graph.shuts, graph.decay, graph.offset,
        graph.free, lattice.time_base, lattice.time_step, lattice.time_first, value, policy, room,
    )  # fmt: skip
    begin = lattice.time_base + lattice.time_step * (lattice.time_first[0] + np.arange(lattice.times))
    total = value[0] + (problem.start_weight * begin)[:, None]
    i, a = np.unravel_index(int(total.argmin()), total.shape)
    cost, speeds = float(total[i, a]), np.full(n, math.nan)
    if math.isfinite(cost):
        follow_kernel(
            int(i), int(a), graph.speed, graph.duration, graph.free, lattice.time_step, lattice.time_first, policy,
            speeds,
        )  # fmt: skip
    return Route(cost, float(begin[i]), speeds, value.size)


@jit_lean
def lands_kernel(i: int, duration: float, step: float, first: int, then: int) -> int:
    """The row of the next border's times that an arc of `duration` from row i ends at, rounded to the nearest."""
    return int(math.floor(first + i + duration / step + 0.5)) - then


@jit_lean
def backward_kernel(
    first: Ints, under: Floats, lift: Floats, b1: Floats, t0: Floats, weight: Floats, of_mean: bool, end_weight: float,
    speed: Floats, duration: Floats, opens: Floats, shuts: Floats, decay: Floats, offset: Ints, free: Ints,
    base: float, step: float, time_first: Ints, value: Floats, policy: Ints, lifted: Floats,
) -> None:  # fmt: skip
    """Fill the cost to go of every node, and the speed that its cheapest arc changes to; both come as inf and -1."""
    stages, times, speeds = policy.shape
    for i in range(times):
        for b in range(speeds):
            if not math.isnan(speed[stages, b]):
                value[stages, i, b] = end_weight * (base + step * (time_first[stages] + i))
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
                    if lands < 0 or lands >= times or value[j + 1, lands, b] >= best:
                        continue
                    where = offset[j] + (a * speeds + b) * n
                    cost = cost_kernel(first[j], n, where, under, lifted, decay, weight, of_mean)
                    if cost + value[j + 1, lands, b] < best:
                        best, which = cost + value[j + 1, lands, b], b
                value[j, i, a], policy[j, i, a] = best, which
            if free[j]:
                for a in range(1, speeds):
                    value[j, i, a], policy[j, i, a] = value[j, i, 0], policy[j, i, 0]


@jit_lean
def follow_kernel(
    i: int, a: int, speed: Floats, duration: Floats, free: Ints, step: float, time_first: Ints, policy: Ints,
    speeds: Floats,
) -> None:  # fmt: skip
    """Fill the speeds of the partitions on the way from a node at the first border."""
    for j in range(len(speeds)):
        b = policy[j, i, a]
        speeds[j] = speed[j + 1, b]
        i = lands_kernel(i, duration[j, 0 if free[j] else a, b], step, time_first[j], time_first[j + 1])
        a = b
