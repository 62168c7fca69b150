"""Arcs and helices: where the centre is, how far the sweep goes and how long it is; `path` has the points along it.

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

from gcodectl.jit import jit_lean

FINE, NO_CENTER, RADII_DIFFER, TOO_FAR = 0, 1, 2, 3
SAME = 1e-6
"""mm: an end this near its start makes a full circle."""

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
    if math.hypot(a1 - a0, b1 - b0) < SAME:
        sweep = _TURN if ccw else -_TURN
    else:
        sweep = math.atan2(ra * qb - rb * qa, ra * qa + rb * qb)
        if ccw and sweep <= 0:
            sweep += _TURN
        elif not ccw and sweep >= 0:
            sweep -= _TURN
    sweep += _TURN * turns if ccw else -_TURN * turns
    return sweep, math.hypot(0.5 * (radius + end_radius) * sweep, rise), FINE
