"""Perspective: from the plane of a layer, mm, to the camera's pixels and back.

    plane (x, y) mm  --- M --->  pixel (u, v):   (u c, v c, c) = M (x, y, 1)        M is 3 x 3, 8 numbers matter

M comes from matching points, at least four, no three of them on a line. The paper's (4.2), M = S R' (R R')^-1, takes
c = 1 for every point: it can find an affine map only, for which parallels stay parallel. Here (c unknown) the points
are shifted and scaled to order one, u c and v c eliminated (the direct linear transform), the smallest singular vector
taken, and from there the squared distances in pixels are made least (OpenCV's findHomography does both).
Source: Fathizadan, dissertation (2022), section 4.1.2, put right; Hartley and Zisserman, Multiple View Geometry, ch. 4.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.thermal.frames import Image


@dataclasses.dataclass(frozen=True)
class Perspective:
    """The map of one plane."""

    matrix: Floats
    """3 x 3; from (x, y, 1) in mm to a pixel, homogeneous. Its scale is arbitrary."""

    def pixels(self, xy: Floats) -> Floats:
        """Return the pixels (column, row) of points, [n, 2]."""
        return _mapped(self.matrix, xy)

    def plane(self, pixels: Floats) -> Floats:
        """Return the points, mm, that are seen at pixels, [n, 2]."""
        return _mapped(np.asarray(np.linalg.inv(self.matrix), dtype=np.float64), pixels)

    def warped(self, image: Image, low: Floats, high: Floats, per_mm: float) -> Image:
        """Return the plane from corner `low` to `high` as seen from straight above, y upwards, `per_mm` px a mm."""
        import cv2

        size = np.ceil((np.asarray(high) - low) * per_mm).astype(int)
        to_pixels = np.array([[per_mm, 0.0, -low[0] * per_mm], [0.0, -per_mm, high[1] * per_mm], [0.0, 0.0, 1.0]])
        return np.asarray(cv2.warpPerspective(image, to_pixels @ np.linalg.inv(self.matrix), tuple(map(int, size))))


def fit_perspective(xy: Floats, pixels: Floats) -> tuple[Perspective, float]:
    """Return the perspective that brings points, mm, nearest to the pixels they were found at, and the rms left, px.

    Raises InputError for fewer than four points, or points that leave it open.
    """
    import cv2

    plane, seen = np.asarray(xy, dtype=np.float64), np.asarray(pixels, dtype=np.float64)
    if plane.shape != seen.shape or plane.ndim != 2 or plane.shape[1] != 2 or len(plane) < 4:
        raise InputError(f"a perspective takes four matching points or more, x, y and a pixel each, not {len(plane)}")
    if not (np.isfinite(plane).all() and np.isfinite(seen).all()):
        raise InputError("a matching point is no number")
    open_ends = "no map to pixels: are three of every four on a line, or two in one place? Mark points wide apart"
    for points in (plane, seen):
        extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if extents[1] < 1e-3 * extents[0]:
            raise InputError(f"these matching points settle {open_ends}")
    matrix, _ = cv2.findHomography(plane, seen, 0)
    if matrix is None or not np.isfinite(matrix).all() or np.linalg.cond(matrix / np.linalg.norm(matrix)) > 1e12:
        raise InputError(f"these matching points settle {open_ends}")
    depth = np.column_stack([plane, np.ones(len(plane))]) @ matrix[2]
    if not (np.all(depth > 0) or np.all(depth < 0)):
        raise InputError("these matching points would lie on both sides of the camera: check their order")
    found = Perspective(matrix * np.sign(depth[0]))
    return found, float(np.sqrt(((found.pixels(plane) - seen) ** 2).sum(axis=1).mean()))


def _mapped(matrix: Floats, points: Floats) -> Floats:
    given = np.asarray(points, dtype=np.float64)
    mapped = np.column_stack([given, np.ones(len(given))]) @ matrix.T
    return np.asarray(mapped[:, :2] / mapped[:, 2:])
