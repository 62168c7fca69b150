"""Bends: corners inside a road that take its speed down, as edges for the zones of `zones.py`.

A corner between two rows that lay is passed at the junction's speed v; where that is DIP or more below the faster of
their cruising speeds, the plunger would have to bring the flow down and up again. The ramps on its two sides are given
a share of what the extruder takes from one flow to the other, fall(q) - fall(bead v) and rise(q) - rise(bead v).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.config import Machine
from gcodectl.jit import jit
from gcodectl.motion.follow import Follow
from gcodectl.motion.junction import junction_kernel
from gcodectl.motion.limits import motion_limits
from gcodectl.motion.zones import Rows, Stretch, Zones, zones
from gcodectl.path import tangents
from gcodectl.records import Moves

DIP = 0.1


@jit
def bends_kernel(
    laid: Ints, begins: Bools, distance: Floats, cruise: Floats, accel: Floats, corner: Floats, start: Floats,
    end: Floats, speed: Floats, bends: Bools,
) -> None:  # fmt: skip
    """Fill `speed` with what each row that lays is entered at, inf where nothing slows it, and whether it `bends`."""
    for k in range(len(laid)):
        i = laid[k]
        bends[i] = begins[i]
        if begins[i] or k == 0:
            continue
        h = laid[k - 1]
        cosine = end[h, 0] * start[i, 0] + end[h, 1] * start[i, 1] + end[h, 2] * start[i, 2]
        v = junction_kernel(cosine, accel[h], accel[i], corner[h], corner[i], distance[h], distance[i])
        v = min(v, min(cruise[h], cruise[i]))
        if v < (1.0 - DIP) * max(cruise[h], cruise[i]):
            speed[i], bends[i] = v, True


def bend_speeds(moves: Moves, rows: Rows, last: Moves, machine: Machine) -> tuple[Floats, Bools]:
    """Speed at the edge that each row begins with, mm/s, inf where it has none to slow for, and whether it has one.

    `last` is the last row before `moves` that lays, if any. A road's own start is an edge that slows nothing here.
    """
    joined = Moves.concat([last, moves])
    limits = motion_limits(joined, machine)
    n = len(joined)
    laid = np.flatnonzero(np.concatenate([np.ones(len(last), dtype=np.bool_), rows.lays]))
    begins = np.concatenate([np.zeros(len(last), dtype=np.bool_), rows.begins])
    speed, bends = np.full(n, np.inf), np.zeros(n, dtype=np.bool_)
    bends_kernel(
        laid, begins, limits.distance, limits.cruise, limits.accel, limits.corner_speed, *tangents(joined), speed, bends
    )
    return speed[len(last) :], bends[len(last) :]


def corner_zones(bend: Stretch, rows: Rows, tool: NDArray[np.int16], jerk: float, follow: Follow) -> Zones:
    """The zones on both sides of corners; `need` is no less than any corner still to come could make of them."""
    bead = np.divide(rows.flow, rows.cruise, out=np.zeros(len(tool)), where=rows.cruise > 0)
    up = rows.rise - follow.rise_at(tool, bead * np.minimum(bend.v_before, rows.cruise))
    down = rows.fall - follow.fall_at(tool, bead * np.minimum(bend.v_after, rows.cruise))
    up, down = follow.corner * np.maximum(up, 0.0), follow.corner * np.maximum(down, 0.0)
    found = zones(bend, rows, up, down, jerk, 0.0)
    longest = 1.1 * follow.corner * (rows.rise + rows.fall) + 4.0 * rows.asked / jerk
    return found.needing(rows.cruise * longest)
