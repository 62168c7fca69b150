"""The sheet: a frame of printed markers around the place of the print, from which a photograph is measured.

    +---------------------------+       markers of ArUco's DICT_5X5_250, numbered from the upper left corner,
    | # # # # # # # # # # # # # |       clockwise; their corners are known in bed coordinates, x to the right,
    | #  ___________________  # |       y away from you
    | # |      window       | # |
    | # |  low ....... high | # |       lay the print on the paper itself, or cut the window out
    | #  ~~~~~~~~~~~~~~~~~~~  # |
    | # # # # # # # # # # # # # |       print it at 100 %, and measure the bar beneath it with a ruler
    +---------------------------+

Source: Garrido-Jurado et al., "Automatic generation and detection of highly reliable fiducial markers" (2014).
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats, Ints
from gcodectl.errors import UsageError

CELLS = 7
"""Cells along a marker's side, its black border included."""
MOST_MARKERS = 250
_SPACING = 1.45
"""Marker sizes from one to the next."""
_QUIET = 0.25
"""White around the markers, in marker sizes."""
_SHARE = 0.1
"""A marker's size, as a share of the root of the window's area."""


def dictionary() -> Any:
    """Return OpenCV's dictionary of the markers."""
    import cv2

    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)


@dataclasses.dataclass(frozen=True)
class Sheet:
    """A sheet of markers around a rectangle of the bed, mm."""

    low: tuple[float, float]
    """The window's lower left corner."""
    high: tuple[float, float]
    marker: float = 0.0
    """A marker's side; 0: to suit the window."""

    def __post_init__(self) -> None:
        sides = np.subtract(self.high, self.low)
        if not (np.isfinite(sides).all() and sides.min() > 0):
            raise UsageError(f"the sheet's window from {self.low} to {self.high} mm has no area")
        if not self.marker:
            size = max(1.0, round(2.0 * _SHARE * math.sqrt(sides[0] * sides[1])) / 2.0)
            object.__setattr__(self, "marker", size)
        if not self.marker > 0 or len(self._centers()) > MOST_MARKERS:
            raise UsageError(
                f"markers of {self.marker:g} mm around {sides[0]:g} x {sides[1]:g} mm are more than there are "
                f"({MOST_MARKERS}); take larger ones"
            )

    @property
    def rim(self) -> float:
        """How wide the paper is around the window, mm."""
        return self.marker * (1.0 + 2.0 * _QUIET)

    @property
    def paper(self) -> tuple[Floats, Floats]:
        """The paper's lower left and upper right corner, mm."""
        return np.asarray(self.low) - self.rim, np.asarray(self.high) + self.rim

    @property
    def corners(self) -> Floats:
        """Return the markers' corners, [m, 4, 2] mm: upper left, upper right, lower right, lower left."""
        half = 0.5 * self.marker * np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]])
        return np.asarray(self._centers()[:, None, :] + half, dtype=np.float64)

    def bits(self, number: int) -> Ints:
        """Return a marker's cells, [7, 7], 1 for white; the first row is the upper one."""
        import cv2

        return np.asarray(cv2.aruco.generateImageMarker(dictionary(), number, CELLS) > 0, dtype=np.int64)

    def image(self, per_mm: float) -> NDArray[np.uint8]:
        """Return the sheet as an image of `per_mm` pixels a mm, black on white."""
        low, high = self.paper
        shape = np.ceil((high - low)[::-1] * per_mm).astype(int)
        x = low[0] + (np.arange(shape[1]) + 0.5) / per_mm
        y = high[1] - (np.arange(shape[0]) + 0.5) / per_mm
        page = np.full(shape, 255, dtype=np.uint8)
        for number, corners in enumerate(self.corners):
            column = np.floor((x - corners[0, 0]) / self.marker * CELLS).astype(int)
            row = np.floor((corners[0, 1] - y) / self.marker * CELLS).astype(int)
            columns, rows = (np.flatnonzero((one >= 0) & (one < CELLS)) for one in (column, row))
            page[np.ix_(rows, columns)] = 255 * self.bits(number)[np.ix_(row[rows], column[columns])]
        return page

    def svg(self) -> str:
        """Return the sheet as an SVG page of its true size, with a bar of known length beneath the window."""
        low, high = self.paper
        width, height = high - low
        cell = self.marker / CELLS
        shapes = []
        for number, corners in enumerate(self.corners):
            left, top = corners[0, 0] - low[0], high[1] - corners[0, 1]
            for row, column in zip(*np.nonzero(self.bits(number) == 0), strict=True):
                shapes.append(f"M{left + column * cell:.4f} {top + row * cell:.4f}h{cell:.4f}v{cell:.4f}h-{cell:.4f}z")
        x0, x1 = self.low[0] - low[0], self.high[0] - low[0]
        y0, y1 = high[1] - self.high[1], high[1] - self.low[1]
        bar = 10.0 * max(1.0, math.floor((x1 - x0) / 20.0))  # its other half is for what it says
        line = max(0.1, 0.01 * self.marker)
        text = f"{bar:g} mm; the window: {self.low[0]:g}, {self.low[1]:g} to {self.high[0]:g}, {self.high[1]:g} mm"
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
            f'viewBox="0 0 {width:g} {height:g}">\n<rect width="100%" height="100%" fill="white"/>\n'
            f'<path shape-rendering="crispEdges" d="{"".join(shapes)}"/>\n'
            f'<path fill="none" stroke="black" stroke-width="{line:g}" d="M{x0:g} {y0:g}H{x1:g}V{y1:g}H{x0:g}z'
            f'M{x0:g} {height - 0.1 * self.marker:g}h{bar:g}"/>\n'
            f'<text x="{x0 + bar + self.marker / 4:g}" y="{height - 0.05 * self.marker:g}" '
            f'font-size="{0.12 * self.marker:g}">{text}</text>\n</svg>\n'
        )

    def _centers(self) -> Floats:
        """Return the markers' middles, [m, 2], clockwise from the upper left."""
        out = 0.5 * self.rim
        (x0, y0), (x1, y1) = np.asarray(self.low) - out, np.asarray(self.high) + out
        across = max(1, math.floor((x1 - x0) / (_SPACING * self.marker)))
        along = max(1, math.floor((y1 - y0) / (_SPACING * self.marker)))
        x, y = np.linspace(x0, x1, across + 1), np.linspace(y1, y0, along + 1)
        sides = [
            np.column_stack([x[:-1], np.full(across, y1)]), np.column_stack([np.full(along, x1), y[:-1]]),
            np.column_stack([x[:0:-1], np.full(across, y0)]), np.column_stack([np.full(along, x0), y[:0:-1]]),
        ]  # fmt: skip
        return np.concatenate(sides)


def sheet_around(points: Floats, margin: float) -> Sheet:
    """Return the sheet whose window leaves `margin` mm around points of the bed, [n, 2]; whole mm."""
    if not (len(points) and margin > 0):
        raise UsageError("a sheet takes points to go around, and a margin")
    low, high = np.floor(points.min(axis=0) - margin), np.ceil(points.max(axis=0) + margin)
    return Sheet((float(low[0]), float(low[1])), (float(high[0]), float(high[1])))
