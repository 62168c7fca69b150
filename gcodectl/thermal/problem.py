"""What is planned: a surface, when each of its locations may be printed on, and what the head may do; plans, exactly.

    T |\\                           opens   when a location has cooled to the upper bound (or was laid, if later)
      | \\                          shuts   when it has cooled to the lower bound
    T_high --o                      T - T_best = under + lift exp(b1 (t - t0))
      |       '-._                  under   what it comes to rest at, less the best
    T_low  - - - -'-o-----          lift    what it was at t0, less what it comes to rest at
      +------opens--shuts--- t

Source: Fathizadan, dissertation (Arizona State University, 2022), eq. (4.12), (4.24)-(4.39).
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.errors import UsageError
from gcodectl.jit import jit_lean
from gcodectl.thermal.partitions import Partitions
from gcodectl.thermal.surface import Band, Head, Surface


@dataclasses.dataclass(frozen=True)
class Weights:
    """What is wanted: every location near the best temperature, and how much a second counts against that."""

    start: float = 1.0
    """What a second later at the start costs, degC^2/s."""
    end: float = 0.0
    """And at the end."""
    of_mean: bool = False
    """One square a partition, of the mean temperature of its locations, rather than one a location."""


@dataclasses.dataclass(frozen=True)
class Problem:
    """A surface to be printed on, and what the head may do; arrays have a row a location (M) or a partition (N)."""

    first: Ints
    """N + 1: first location of each partition, and M."""
    way: Floats
    """M: from the beginning of the partition, length."""
    under: Floats
    """M: the temperature that it comes to rest at, less the best, degC."""
    lift: Floats
    """M: its temperature at t0, less that it comes to rest at, degC."""
    b1: Floats
    t0: Floats
    opens: Floats
    """M: s, from when to when a road may be laid on it."""
    shuts: Floats
    weight: Floats
    length: Floats
    """N."""
    pause: Floats
    slowest: Floats
    fastest: Floats
    entry: float
    """Speed before the first partition; NaN: any."""
    accel: float
    change: float
    """Most that a partition's speed may differ from the one before, as a share of it."""
    start_weight: float
    """What a second later at the start costs, and at the end."""
    end_weight: float
    of_mean: bool
    """One square a partition, of its mean temperature, rather than one a location."""

    @property
    def free(self) -> Bools:
        """Whether each partition may begin at any speed."""
        free = (self.pause > 0.0) | (math.isinf(self.accel) and math.isinf(self.change))
        free[0] |= math.isnan(self.entry)
        return np.asarray(free)


def pose(
    surface: Surface, partitions: Partitions, head: Head, band: Band, weights: Weights, entry: float | None,
    change: float, margin: Floats | float,
) -> Problem:  # fmt: skip
    """Return the problem; raises UsageError where its parts do not fit. Arguments as in `speed.plan_speeds`."""
    first = np.append(partitions.first, len(surface))
    if not len(partitions) or first[0] != 0 or (np.diff(first) <= 0).any():
        raise UsageError("every partition needs a location, and the first must begin at the surface's first")
    way = surface.s - np.repeat(partitions.begin, np.diff(first))
    over = way > np.repeat(partitions.length, np.diff(first)) * (1.0 + 1e-9) + 1e-9
    if (way < -1e-9).any() or over.any():
        raise UsageError("a partition must reach from its first location, or before it, to its last, or beyond")
    slowest = np.maximum(partitions.slowest, head.slowest)
    fastest = np.minimum(partitions.fastest, head.fastest)
    if (slowest > fastest).any():
        raise UsageError(f"partition {int(np.argmax(slowest > fastest))}'s speeds are none that the head can do")
    rest = band.ambient - surface.b0 / surface.b1
    lift = surface.temp0 - rest
    opens, shuts = windows(surface, band, margin)
    return Problem(
        first=first.astype(np.int64), way=np.maximum(way, 0.0), under=rest - band.best, lift=lift,
        b1=np.array(surface.b1), t0=np.array(surface.t0), opens=opens, shuts=shuts, weight=np.ones(len(surface)),
        length=np.array(partitions.length), pause=np.array(partitions.pause), slowest=slowest, fastest=fastest,
        entry=math.nan if entry is None else entry, accel=head.accel, change=change, start_weight=weights.start,
        end_weight=weights.end, of_mean=weights.of_mean,
    )  # fmt: skip


def windows(surface: Surface, band: Band, margin: Floats | float = 0.0) -> tuple[Floats, Floats]:
    """Return from when to when each location is inside the band, less the margin at either side (below 0: more); s.

    None at all: it opens at inf, or shuts at -inf.
    """
    rest = band.ambient - surface.b0 / surface.b1
    falls = surface.temp0 >= rest
    upper, lower = band.high - margin, band.low + margin
    first, last = np.where(falls, upper, lower), np.where(falls, lower, upper)
    opens = _passes(surface, rest, np.asarray(first, dtype=np.float64), falls)
    shuts = _passes(surface, rest, np.asarray(last, dtype=np.float64), falls)
    beyond = np.where(falls, surface.temp0 < lower, surface.temp0 > upper)  # it left the band before it was known
    return opens, np.where(beyond | (np.asarray(lower) > upper), -math.inf, shuts)


def _passes(surface: Surface, rest: Floats, level: Floats, falls: Bools) -> Floats:
    """When each location's temperature passes a level: t0 if it has at t0, inf if it never does; s."""
    passed = np.where(falls, surface.temp0 <= level, surface.temp0 >= level)
    never = np.where(falls, rest >= level, rest <= level)
    share = np.where(passed | never, 1.0, (level - rest) / np.where(surface.temp0 == rest, 1.0, surface.temp0 - rest))
    when = np.where(passed, surface.t0, surface.t0 + np.log(share) / surface.b1)
    return np.where(never & ~passed, math.inf, when)


@jit_lean
def after_kernel(way: float, v0: float, v1: float, accel: float) -> float:
    """The s until the head is `way` into a partition that it enters at v0 and changes to v1 in."""
    if way <= 0.0:
        return 0.0
    sign = 1.0 if v1 >= v0 else -1.0
    ramp = sign * (v1 * v1 - v0 * v0) / (2.0 * accel)
    if way < ramp:
        return float(2.0 * way / (v0 + math.sqrt(max(v0 * v0 + sign * 2.0 * accel * way, 0.0))))
    return float(sign * (v1 - v0) / accel + (way - ramp) / v1)


@jit_lean
def drive_kernel(
    start: float, entry: float, first: Ints, way: Floats, length: Floats, pause: Floats, free: Ints, accel: float,
    speeds: Floats, border: Floats, times: Floats,
) -> None:  # fmt: skip
    """Fill when the head comes to each border (N + 1) and by each location (M), s, exactly."""
    t = start
    before = entry
    for j in range(len(length)):
        border[j] = t
        v0 = speeds[j] if free[j] else before
        for row in range(first[j], first[j + 1]):
            times[row] = t + pause[j] + after_kernel(way[row], v0, speeds[j], accel)
        t += pause[j] + after_kernel(length[j], v0, speeds[j], accel)
        before = speeds[j]
    border[len(length)] = t


def drive(problem: Problem, start: float, speeds: Floats) -> tuple[Floats, Floats]:
    """Return when the head comes to each border (N + 1), and by each location (M), s."""
    border, times = np.empty(len(problem.length) + 1), np.empty(len(problem.way))
    drive_kernel(
        start, problem.entry, problem.first, problem.way, problem.length, problem.pause,
        problem.free.astype(np.int64), problem.accel, speeds, border, times,
    )  # fmt: skip
    return border, times


def cost_at(problem: Problem, border: Floats, times: Floats) -> float:
    """What a plan costs whose times are known."""
    off = problem.under + problem.lift * np.exp(problem.b1 * (times - problem.t0))
    if problem.of_mean:
        counts = np.diff(problem.first)
        mean = np.add.reduceat(off, problem.first[:-1]) / counts
        total = float(np.sum(problem.weight[problem.first[:-1]] * mean**2))
    else:
        total = float(np.sum(problem.weight * off * off))
    return total + problem.start_weight * float(border[0]) + problem.end_weight * float(border[-1])
