"""The road on which temperatures are asked for: locations along the tool path of a layer, in its plane."""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Columns, Floats, column
from gcodectl.errors import UsageError


@dataclasses.dataclass(frozen=True)
class Road(Columns):
    """Locations in the order in which the path passes them; mm."""

    bead: float
    """Width of the road."""
    s: Floats = column(np.float64)
    """Where along the path."""
    xy: Floats = column(np.float64, 2)
    across: Floats = column(np.float64, 2)
    """Unit vector to the left of the path."""

    @classmethod
    def along(cls, corners: Floats, bead: float, spacing: float | None = None) -> Road:
        """Return locations about `spacing` apart (None: a bead's width) on a polyline, [n, 2] mm.

        A ring ends where it began. Raises UsageError where that is no path.
        """
        points = np.asarray(corners, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 2 or not np.isfinite(points).all():
            raise UsageError("a path is a row of at least two points x, y in mm")
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        points, steps = points[np.concatenate([[True], steps > 0])], steps[steps > 0]
        if not (bead > 0 and (spacing is None or spacing > 0) and steps.sum() > bead):
            raise UsageError(f"a path must be longer than its bead is wide, not {steps.sum():g} mm with {bead:g} mm")
        ends = np.concatenate([[0.0], np.cumsum(steps)])
        count = max(2, round(ends[-1] / (spacing or bead)))
        s = (np.arange(count) + 0.5) * ends[-1] / count
        edge = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(steps) - 1)
        ahead = (np.diff(points, axis=0) / steps[:, None])[edge]
        xy = points[edge] + (s - ends[edge])[:, None] * ahead
        return cls(bead=bead, s=s, xy=xy, across=np.stack([-ahead[:, 1], ahead[:, 0]], axis=1))
