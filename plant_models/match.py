"""The ordered walk: which stretch of ORIGINAL's roads does each segment of FILE lie on?

FILE is ORIGINAL cut into other lines: moves in pieces, travels that push, moves of E alone put in. E says nothing, so
the walk goes by place, direction and order: a pointer runs forward through ORIGINAL's path (its travels included).

    ORIGINAL   A===========B- - - - C=========D        === road    - - travel
    FILE       A==|====|===B- -|- - C====|====D        each piece finds its stretch; the pointer never goes back

Rules:
1. A piece lies on a segment where both its ends are within `TOLERANCE` of it and it runs the same way.
2. It goes on from where the pointer is, or enters a later segment at that segment's start; the segment that it fits
   best wins among the first `NEAR` that it fits.
3. A piece may cover several segments of one road where the corners between them are within the tolerance of it.
4. A piece that fits nothing in the next `WINDOW` segments is off path, and the pointer stays.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit
from plant_models.bead import Roads
from plant_models.gantry import PATH, Segments

TOLERANCE = 0.05
"""mm"""
WINDOW = 500
"""segments"""
NEAR = 4
SHORTEST = 0.01
"""mm; a shorter piece has no direction worth asking for: rounding made it."""


@jit
def place_kernel(a: Floats, b: Floats, p: Floats) -> tuple[float, float]:
    """Return how far along the segment from a to b the point p is (mm, within it), and its distance from it."""
    along, length2 = 0.0, 0.0
    for k in range(3):
        along += (p[k] - a[k]) * (b[k] - a[k])
        length2 += (b[k] - a[k]) ** 2
    part = min(max(along / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    gap2 = 0.0
    for k in range(3):
        gap2 += (p[k] - a[k] - part * (b[k] - a[k])) ** 2
    return part * math.sqrt(length2), math.sqrt(gap2)


@jit
def fit_kernel(
    p0: Floats, p1: Floats, road: Ints, f0: Floats, f1: Floats, m: int, most: float
) -> tuple[int, float, float, float]:
    """Fit the piece f0 to f1 on the run of segments from m on: its last segment (-1: no fit), x0, x1, worst gap."""
    x0, gap0 = place_kernel(p0[m], p1[m], f0)
    if gap0 > most:
        return -1, 0.0, 0.0, 0.0
    last = m
    while True:
        x1, gap1 = place_kernel(p0[last], p1[last], f1)
        if gap1 <= most and (last > m or x1 >= x0 - most):
            break
        _, corner = place_kernel(f0, f1, p1[last])
        if last + 1 >= len(road) or road[last + 1] != road[m] or corner > most:
            return -1, 0.0, 0.0, 0.0
        last += 1
    size = math.sqrt(((f1 - f0) ** 2).sum())
    if size > SHORTEST:
        for k in (m, last):
            run = p1[k] - p0[k]
            if ((f1 - f0) * run).sum() < 0.5 * size * math.sqrt((run**2).sum()):
                return -1, 0.0, 0.0, 0.0
    return last, x0, x1, max(gap0, gap1)


@jit
def walk_kernel(
    p0: Floats, p1: Floats, road: Ints, begin: Floats, start: Floats, end: Floats, low: Floats, high: Floats
) -> int:
    """Fill `low` and `high` with S at the ends of each piece from start to end, NaN where it is on no road.

    p0, p1, road, begin: ORIGINAL's path. Returns the number of pieces that fitted nothing.
    """
    here, reached, lost = 0, 0.0, 0
    for i in range(len(start)):
        low[i], high[i] = np.nan, np.nan
        best, best_last, best_x0, best_x1, best_gap, tried = -1, -1, 0.0, 0.0, np.inf, 0
        for m in range(here, min(here + WINDOW, len(road))):
            if best >= 0:
                tried += 1
                if tried >= NEAR:
                    break
            last, x0, x1, gap = fit_kernel(p0, p1, road, start[i], end[i], m, TOLERANCE)
            if last < 0 or (m == here and x0 < reached - TOLERANCE) or (m > here and x0 > TOLERANCE):
                continue
            if gap < best_gap - 1e-6:
                best, best_last, best_x0, best_x1, best_gap = m, last, x0, x1, gap
        if best < 0:
            lost += 1
            continue
        here, reached = best_last, best_x1
        if road[best] >= 0:
            low[i] = begin[best] + best_x0
            high[i] = max(begin[best_last] + best_x1, low[i])
    return lost


Places: TypeAlias = tuple[Floats, Floats]
"""S at the start and the end of each segment, mm; NaN on no road."""


def match(roads: Roads, segments: Segments) -> Places:
    """Return S at the start and the end of each segment, mm; NaN where a segment lies on no road of `roads`."""
    low, high = np.full(len(segments), np.nan), np.full(len(segments), np.nan)
    moving = np.flatnonzero(segments.kind == PATH)
    found_low, found_high = np.empty(len(moving)), np.empty(len(moving))
    if len(roads.road):
        walk_kernel(
            roads.path.p0, roads.path.p1, roads.road, roads.begin, segments.p0[moving], segments.p1[moving],
            found_low, found_high,
        )  # fmt: skip
        low[moving], high[moving] = found_low, found_high
    return low, high


def visited(roads: Roads, low: Floats, high: Floats) -> float:
    """Return the share of the roads' length that was passed over at least once."""
    on = np.isfinite(low)
    order = np.argsort(low[on])
    ends = np.maximum.accumulate(high[on][order]) if on.any() else np.zeros(0)
    starts = np.maximum(low[on][order], np.concatenate([[0.0], ends[:-1]])) if on.any() else ends
    return float(np.maximum(ends - starts, 0.0).sum() / roads.length) if roads.length > 0 else 0.0
