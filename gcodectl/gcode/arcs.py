"""Arcs and helices: where the centre is, how far the sweep goes, which point lies at a distance along a move.

            p1                G2 clockwise, G3 counter-clockwise, seen against the plane's normal:
          .-'                   G17  XY about Z   offsets I J
        /   \\  sweep            G18  ZX about Y   offsets K I
       p0 ---c                  G19  YZ about X   offsets J K

- Centre from I J K: from the start (G91.1, the rule) or absolute (G90.1). From R: on the perpendicular bisector of the
  chord, the short way round for R > 0, the long way for R < 0. An end equal to the start is a full circle (not with R).
- The third axis moves evenly with the angle: a helix. Where rounding makes the radii at the start and the end differ,
  the radius too changes evenly with the angle, so that the path ends where the line says.
- Radii that differ by more than max(0.02 mm, 0.5 %) are refused (grbl: 0.005 mm and 0.1 %, or 0.5 mm at once; slicers
  that round to two decimals need more room).

Sources: NIST RS274/NGC 3.5.3; Marlin src/gcode/motion/G2_G3.cpp (P: whole circles more); grbl gcode.c, step 9.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats
from gcodectl.jit import jit, jit_lean
from gcodectl.records import Moves

FINE, NO_CENTER, RADII_DIFFER, TOO_FAR = 0, 1, 2, 3
_TURN = 2 * math.pi


@jit_lean
def radius_center_kernel(a0: float, b0: float, a1: float, b1: float, r: float, ccw: bool) -> tuple[float, float, int]:
    """Return the centre of the arc of radius `r` from (a0, b0) to (a1, b1), and a problem number."""
    da, db = (a1 - a0) / 2, (b1 - b0) / 2
    half = math.hypot(da, db)
    if half == 0.0 or r == 0.0:
        return np.nan, np.nan, NO_CENTER
    rise = r * r - half * half
    if rise < 0:
        if half - abs(r) > max(0.02, 0.005 * abs(r)):
            return np.nan, np.nan, TOO_FAR
        rise = 0.0
    side = math.sqrt(rise) / half
    if ccw == (r < 0):
        side = -side
    return a0 + da - db * side, b0 + db + da * side, FINE


@jit_lean
def arc_kernel(
    a0: float, b0: float, a1: float, b1: float, ca: float, cb: float, rise: float, ccw: bool, turns: float
) -> tuple[float, float, int]:
    """Return (sweep in rad, length in mm, problem) of the arc about (ca, cb) that rises by `rise`."""
    ra, rb = a0 - ca, b0 - cb
    qa, qb = a1 - ca, b1 - cb
    radius, end_radius = math.hypot(ra, rb), math.hypot(qa, qb)
    if radius == 0.0:
        return np.nan, np.nan, NO_CENTER
    if abs(end_radius - radius) > max(0.02, 0.005 * radius):
        return np.nan, np.nan, RADII_DIFFER
    if a0 == a1 and b0 == b1:
        sweep = _TURN if ccw else -_TURN
    else:
        sweep = math.atan2(ra * qb - rb * qa, ra * qa + rb * qb)
        if ccw and sweep <= 0:
            sweep += _TURN
        elif not ccw and sweep >= 0:
            sweep -= _TURN
    sweep += _TURN * turns if ccw else -_TURN * turns
    return sweep, math.hypot(0.5 * (radius + end_radius) * sweep, rise), FINE


@jit_lean
def point_kernel(
    p0: Floats, p1: Floats, center: Floats, sweep: float, plane: int, length: float, s: float
) -> tuple[float, float, float]:
    """Return x, y, z at the path distance `s` along a line (sweep 0) or an arc."""
    f = min(max(s / length, 0.0), 1.0) if length > 0 else 1.0
    if f == 1.0:
        return p1[0], p1[1], p1[2]
    x, y, z = p0[0] + f * (p1[0] - p0[0]), p0[1] + f * (p1[1] - p0[1]), p0[2] + f * (p1[2] - p0[2])
    if sweep == 0.0:
        return x, y, z
    first = (0, 2, 1)[plane]
    second = (1, 0, 2)[plane]
    ra, rb = p0[first] - center[0], p0[second] - center[1]
    start, end = math.hypot(ra, rb), math.hypot(p1[first] - center[0], p1[second] - center[1])
    angle = math.atan2(rb, ra) + f * sweep
    radius = start + f * (end - start)
    a, b = center[0] + radius * math.cos(angle), center[1] + radius * math.sin(angle)
    if plane == 0:
        return a, b, z
    return (b, y, a) if plane == 1 else (x, a, b)


@jit_lean
def tangent_kernel(
    p0: Floats, p1: Floats, center: Floats, sweep: float, plane: int, length: float, s: float
) -> tuple[float, float, float]:
    """Return the unit tangent at the path distance `s`; zeros where nothing moves."""
    dx, dy, dz = p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]
    if sweep != 0.0:
        f = min(max(s / length, 0.0), 1.0)
        first = (0, 2, 1)[plane]
        second = (1, 0, 2)[plane]
        ra, rb = p0[first] - center[0], p0[second] - center[1]
        start, end = math.hypot(ra, rb), math.hypot(p1[first] - center[0], p1[second] - center[1])
        angle = math.atan2(rb, ra) + f * sweep
        radius, growth = start + f * (end - start), end - start
        a = growth * math.cos(angle) - radius * sweep * math.sin(angle)
        b = growth * math.sin(angle) + radius * sweep * math.cos(angle)
        if plane == 0:
            dx, dy = a, b
        elif plane == 1:
            dz, dx = a, b
        else:
            dy, dz = a, b
    size = math.sqrt(dx * dx + dy * dy + dz * dz)
    return (dx / size, dy / size, dz / size) if size > 0 else (0.0, 0.0, 0.0)


def point_at(moves: Moves, index: int, s: float) -> Floats:
    """Return [x, y, z] (mm) at the path distance `s` (mm) along the move at `index`."""
    return np.array(point_kernel(*_geometry(moves, index), s))


def tangent_at(moves: Moves, index: int, s: float) -> Floats:
    """Return the unit tangent [3] at the path distance `s` (mm) along the move at `index`; zeros for a point."""
    return np.array(tangent_kernel(*_geometry(moves, index), s))


def _geometry(moves: Moves, index: int) -> tuple[Floats, Floats, Floats, float, int, float]:
    length, sweep = float(moves.length[index]), float(moves.sweep[index])
    return moves.p0[index], moves.p1[index], moves.center[index], sweep, int(moves.plane[index]), length


@jit
def tangents_kernel(
    moves: tuple[Floats, Floats, Floats], sweep: Floats, plane: NDArray[np.int8], length: Floats
) -> tuple[Floats, Floats]:
    """Return start and end unit tangents [n, 3] of the rows of (p0, p1, center)."""
    p0, p1, center = moves
    start, end = np.zeros(p0.shape), np.zeros(p0.shape)
    for k in range(len(p0)):
        x, y, z = tangent_kernel(p0[k], p1[k], center[k], sweep[k], plane[k], length[k], 0.0)
        start[k, 0], start[k, 1], start[k, 2] = x, y, z
        x, y, z = tangent_kernel(p0[k], p1[k], center[k], sweep[k], plane[k], length[k], length[k])
        end[k, 0], end[k, 1], end[k, 2] = x, y, z
    return start, end


def tangents(moves: Moves) -> tuple[Floats, Floats]:
    """Return the unit tangents at the start and the end of every move, [n, 3] each; zeros where a move is a point."""
    return tangents_kernel((moves.p0, moves.p1, moves.center), moves.sweep, moves.plane, moves.length)
