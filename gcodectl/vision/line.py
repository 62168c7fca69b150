"""The lines that are measured: points along a path, which way is across, and how near its parts come to each other."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.distance import cdist

from gcodectl.columns import Floats, Rows
from gcodectl.errors import UsageError

_MOST = 1500
"""Points that the distances between a path's parts are looked at in."""


@dataclasses.dataclass(frozen=True)
class Line:
    """Points along a path."""

    s: Floats
    """mm from its beginning, [k]"""
    xy: Floats
    """[k, 2]"""
    along: Floats
    """Unit directions, [k, 2]."""

    @property
    def across(self) -> Floats:
        """Unit directions to the left, [k, 2]."""
        return np.column_stack([-self.along[:, 1], self.along[:, 0]])

    def __len__(self) -> int:
        return len(self.s)

    def __getitem__(self, rows: Rows) -> Line:
        return Line(self.s[rows], self.xy[rows], self.along[rows])


def line_along(path: Floats, step: float, what: str = "path") -> Line:
    """Return the points every `step` mm of a polyline, [n, 2]; raises UsageError where it is none."""
    points = np.asarray(path, dtype=np.float64)
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 2 or not np.isfinite(points).all():
        raise UsageError(f"the {what} takes two points or more, x and y each, all of them numbers")
    points = points[np.append(True, np.any(np.diff(points, axis=0) != 0, axis=1))]
    at = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    if not 0 < step <= at[-1]:
        raise UsageError(f"the {what} is {at[-1]:g} mm long and cannot be measured every {step:g} mm")
    s: Floats = step * np.arange(int(at[-1] / step + 1e-9) + 1, dtype=np.float64)

    def point(places: Floats) -> Floats:
        places = np.clip(places, 0.0, at[-1])
        return np.column_stack([np.interp(places, at, points[:, axis]) for axis in (0, 1)])

    ahead = np.subtract(point(s + 0.5 * step), point(s - 0.5 * step))
    return Line(s, point(s), ahead / np.maximum(np.linalg.norm(ahead, axis=1), 1e-12)[:, None])


def gap(path: Floats, datum: Floats) -> float:
    """Return how near two lanes of the path come, or a lane and the datum road, mm from middle to middle."""
    total = float(np.sum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    line = line_along(path, total / _MOST)
    beside = line_along(datum, float(np.linalg.norm(datum[1] - datum[0])) / 200, "datum road")
    apart = cdist(line.xy, line.xy)
    other = np.abs(line.s[:, None] - line.s[None, :]) > 1.5 * apart  # a half circle's ends: pi / 2
    nearest = float(apart[other & (apart > 0)].min(initial=np.inf))
    return min(nearest, float(cdist(line.xy, beside.xy).min()))
