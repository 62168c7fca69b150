"""Arcs as a firmware drives them: chords of at most so many mm, one scalar arc at a time.

            p1          G2 clockwise, G3 counter-clockwise; centre by offsets from the start, or by R:
          .-'             on the perpendicular bisector, the short way round for R > 0, the long way for R < 0
        /   \\ sweep     P: whole turns more. An end equal to the start is a full circle (not with R)
       p0 ---c           the third axis, and the radius where rounding makes it differ, run on with the angle

Source: Marlin src/gcode/motion/G2_G3.cpp (plan_arc); the chords are those of `plant_models.gantry`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeAlias

Point: TypeAlias = tuple[float, float, float]

PLANES = ((0, 1, 2), (2, 0, 1), (1, 2, 0))
"""First, second and third axis of G17, G18 and G19."""
OFFSETS = "IJK"
MOST = 65_535
"""Chords of one arc: what 16 bit count (uint16_t segments); those of a longer arc are longer."""
SAME = 1e-6
"""mm: an end this near its start makes a full circle."""


def centre(start: Point, end: Point, plane: int, ccw: bool, words: Mapping[str, float]) -> tuple[float, float] | None:
    """Return an arc's centre in its plane, mm; `words` holds I, J, K or R in mm. None where there is none."""
    first, second, _ = PLANES[plane]
    radius = words.get("R")
    if radius is None:
        a, b = words.get(OFFSETS[first], 0.0), words.get(OFFSETS[second], 0.0)
        return (start[first] + a, start[second] + b) if a or b else None
    da, db = (end[first] - start[first]) / 2, (end[second] - start[second]) / 2
    half = math.hypot(da, db)
    if half == 0.0 or radius == 0.0:
        return None
    side = math.sqrt(max(radius * radius - half * half, 0.0)) / half
    if ccw == (radius < 0):
        side = -side
    return start[first] + da - db * side, start[second] + db + da * side


def sweep_of(start: Point, end: Point, plane: int, ccw: bool, about: tuple[float, float], turns: int) -> float:
    """Return the signed angle of the arc, rad."""
    first, second, _ = PLANES[plane]
    ra, rb = start[first] - about[0], start[second] - about[1]
    qa, qb = end[first] - about[0], end[second] - about[1]
    way = 2 * math.pi if ccw else -2 * math.pi
    if math.hypot(end[first] - start[first], end[second] - start[second]) < SAME:
        return way * (1 + turns)
    sweep = math.atan2(ra * qb - rb * qa, ra * qa + rb * qb)
    if (sweep <= 0) if ccw else (sweep >= 0):
        sweep += way
    return sweep + way * turns


def chords(
    start: Point, end: Point, plane: int, about: tuple[float, float], sweep: float, longest: float
) -> list[Point]:
    """Return the ends of the chords, none longer along the arc than `longest` mm, and `MOST` at most.

    The last is exactly `end`.
    """
    first, second, third = PLANES[plane]
    r0 = math.hypot(start[first] - about[0], start[second] - about[1])
    r1 = math.hypot(end[first] - about[0], end[second] - about[1])
    angle = math.atan2(start[second] - about[1], start[first] - about[0])
    rise = end[third] - start[third]
    count = min(max(1, math.ceil(math.hypot(0.5 * (r0 + r1) * sweep, rise) / longest)), MOST)
    points = []
    for number in range(1, count):
        part = number / count
        radius, turned = r0 + (r1 - r0) * part, angle + sweep * part
        point = [0.0, 0.0, 0.0]
        point[first] = about[0] + radius * math.cos(turned)
        point[second] = about[1] + radius * math.sin(turned)
        point[third] = start[third] + rise * part
        points.append((point[0], point[1], point[2]))
    return [*points, end]
