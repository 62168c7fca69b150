"""Parts: one move cut into several that follow each other, so that each may have an acceleration of its own.

    line  G1 X20 E2      ->      part | part | part          all of one line of the file; the first carries its bytes
                                 head   rest   tail

A ramp has one acceleration, so a line that begins or ends a road is cut where its zones end. No part is cut
that would be shorter than LEAST of the zone, or last less than a line may (`max_lines_per_second`): the boundary is
left out, and what it would have set apart goes with what most of it lies in.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.motion.zones import FIRST, FIRST_SPEED, HEAD_ACCEL, HEAD_ZONE, ZONES
from gcodectl.path import point_kernel
from gcodectl.records import Flag, Kind, Moves

LEAST = 0.1
SHORTEST = 0.02
"""mm."""
MOST = ZONES + 1
ARC = int(Kind.ARC)
LOW, HIGH, MOST_ACCEL, MOST_SPEED, PART = range(5)
"""Rows of what is known of parts: where they begin and end as shares of their move; mm/s^2, mm/s."""


@jit_lean
def boundaries_kernel(length: float, cruise: float, zone: Floats, seconds: float, edges: Floats) -> int:
    """Fill `edges` with where a row is to be cut, mm, both its ends included; returns how many parts that makes."""
    edges[0] = 0.0
    count = 1
    for _ in range(ZONES):  # in ascending order
        best, room = length, 0.0
        for k in range(ZONES):
            at = zone[k] if k % 2 == 0 else length - zone[k]
            fastest, whole = cruise, zone[HEAD_ZONE + k]
            if k >= FIRST:
                fastest, whole = zone[FIRST_SPEED + k - FIRST], zone[k]
            least = max(max(LEAST * whole, fastest * seconds), SHORTEST)
            if at - edges[count - 1] >= least and length - at >= least and at < best:
                best, room = at, least
        if room > 0.0:
            edges[count] = best
            count += 1
    edges[count] = length
    return count


@jit_lean
def parts_kernel(
    length: float, cruise: float, zone: Floats, seconds: float, row: int, n: int, edges: Floats,
    source: Ints, parts: Floats, ruler: NDArray[np.int8],
) -> int:  # fmt: skip
    """Cut a row at the ends of its zones: appends its parts, and which of head (0) and tail (1) rules them, or -1.

    Parts of the same limits are one. Returns how many parts there are.
    """
    count = boundaries_kernel(length, cruise, zone, seconds, edges)
    begun = n
    for part in range(count):
        middle = 0.5 * (edges[part] + edges[part + 1])
        slowest, rules, top = math.inf, -1, math.inf
        for k in range(ZONES):
            inside = middle < zone[k] if k % 2 == 0 else middle > length - zone[k]
            if inside and k >= FIRST:
                top = min(top, zone[FIRST_SPEED + k - FIRST])
            elif inside and zone[HEAD_ACCEL + k] < slowest:
                slowest, rules = zone[HEAD_ACCEL + k], k
        if n > begun and parts[MOST_ACCEL, n - 1] == slowest and parts[MOST_SPEED, n - 1] == top:
            n -= 1
        else:
            parts[LOW, n] = edges[part] / length if part else 0.0
        parts[HIGH, n] = edges[part + 1] / length if part < count - 1 else 1.0
        parts[MOST_ACCEL, n], parts[MOST_SPEED, n], source[n], ruler[n] = slowest, top, row, rules
        n += 1
    return n


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
