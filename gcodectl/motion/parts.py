"""Parts: one move cut into several that follow each other, so that each may have an acceleration of its own.

    line  G1 X20 E2      ->      part | part | part          all of one line of the file; the first carries its bytes
                                 head   rest   tail

A ramp has one acceleration, so a line that begins or ends a road is cut where its zones end. No part is cut
that would be shorter than LEAST of the zone, or last less than a line may (`max_lines_per_second`): the boundary is
left out, and what it would have set apart goes with what most of it lies in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.jit import jit
from gcodectl.path import point_kernel
from gcodectl.records import Flag, Kind, Moves

LEAST = 0.1
SHORTEST = 0.02
"""mm."""
RAMPS = 2
"""Head and tail of the road."""
ZONES = RAMPS + 2
"""And the very first and last bit of a road, which has a speed of its own."""
MOST = ZONES + 1
ARC = int(Kind.ARC)


@jit
def parts_kernel(
    length: Floats, cruise: Floats, zone: Floats, whole: Floats, accel: Floats, slow: Floats, seconds: float,
    source: Ints, low: Floats, high: Floats, limit: Floats, speed: Floats, ruler: Ints,
) -> int:  # fmt: skip
    """Cut rows at the ends of their zones; fills source row, begin and end as shares, limits, which zone rules.

    `zone[row]`: mm of the row in each of the ZONES, begins and ends by turns; `whole[row]`: the zones' own lengths;
    `accel[row]`: of the RAMPS; `slow[row]`: speeds in the last two. `ruler` is -1 where no ramp rules. Parts of the
    same limits are one. Returns how many parts there are.
    """
    n = 0
    edges = np.empty(MOST + 1)
    for i in range(len(length)):
        edges[0] = 0.0
        count = 1
        for _ in range(ZONES):  # the boundaries, in ascending order
            best, room = length[i], 0.0
            for k in range(ZONES):
                at = zone[i, k] if k % 2 == 0 else length[i] - zone[i, k]
                fastest = cruise[i] if k < RAMPS else slow[i, k - RAMPS]
                least = max(max(LEAST * whole[i, k], fastest * seconds), SHORTEST)
                if at - edges[count - 1] >= least and length[i] - at >= least and at < best:
                    best, room = at, least
            if room > 0.0:
                edges[count] = best
                count += 1
        edges[count] = length[i]
        for part in range(count):
            middle = 0.5 * (edges[part] + edges[part + 1])
            slowest, rules, top = np.inf, -1, np.inf
            for k in range(ZONES):
                inside = middle < zone[i, k] if k % 2 == 0 else middle > length[i] - zone[i, k]
                if inside and k >= RAMPS:
                    top = min(top, slow[i, k - RAMPS])
                elif inside and accel[i, k] < slowest:
                    slowest, rules = accel[i, k], k
            if part and limit[n - 1] == slowest and speed[n - 1] == top:
                high[n - 1] = edges[part + 1] / length[i] if part < count - 1 else 1.0
                continue
            source[n], limit[n], speed[n], ruler[n] = i, slowest, top, rules
            low[n] = edges[part] / length[i] if part else 0.0
            high[n] = edges[part + 1] / length[i] if part < count - 1 else 1.0
            n += 1
    return n


@jit
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
    parts = moves[source]
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
