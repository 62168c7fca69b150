"""The path of a move: points and directions on lines, arcs and helices.

An arc turns by `sweep` about `center` in its plane's two axes, while the third axis runs on in proportion (a helix).
Where rounding makes the radii at the start and the end differ, the radius changes in proportion too:

    plane 0 (G17): X, Y about, Z along     plane 1 (G18): Z, X about, Y along     plane 2 (G19): Y, Z about, X along
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.jit import jit_lean
from gcodectl.records import Kind, Moves

ARC = int(Kind.ARC)


@jit_lean
def growth_kernel(x0: float, y0: float, x1: float, y1: float) -> float:
    """How much longer the radius is at an arc's end than at its start, as a share of the start's."""
    radius = math.hypot(x0, y0)
    return math.hypot(x1, y1) / radius - 1.0 if radius > 0.0 else 0.0


@jit_lean
def point_kernel(
    p0: Floats, p1: Floats, center: Floats, sweep: float, plane: int, is_arc: bool, share: float, out: Floats
) -> None:
    """Write the point at `share` (0 to 1) of a move's length to `out`, mm; exactly p0 and p1 at its ends."""
    if share <= 0.0 or share >= 1.0:
        for axis in range(3):
            out[axis] = p0[axis] if share <= 0.0 else p1[axis]
        return
    for axis in range(3):
        out[axis] = p0[axis] + share * (p1[axis] - p0[axis])
    if is_arc:
        first = (0, 2, 1)[plane]
        second = (1, 0, 2)[plane]
        x = p0[first] - center[0]
        y = p0[second] - center[1]
        grown = 1.0 + share * growth_kernel(x, y, p1[first] - center[0], p1[second] - center[1])
        c = grown * math.cos(share * sweep)
        s = grown * math.sin(share * sweep)
        out[first] = center[0] + c * x - s * y
        out[second] = center[1] + s * x + c * y


@jit_lean
def tangent_kernel(
    p0: Floats, p1: Floats, center: Floats, sweep: float, plane: int, is_arc: bool, share: float, out: Floats
) -> None:
    """Write the unit direction of travel at `share` of a move to `out`; zeros where the move has no length."""
    for axis in range(3):
        out[axis] = p1[axis] - p0[axis]
    if is_arc:
        first = (0, 2, 1)[plane]
        second = (1, 0, 2)[plane]
        x = p0[first] - center[0]
        y = p0[second] - center[1]
        growth = growth_kernel(x, y, p1[first] - center[0], p1[second] - center[1])
        grown = sweep * (1.0 + share * growth)
        c = math.cos(share * sweep)
        s = math.sin(share * sweep)
        out[first] = growth * (c * x - s * y) - grown * (s * x + c * y)
        out[second] = growth * (s * x + c * y) + grown * (c * x - s * y)
    norm = math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    for axis in range(3):
        out[axis] = out[axis] / norm if norm > 0.0 else 0.0


def tangent_at(moves: Moves, index: int, share: float) -> Floats:
    """Return the unit direction of travel at `share` of the move at `index`, shape (3,); zeros for a point."""
    out = np.empty(3)
    tangent_kernel(
        moves.p0[index], moves.p1[index], moves.center[index], float(moves.sweep[index]), int(moves.plane[index]),
        bool(moves.kind[index] == ARC), share, out,
    )  # fmt: skip
    return out


def point_at(moves: Moves, index: int, share: float) -> Floats:
    """Return the point at `share` (0 to 1) of the length of the move at `index`, mm, shape (3,)."""
    out = np.empty(3)
    point_kernel(
        moves.p0[index], moves.p1[index], moves.center[index], float(moves.sweep[index]), int(moves.plane[index]),
        bool(moves.kind[index] == ARC), share, out,
    )  # fmt: skip
    return out
