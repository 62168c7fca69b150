"""Profiles: what a photograph shows across a line, sampled in the picture itself, not in one that was straightened."""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Bools, Floats
from gcodectl.vision.line import Line
from gcodectl.vision.photo import Light
from gcodectl.vision.segment import Contrast
from gcodectl.vision.view import Shift, View

_ROWS = 8192
"""OpenCV takes no longer maps than 32767."""
_FULL = 0.985
"""Light that fills a sensor."""


@dataclasses.dataclass(frozen=True)
class Picture:
    """A photograph, with what was found out about it."""

    light: Light
    view: View
    contrast: Contrast


@dataclasses.dataclass(frozen=True)
class Profiles:
    """What is seen across a line."""

    x: Floats
    """mm across, to the left, [m], rising."""
    c: Floats
    """0 ground, 1 material, [k, m]."""
    seen: Bools
    """Whether it is in the picture all the way, [k]."""
    full: Bools
    """Where all colours fill the sensor, [k, m]."""


def across(picture: Picture, shift: Shift, line: Line, x: Floats, *, lines: int = 1, step: float = 0.0) -> Profiles:
    """Return the profiles across a line at `x` mm: each the mean of `lines` over `step` mm along it."""
    import cv2

    base, to_left = shift.applied(line.xy), shift.turned(line.across)
    ahead = shift.turned(line.along)
    c, full = np.zeros((len(line), len(x))), np.zeros((len(line), len(x)))
    seen = np.ones(len(line), dtype=np.bool_)
    height, width = picture.light.shape[:2]
    for place in (np.arange(lines) + 0.5) / lines - 0.5:
        points = (base + place * step * ahead)[:, None, :] + x[:, None] * to_left[:, None, :]
        pixels = picture.view.pixels(points)
        seen &= np.all((pixels >= 0) & (pixels <= [width - 1, height - 1]), axis=(1, 2))
        maps = pixels.astype(np.float32)
        for begin in range(0, len(line), _ROWS):
            rows = slice(begin, begin + _ROWS)
            light = cv2.remap(
                picture.light, maps[rows, :, 0], maps[rows, :, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )
            c[rows] += picture.contrast.of(np.asarray(light, dtype=np.float32), points[rows]) / lines
            full[rows] += np.all(light > _FULL, axis=2) / lines
    return Profiles(x, c, seen, full > 0.5)
