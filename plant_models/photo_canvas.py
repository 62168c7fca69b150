"""A canvas of polygons: what share of every pixel they cover, exactly, by Anti-Grain Geometry's scanlines (matplotlib).

Pixel (0, 0) has its middle at (0, 0). Polygons of one call are one shape: where they touch there is no seam, and where
they overlap they must turn the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform
from numpy.typing import NDArray

from gcodectl.columns import Floats

Plane = NDArray[np.float32]
"""[height, width]"""


class Canvas:
    """A grey plane to paint on."""

    def __init__(self, width: int, height: int) -> None:
        self._height = height
        self._renderer: Any = cast(Any, RendererAgg)(width, height, 72.0)
        self._renderer.clear()

    def paint(self, polygons: Sequence[Floats], level: float) -> None:
        """Paint polygons, [n, 2] px each, in a grey of 0 to 1."""
        kept = [one for one in polygons if len(one) >= 3]
        if not kept:
            return
        context = self._renderer.new_gc()
        context.set_linewidth(0.0)
        context.set_snap(False)
        corners = np.concatenate([np.concatenate([one, one[:1]]) for one in kept]) + 0.5
        corners[:, 1] = self._height - corners[:, 1]
        codes = np.concatenate([_codes(len(one)) for one in kept])
        path = Path(corners, codes)
        path.should_simplify = False
        self._renderer.draw_path(context, path, IdentityTransform(), (level, level, level, 1.0))

    @property
    def plane(self) -> Plane:
        """What is painted so far, 0 to 1."""
        rgba = np.asarray(self._renderer.buffer_rgba())
        shown = rgba[:, :, 0].astype(np.float32) * (rgba[:, :, 3].astype(np.float32) / 255.0)
        return np.asarray(shown / np.float32(255.0))


def covered(width: int, height: int, polygons: Sequence[Floats]) -> Plane:
    """Return the share of every pixel that polygons cover."""
    canvas = Canvas(width, height)
    canvas.paint(polygons, 1.0)
    return canvas.plane


def _codes(count: int) -> NDArray[np.uint8]:
    codes = np.full(count + 1, Path.LINETO, dtype=np.uint8)
    codes[0], codes[-1] = Path.MOVETO, Path.CLOSEPOLY
    return codes
