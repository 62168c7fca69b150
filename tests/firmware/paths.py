"""Moves for the tests, made without a parser."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from gcodectl.config import Machine
from gcodectl.records import Kind, Moves

MACHINE = Machine("test", max_flow=1e6, max_flow_slew=1e9)
AREA = MACHINE.area
BEAD = 0.54
"""mm^2"""


def make(rows: Sequence[dict[str, Any]], area: float = AREA) -> Moves:
    """Make Moves of dicts: `to` (x, y[, z]), `e` in mm, `feed`, or any other column by its name."""
    columns = Moves.allocate(len(rows))
    for name in ("accel", "travel_accel", "corner_speed", "width", "height"):
        columns[name][:] = np.nan
    columns["row"][:] = np.arange(len(rows))
    columns["line"][:] = np.arange(len(rows)) + 1
    columns["area"][:] = area
    columns["flow_factor"][:] = 1.0
    here = np.zeros(3)
    feed = 10.0
    for i, row in enumerate(rows):
        feed = row.get("feed", feed)
        there = np.array([*row["to"], *here[len(row["to"]) :]]) if "to" in row else here
        columns["p0"][i], columns["p1"][i], columns["feed"][i] = here, there, feed
        columns["length"][i] = np.linalg.norm(there - here)
        columns["kind"][i] = Kind.LINE
        for name, value in row.items():
            if name not in ("to", "feed"):
                columns[name][i] = value
        here = there
    return Moves(**columns)


def road(points: Sequence[Sequence[float]], feed: float = 10.0, bead: float = BEAD) -> list[dict[str, Any]]:
    """A travel to the first point, then a road through the others with `bead` mm^2."""
    rows: list[dict[str, Any]] = [{"to": points[0], "feed": 4 * feed}]
    for a, b in pairwise(points):
        rows.append({"to": b, "feed": feed, "e": bead * float(np.linalg.norm(np.subtract(b, a))) / AREA})
    return rows


def subdivide(moves: Moves, pieces: Sequence[int]) -> Moves:
    """Cut each straight move into as many equal pieces as its entry of `pieces` says."""
    parts = []
    for i in range(len(moves)):
        n = pieces[i % len(pieces)] if moves.length[i] > 0 else 1
        one = moves[np.full(n, i)]
        steps = np.linspace(0, 1, n + 1)[:, None]
        points = moves.p0[i] + steps * (moves.p1[i] - moves.p0[i])
        parts.append(one.replace(p0=points[:-1], p1=points[1:], length=one.length / n, e=one.e / n))
    return Moves.concat(parts)
