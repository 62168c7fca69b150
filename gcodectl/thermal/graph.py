"""The graph that speeds are planned on: nodes (partition, time, speed), arcs that drive one partition.

    speed                                     A partition is entered at v0 and left at v1: the head changes its speed at
      |        ___v1____                      once and then holds it (feed-forward).
      |      /:        :     k <= d_a         t = (-v0 + sqrt(v0^2 + 2 a k)) / a   (braking: -a)
      | v0 /  :        :     k >  d_a         t = |v1 - v0| / a + (k - d_a) / v1
      +---+---+--------+---- way              d_a = v0 t + a t^2 / 2 = |v1^2 - v0^2| / (2 a)  <= length of the partition
          0  d_a       d

Cost of an arc: the sum over its locations of weight (T - T_best)^2, T when the head comes by; or, of the mean T in the
partition, one square. Allowed is an arc if the head can do it and every location is met between its `opens` and
`shuts`: after it was laid, and while it is inside the band. With T - T_best = under + lift exp(b1 (t - t0)) an arc's
cost at any time t needs no exponential: exp(b1 (t + tau - t0)) is a factor of t times one of the arc (`decay`).

Speeds lie on one lattice. Times do too: where an arc ends is rounded to the nearest, so that n arcs of a path are off
by at most n/2 steps of time. Both searches walk the same rounded graph; what a plan costs is told from the exact times
(`drive`), and `speed.py` refines the lattice around it until rounding no longer matters.

Source: Fathizadan, dissertation (Arizona State University, 2022), eq. (4.24)-(4.37), figure 4.13; published with a t^2
for a t^2 / 2, and the inequalities (4.21)-(4.22) and (4.30)-(4.33) turned round. Both are put right here.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.thermal.problem import Problem, after_kernel

FUZZ = 1e-9


@dataclasses.dataclass(frozen=True)
class Lattice:
    """Where the nodes are: times and speeds, as many at each of the N + 1 borders of partitions."""

    time_base: float
    time_step: float
    time_first: Ints
    """N + 1: multiple of the step that the border's first time is."""
    times: int
    speed_base: float
    speed_step: float
    speed_first: Ints
    speeds: int

    def speed(self, problem: Problem) -> Floats:
        """Speeds at each border, N + 1 x speeds, NaN where one is not allowed; border 0 is how the head comes in."""
        index = self.speed_first[:, None] + np.arange(self.speeds)
        speed = self.speed_base + self.speed_step * index
        low = np.concatenate((problem.slowest[:1], problem.slowest)) * (1.0 - FUZZ)
        high = np.concatenate((problem.fastest[:1], problem.fastest)) * (1.0 + FUZZ)
        speed[(speed < low[:, None]) | (speed > high[:, None])] = np.nan
        if not math.isnan(problem.entry):
            speed[0, 0], speed[0, 1:] = problem.entry, np.nan
        return np.asarray(speed)


@dataclasses.dataclass(frozen=True)
class Graph:
    """Nodes and arcs, tabulated."""

    problem: Problem
    lattice: Lattice
    speed: Floats
    duration: Floats
    """N x speeds x speeds: s from one border to the next, NaN where the head cannot do it."""
    opens: Floats
    """N x speeds x speeds: s, from when to when the arc may be begun."""
    shuts: Floats
    decay: Floats
    """Of every arc, for every location of its partition: exp(b1 tau)."""
    offset: Ints
    """N: where a partition's arcs begin in `decay`."""
    free: Ints
    """N: 1 where all arcs to a speed are alike, whatever the speed before."""


def graph(problem: Problem, lattice: Lattice) -> Graph:
    """Tabulate the arcs of a problem on a lattice."""
    n, v = len(problem.length), lattice.speeds
    counts = np.diff(problem.first) * v * v
    offset = np.concatenate(([0], np.cumsum(counts)))
    speed = lattice.speed(problem)
    duration, opens, shuts = np.full((n, v, v), np.nan), np.empty((n, v, v)), np.empty((n, v, v))
    decay = np.empty(int(offset[-1]))
    free = problem.free.astype(np.int64)
    tables_kernel(
        problem.first, problem.way, problem.b1, problem.opens, problem.shuts, problem.length, problem.pause, free,
        speed, problem.accel, problem.change, offset, duration, opens, shuts, decay,
    )  # fmt: skip
    return Graph(problem, lattice, speed, duration, opens, shuts, decay, offset[:-1], free)


@jit_lean
def tables_kernel(
    first: Ints, way: Floats, b1: Floats, location_opens: Floats, location_shuts: Floats, length: Floats,
    pause: Floats, free: Ints, speed: Floats, accel: float, change: float, offset: Ints, duration: Floats,
    opens: Floats, shuts: Floats, decay: Floats,
) -> None:  # fmt: skip
    """Fill each arc's duration (NaN stays where the head cannot), window, and its locations' decay."""
    count = speed.shape[1]
    for j in range(len(length)):
        n = first[j + 1] - first[j]
        for b in range(count):
            v1 = speed[j + 1, b]
            if math.isnan(v1):
                continue
            for a in range(1 if free[j] else count):
                v0 = v1 if free[j] else speed[j, a]
                if math.isnan(v0) or abs(v1 - v0) > change * v0 * (1.0 + 1e-9):
                    continue
                if abs(v1 * v1 - v0 * v0) > 2.0 * accel * length[j] * (1.0 + 1e-9):
                    continue
                low, high = -math.inf, math.inf
                base = offset[j] + (a * count + b) * n
                for k in range(n):
                    row = first[j] + k
                    later = pause[j] + after_kernel(way[row], v0, v1, accel)
                    decay[base + k] = math.exp(b1[row] * later)
                    low = max(low, location_opens[row] - later)
                    high = min(high, location_shuts[row] - later)
                opens[j, a, b], shuts[j, a, b] = low, high
                duration[j, a, b] = pause[j] + after_kernel(length[j], v0, v1, accel)


@jit_lean
def lifted_kernel(begin: int, end: int, t: float, lift: Floats, b1: Floats, t0: Floats, lifted: Floats) -> None:
    """Fill what locations would be above their rest at t, by which an arc's `decay` is to be multiplied."""
    for row in range(begin, end):
        lifted[row - begin] = lift[row] * math.exp(b1[row] * (t - t0[row]))


@jit_lean
def cost_kernel(
    begin: int, n: int, base: int, under: Floats, lifted: Floats, decay: Floats, weight: Floats, of_mean: bool
) -> float:
    """Cost of one arc: its locations are `begin` and the n - 1 behind, its decays begin at `base`."""
    total = 0.0
    if of_mean:
        for k in range(n):
            total += under[begin + k] + lifted[k] * decay[base + k]
        return float(weight[begin] * (total / n) ** 2)
    for k in range(n):
        off = under[begin + k] + lifted[k] * decay[base + k]
        total += weight[begin + k] * off * off
    return float(total)
