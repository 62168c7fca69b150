"""Partitions: stretches of the path whose locations cool alike, each to be printed at one speed.

    T at a time |  ____            ____          one partition a level: the segmentation with the least sum of squares
                | |    |___    ___|    |___      about the levels, found exactly by dynamic programming; no partition
                | |        |__|            |     reaches across a break: where the path jumps, or where a stretch was
                +---------------------------- s  heated again and its clock begins anew

Rules: least[j, n], the least sum of squares of the first n locations in j partitions, is the minimum over m of
least[j-1, m] + square(m, n); square is read off cumulative sums. Of all counts up to the largest the one is taken where
another partition would gain less than `gain` of the squares that one partition has; breaks always part.

Source: Fathizadan, dissertation (Arizona State University, 2022), section 4.2.2 (grouped by eye there); Bellman 1961.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Bools, Columns, Floats, Ints, column
from gcodectl.errors import UsageError
from gcodectl.jit import jit_lean
from gcodectl.thermal.surface import Band, Head, Surface

JUMP = 5.0
"""A step of t0 beyond this many times the median step is a break: another pass of the head."""


@dataclasses.dataclass(frozen=True)
class Partitions(Columns):
    """One row a stretch of the path, in its order."""

    first: Ints = column(np.int64)
    """The surface's row of its first location; its last stands before the next partition's first."""
    begin: Floats = column(np.float64)
    """Where it begins along the path; not after its first location."""
    length: Floats = column(np.float64)
    """How long it is; it reaches to its last location, or beyond."""
    slowest: Floats = column(np.float64)
    """Speeds that may be asked for in it, length/s."""
    fastest: Floats = column(np.float64)
    pause: Floats = column(np.float64)
    """s that pass before it without printing (a travel, a purge); after one it begins at any speed."""


def partitions_at(surface: Surface, first: Ints, head: Head, end: float | None = None) -> Partitions:
    """Return the partitions that begin at the locations `first`, each reaching to the next, the last to `end`."""
    rows = np.asarray(first, dtype=np.int64)
    if not len(surface) or not len(rows) or rows[0] != 0 or (np.diff(rows) <= 0).any() or rows[-1] >= len(surface):
        raise UsageError(f"partitions must begin at rising locations of the surface's {len(surface)}, the first at 0")
    begin = surface.s[rows]
    last = float(surface.s[-1]) if end is None else end
    if last < surface.s[-1]:
        raise UsageError(f"the path ends at {last:g}, before its last location at {surface.s[-1]:g}")
    return Partitions(
        first=rows, begin=begin, length=np.diff(np.append(begin, last)), slowest=np.full(len(rows), head.slowest),
        fastest=np.full(len(rows), head.fastest), pause=np.zeros(len(rows)),
    )  # fmt: skip


def partition(surface: Surface, head: Head, band: Band, most: int = 12, gain: float = 0.01) -> Partitions:
    """Return at most `most` partitions (more where breaks ask for them) of locations that cool alike."""
    if most < 1 or not len(surface):
        raise UsageError("partitions need a surface with locations, and a number of at least 1")
    level = surface.at(_meeting(surface, band), band.ambient)
    breaks = _breaks(surface)
    wanted = min(len(surface), max(most, 1 + int(breaks.sum())))
    first = np.zeros((wanted, wanted), dtype=np.int64)
    squares = np.empty(wanted)
    sums = np.zeros((2, len(level) + 1))
    sums[0, 1:], sums[1, 1:] = np.cumsum(level - level.mean()), np.cumsum((level - level.mean()) ** 2)
    wall = np.concatenate(([0], np.cumsum(breaks))).astype(np.int64)
    least, came = np.empty((2, len(level) + 1)), np.empty((wanted, len(level) + 1), dtype=np.int64)
    segment_kernel(sums[0], sums[1], wall, least, came, squares, first)
    total = float(sums[1, -1])
    count = int(breaks.sum()) + 1
    while count < wanted and squares[count - 1] - squares[count:].min() > gain * total and squares[count - 1] > 0.0:
        count += 1
    return partitions_at(surface, first[count - 1, :count], head)


def _meeting(surface: Surface, band: Band) -> Floats:
    """The time at which the locations are compared, s: the median of when each is at the best temperature."""
    rest = band.ambient - surface.b0 / surface.b1
    share = np.clip((band.best - rest) / np.where(surface.temp0 > rest, surface.temp0 - rest, 1.0), 1e-3, 1.0)
    when = surface.t0 + np.log(share) / surface.b1
    return np.full(len(surface), max(float(np.median(when)), float(surface.t0.max())))


def _breaks(surface: Surface) -> Bools:
    """Which steps from a location to the next must part them: the clock jumps, or runs backwards."""
    step = np.diff(surface.t0)
    usual = float(np.median(np.abs(step))) if len(step) else 0.0
    jump = np.asarray(np.abs(step - np.median(step)) > JUMP * usual) if len(step) else np.zeros(0, dtype=bool)
    return jump & (np.abs(step) > 1e-9)


@jit_lean
def segment_kernel(
    total: Floats, square: Floats, wall: Ints, least: Floats, came: Ints, squares: Floats, first: Ints
) -> None:
    """Fill the least sums of squares for 1, 2, ... partitions, and where each begins (a row a count).

    `total`, `square`: cumulative sums (n + 1); `wall`: how many breaks lie before each location; `least`: room, 2 x
    (n + 1); `came`: room, counts x (n + 1).
    """
    n = len(wall)
    for end in range(n + 1):
        least[0, end] = np.inf
    least[0, 0] = 0.0
    for j in range(len(squares)):
        old, new = j % 2, (j + 1) % 2
        for end in range(n + 1):
            best = np.inf
            where = 0
            for begin in range(end - 1, -1, -1):
                if wall[begin] != wall[end - 1]:
                    break
                if least[old, begin] < best:
                    sum_ = total[end] - total[begin]
                    cost = least[old, begin] + square[end] - square[begin] - sum_ * sum_ / (end - begin)
                    if cost < best:
                        best, where = cost, begin
            least[new, end], came[j, end] = best, where
        squares[j] = least[new, n]
        if squares[j] < np.inf:
            end = n
            for one in range(j, -1, -1):
                end = came[one, end]
                first[j, one] = end
