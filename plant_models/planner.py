"""The virtual firmware's own look-ahead planner: trapezoids of speed, as Klipper, Marlin and Smoothie plan them.

Theory. Along each straight segment the speed follows v^2 = v0^2 + 2 a s, so in v^2 over s every limit is a straight
line of slope 2a. A junction between two segments may be taken at a speed that depends on its angle; look-ahead then
finds the highest speeds that also let the machine stop at the end of all that is known:

    v^2 |        ______
        |       /      \\____        junction limits J_i, cut
        |  ____/            \\       backward (braking) and then
        | /                  \\      forward (accelerating)
        +-----|------|-----|---> s

Rules:
1. Square corner velocity (Klipper toolhead.py, Move.calc_junction): with theta the angle between the reversed old and
   the new direction, R = sin(theta/2) / (1 - sin(theta/2)), J = R c^2 (sqrt(2) - 1): at 90 degrees the speed is c. Nor
   may the circle that rounds the corner reach beyond half a segment: J <= a d tan(theta/2) / 2 for both. Marlin's
   junction deviation is the same law with j = c^2 (sqrt(2) - 1) / a.
2. Classic jerk (Marlin planner.cpp): no axis may step its speed by more than c.
3. E may not step its speed by more than `e_corner_speed`: v <= e_corner_speed / |dr|, r = mm of E a mm of path (Klipper
   extruder.py, calc_junction; Marlin's M205 E and RepRapFirmware's M566 E are the same law). Where both moves share
   their direction Marlin's junction deviation counts E as an axis of the angle: here taken as the law above.
4. Moves of E alone, pauses, tool changes and barriers begin and end at rest.
5. Look-ahead sees the whole file: real buffers are shorter (Klipper 2 s, Marlin 16 to 64 moves) and brake earlier.

6. E's own speed and acceleration limits are in a segment's `speed` and `accel` already (`gantry`).

What it leaves out on purpose: Klipper's minimum-cruise smoothing, step rounding, S-curves.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Columns, Floats, Ints, column
from gcodectl.jit import jit
from plant_models.gantry import PATH, Firmware, Segments


@dataclasses.dataclass(frozen=True)
class Phases(Columns):
    """One row a phase of constant acceleration (or of standing still), in time order, without gaps."""

    segment: Ints = column(np.int64)
    """Index of its segment."""
    t: Floats = column(np.float64)
    duration: Floats = column(np.float64)
    s: Floats = column(np.float64)
    """Where along the segment it begins, mm (of E where E moves alone)."""
    v: Floats = column(np.float64)
    a: Floats = column(np.float64)


@jit
def corner_kernel(
    x0: float, y0: float, z0: float, x1: float, y1: float, z1: float, ratio0: float, ratio1: float,
    room0: float, room1: float, speed: float, corner: float, e_corner: float, classic: bool,
) -> float:  # fmt: skip
    """Return the highest v^2 at the junction of two paths: directions, ratios of E, length times accel of each.

    `speed` and `corner` are the smaller ones of both.
    """
    v2 = speed**2
    step = abs(ratio1 - ratio0)
    if step > 1e-12:
        v2 = min(v2, (e_corner / step) ** 2)
    if classic:
        step = max(abs(x1 - x0), abs(y1 - y0), abs(z1 - z0))
        return min(v2, (corner / step) ** 2) if step > 1e-9 else v2
    cosine = -(x0 * x1 + y0 * y1 + z0 * z1)
    if cosine > 0.999999:
        return 0.0
    if cosine > -0.999999:
        half_sine = math.sqrt(0.5 * (1.0 - cosine))
        tangent = half_sine / math.sqrt(0.5 * (1.0 + cosine))
        radius = half_sine / (1.0 - half_sine)
        v2 = min(v2, radius * corner**2 * (math.sqrt(2.0) - 1.0), 0.5 * tangent * min(room0, room1))
    return v2


@jit
def junction_kernel(
    kind: NDArray[np.int8],
    direction: Floats,
    ratio: Floats,
    length: Floats,
    speed: Floats,
    accel: Floats,
    corner: Floats,
    rest: Bools,
    e_corner: Floats,
    classic: bool,
) -> Floats:
    """Return the highest v^2 at which each segment may be entered; one more at the end, 0."""
    n = len(kind)
    limit = np.zeros(n + 1)
    for i in range(1, n):
        j = i - 1
        if not rest[i] and kind[i] == PATH and kind[j] == PATH:
            limit[i] = corner_kernel(
                direction[j, 0], direction[j, 1], direction[j, 2], direction[i, 0], direction[i, 1], direction[i, 2],
                ratio[j], ratio[i], length[j] * accel[j], length[i] * accel[i],
                min(speed[i], speed[j]), min(corner[i], corner[j]), e_corner[i], classic,
            )  # fmt: skip
    return limit


@jit
def lookahead_kernel(limit: Floats, length: Floats, accel: Floats) -> Floats:
    """Cut the junction limits (v^2) to what braking and accelerating can reach; returns a new array."""
    v2 = limit.copy()
    for i in range(len(length) - 1, -1, -1):
        v2[i] = min(v2[i], v2[i + 1] + 2.0 * accel[i] * length[i])
    for i in range(len(length)):
        v2[i + 1] = min(v2[i + 1], v2[i] + 2.0 * accel[i] * length[i])
    return v2


@jit
def trapezoid_kernel(
    length: Floats,
    speed: Floats,
    accel: Floats,
    pause: Floats,
    v2: Floats,
    segment: Ints,
    t: Floats,
    duration: Floats,
    s: Floats,
    v: Floats,
    a: Floats,
) -> int:
    """Fill the phase arrays (room for three a segment); returns how many there are."""
    count, now = 0, 0.0
    for i in range(len(length)):
        if length[i] <= 0.0:
            segment[count], t[count], duration[count] = i, now, pause[i]
            count += 1
            now += pause[i]
            continue
        peak2 = min(speed[i] ** 2, 0.5 * (v2[i] + v2[i + 1]) + accel[i] * length[i])
        peak2 = max(peak2, max(v2[i], v2[i + 1]))
        peak, v0, v1 = math.sqrt(peak2), math.sqrt(v2[i]), math.sqrt(v2[i + 1])
        rise = (peak2 - v2[i]) / (2.0 * accel[i])
        fall = (peak2 - v2[i + 1]) / (2.0 * accel[i])
        flat = max(length[i] - rise - fall, 0.0)
        for phase in range(3):
            if phase == 0:
                took, where, begin, slope = (peak - v0) / accel[i], 0.0, v0, accel[i]
            elif phase == 1:
                took, where, begin, slope = flat / peak, rise, peak, 0.0
            else:
                took, where, begin, slope = (peak - v1) / accel[i], rise + flat, peak, -accel[i]
            if took > 1e-12:
                segment[count], t[count], duration[count] = i, now, took
                s[count], v[count], a[count] = where, begin, slope
                count += 1
                now += took
    return count


def plan(segments: Segments, firmware: Firmware) -> Phases:
    """Plan `segments` from rest to rest; the phases follow each other without a gap from t = 0."""
    on_path = segments.kind == PATH
    safe = np.where(on_path, segments.length, 1.0)
    direction = np.where(on_path[:, None], segments.p1 - segments.p0, 0.0) / safe[:, None]
    ratio = np.where(on_path, segments.e, 0.0) / safe
    limit = junction_kernel(
        segments.kind, direction, ratio, segments.length, segments.speed, segments.accel, segments.corner_speed,
        segments.rest, segments.e_corner_speed, firmware.junction == "jerk",
    )  # fmt: skip
    v2 = lookahead_kernel(limit, segments.length, segments.accel)
    columns = Phases.allocate(3 * len(segments))
    count = trapezoid_kernel(segments.length, segments.speed, segments.accel, segments.pause, v2, **columns)
    return Phases(**{name: array[:count].copy() for name, array in columns.items()})
