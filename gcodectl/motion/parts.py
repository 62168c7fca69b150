"""Parts: one move cut into several that follow each other, so that each may have an acceleration of its own.

    line  G1 X20 E2      ->      part | part | part          all of one line of the file; the first carries its bytes
                                 head   rest   tail

A ramp has one acceleration, so a line that begins or ends a road is cut where its zones end. No part is cut
that would be shorter than LEAST of the zone, or last less than a line may (`max_lines_per_second`): the boundary is
left out, and what it would have set apart goes with what most of it lies in. `path.cut_moves` then cuts them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.motion.zones import FIRST, FIRST_SPEED, HEAD_ACCEL, HEAD_ZONE, ZONES

LEAST = 0.1
SHORTEST = 0.02
"""mm."""
MOST = ZONES + 1
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
