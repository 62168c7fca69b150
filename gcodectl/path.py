"""The path of a move: points and directions on lines, arcs and helices; and moves cut into parts along it.

An arc turns by `sweep` about `center` in its plane's two axes, while the third axis runs on in proportion (a helix).
Where rounding makes the radii at the start and the end differ, the radius changes in proportion too:

    plane 0 (G17): X, Y about, Z along     plane 1 (G18): Z, X about, Y along     plane 2 (G19): Y, Z about, X along
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.records import Flag, Kind, Moves

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


@jit_lean
def tangents_kernel(
    is_arc: Bools,
    p0: Floats,
    p1: Floats,
    center: Floats,
    sweep: Floats,
    plane: NDArray[np.int8],
    start: Floats,
    end: Floats,
) -> None:
    """Fill `start` and `end` with the directions at both ends of every move."""
    for i in range(len(sweep)):
        tangent_kernel(p0[i], p1[i], center[i], sweep[i], plane[i], is_arc[i], 0.0, start[i])
        tangent_kernel(p0[i], p1[i], center[i], sweep[i], plane[i], is_arc[i], 1.0, end[i])


def tangents(moves: Moves) -> tuple[Floats, Floats]:
    """Unit directions of travel where each move begins and ends, two arrays of shape (n, 3)."""
    start, end = np.empty((len(moves), 3)), np.empty((len(moves), 3))
    tangents_kernel(moves.kind == ARC, moves.p0, moves.p1, moves.center, moves.sweep, moves.plane, start, end)
    return start, end


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


@jit_lean
def points_kernel(
    p0: Floats, p1: Floats, center: Floats, sweep: Floats, plane: NDArray[np.int8], arc: Bools,
    share: Floats, out: Floats,
) -> None:  # fmt: skip
    """Fill out[row] with the point at `share` of each move."""
    for i in range(len(share)):
        point_kernel(p0[i], p1[i], center[i], sweep[i], plane[i], arc[i], share[i], out[i])


def cut_moves(moves: Moves, source: Ints, low: Floats, high: Floats, anew: Bools, e_before: float) -> Moves:
    """The parts of moves: part k is `moves[source[k]]` from share `low` to share `high`; rows keep their old numbers.

    `e_before` is the logical E before the first move. Parts of a move that is cut carry Flag.PART, as do those that
    must be written `anew` for another reason.
    """
    parts = moves[source] if len(source) > len(moves) else moves
    parts = parts.replace(flags=np.where(anew, parts.flags | int(Flag.PART), parts.flags)) if anew.any() else parts
    cut = (low > 0.0) | (high < 1.0)
    if not cut.any():
        return parts
    of = (parts.p0, parts.p1, parts.center, parts.sweep, parts.plane, parts.kind == ARC)
    p0, p1 = parts.p0.copy(), parts.p1.copy()
    points_kernel(*of, np.where(cut, low, 0.0), p0)
    points_kernel(*of, np.where(cut, high, 1.0), p1)
    p0[~cut], p1[~cut] = parts.p0[~cut], parts.p1[~cut]  # NaNs too
    begun = np.concatenate([[e_before], moves.e_end[:-1]])[source]
    share = high - low
    return parts.replace(
        p0=p0, p1=p1, length=parts.length * share, e=parts.e * share, sweep=parts.sweep * share,
        e_end=np.where(high < 1.0, begun + high * (parts.e_end - begun), parts.e_end),
        start=np.where(low > 0.0, parts.end, parts.start),
        flags=np.where(cut, parts.flags | int(Flag.PART), parts.flags) | np.where(high < 1.0, int(Flag.GOES_ON), 0),
    )  # fmt: skip
