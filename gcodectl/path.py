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


def cut_moves(
    moves: Moves, source: Ints, low: Floats, high: Floats, anew: Bools, e_before: float, row: int, behind: Moves
) -> Moves:
    """Return `behind`, and then the parts of moves, numbered from `row` on.

    Part k is `moves[source[k]]` from share `low` to share `high`; `e_before` is the logical E before the first move.
    Parts of a move that is cut carry Flag.PART, as do those that must be written `anew` for another reason.
    """
    numbers = np.arange(row, row + len(source))
    cut = np.flatnonzero((low > 0.0) | (high < 1.0))
    if not len(cut) and not anew.any():
        return Moves.concat([behind, moves.replace(row=numbers)])
    joined = moves.taken(source, behind)
    text = joined.pop("text")
    of = {name: column[len(behind) :] for name, column in joined.items()}
    of["row"][:] = numbers
    of["flags"][anew] |= int(Flag.PART)
    low, high, source = low[cut], high[cut], source[cut]
    ends, share = high < 1.0, high - low
    p0, p1, center, sweep, plane = (of[name][cut] for name in ("p0", "p1", "center", "sweep", "plane"))
    for name, at in (("p0", low), ("p1", high)):
        points = of[name][cut]
        points_kernel(p0, p1, center, sweep, plane, of["kind"][cut] == ARC, at, points)
        of[name][cut] = points
    for name in ("length", "e", "sweep"):
        of[name][cut] *= share
    begun = np.where(source > 0, moves.e_end[source - 1], e_before)
    of["e_end"][cut] = np.where(ends, begun + high * (of["e_end"][cut] - begun), of["e_end"][cut])
    of["start"][cut] = np.where(low > 0.0, of["end"][cut], of["start"][cut])
    of["flags"][cut] |= np.where(ends, int(Flag.PART | Flag.GOES_ON), int(Flag.PART)).astype(of["flags"].dtype)
    return Moves(text=text, **joined)
