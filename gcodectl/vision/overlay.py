"""The overlay: a photograph with what was measured drawn over it, so that one can see whether to believe it."""

from __future__ import annotations

import numpy as np

from gcodectl.vision.photo import Photo
from gcodectl.vision.widths import Widths

LEFT, RIGHT = (0, 220, 60), (255, 60, 220)
"""Colours of the edges."""


def overlay(image: Photo, widths: Widths) -> Photo:
    """Return the photograph, [h, w, 3], with the edges that were found in it; of joined widths, none is drawn."""
    import cv2

    drawn = np.array(image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2))
    thick = max(1, round(max(image.shape[:2]) / 4000))
    for side, colour in enumerate((LEFT, RIGHT)):
        points = widths.edges[:, side]
        there = np.append(np.append(False, np.isfinite(points).all(axis=1)), False)
        begin, end = np.flatnonzero(there[1:] & ~there[:-1]), np.flatnonzero(there[:-1] & ~there[1:])
        for a, b in zip(begin, end, strict=True):
            run = np.round(16.0 * points[a:b]).astype(np.int32)
            cv2.polylines(drawn, [run[:, None, :]], False, colour, thick, cv2.LINE_AA, 4)
    return drawn
