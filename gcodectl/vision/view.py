"""View: from the bed to a photograph's pixels, whatever it was found from; and the shift of the print beneath it.

The sheet is laid on the bed by hand, so that what it calls x, y is off from the printer's by some mm and a degree:

    bed --- Shift: turn about the road's middle, then move ---> sheet --- View: Camera, or Flat ---> pixel
"""

from __future__ import annotations

import dataclasses
from typing import Protocol

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import UsageError


class View(Protocol):
    """Where points are in a photograph."""

    @property
    def position(self) -> Floats | None:
        """Where the camera stood, mm, [3]; None: straight above everything."""
        ...

    def pixels(self, xy: Floats) -> Floats:
        """Return the pixels (column, row) of points, [..., 2] mm."""
        ...


@dataclasses.dataclass(frozen=True)
class Shift:
    """How the print lies on the sheet: turned by `degrees` (anticlockwise) about `middle`, then moved by x, y mm."""

    x: float = 0.0
    y: float = 0.0
    degrees: float = 0.0
    middle: tuple[float, float] = (0.0, 0.0)

    def applied(self, xy: Floats) -> Floats:
        """Return points of the bed, [..., 2] mm, as the sheet calls them."""
        return np.asarray(self.turned(xy - self.middle) + self.middle + np.array([self.x, self.y]))

    def turned(self, directions: Floats) -> Floats:
        """Return directions, [..., 2], as the sheet calls them."""
        angle = np.radians(self.degrees)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return np.asarray(directions @ turn.T)


@dataclasses.dataclass(frozen=True)
class Flat:
    """A camera that looks straight down, and whose lens does not distort."""

    matrix: Floats
    """2 x 2, px a mm."""
    origin: Floats
    """Pixel of x = y = 0, [2]."""

    @property
    def position(self) -> None:
        """Straight above everything."""
        return

    def pixels(self, xy: Floats) -> Floats:
        """Return the pixels (column, row) of points, [..., 2] mm."""
        return np.asarray(xy @ self.matrix.T + self.origin)

    def plane(self, pixels: Floats) -> Floats:
        """Return the points, mm, at pixels, [..., 2]."""
        return np.asarray((pixels - self.origin) @ np.linalg.inv(self.matrix).T)


@dataclasses.dataclass(frozen=True)
class Scale:
    """A photograph's scale where there is no sheet: the camera looks straight down, y upwards in the picture.

    Either `per_mm`, pixels a mm, with x to the right (the road is then sought in the whole picture); or two `marks`:
    pixels (column, row) and what they show, mm on the bed.
    """

    per_mm: float = 0.0
    marks: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = ()

    def __post_init__(self) -> None:
        if self.marks:
            seen, known = (np.array([mark[k] for mark in self.marks], dtype=np.float64) for k in (0, 1))
            if len(self.marks) != 2 or not (np.ptp(seen, axis=0).any() and np.ptp(known, axis=0).any()):
                raise UsageError("a photograph's scale takes two marks in different places, each a pixel and its x, y")
        elif not (np.isfinite(self.per_mm) and self.per_mm > 0):
            raise UsageError(f"a photograph's scale is {self.per_mm:g} px a mm; it must be positive, or give two marks")

    def view(self, shape: tuple[int, ...], middle: Floats) -> Flat:
        """Return the view of a picture; with `per_mm`, `middle` (mm) is taken for what its middle shows."""
        if self.marks:
            (a, b), (p, q) = (np.array([mark[k] for mark in self.marks], dtype=np.float64) for k in (0, 1))
            across, along = (b - a)[0] + 1j * (b - a)[1], (q - p)[0] - 1j * (q - p)[1]
            factor = across / along
            matrix = np.array([[factor.real, factor.imag], [factor.imag, -factor.real]])
            return Flat(matrix, a - matrix @ p)
        matrix = self.per_mm * np.array([[1.0, 0.0], [0.0, -1.0]])
        return Flat(matrix, 0.5 * (np.array([shape[1], shape[0]]) - 1.0) - matrix @ middle)


def per_mm(view: View, xy: Floats) -> float:
    """Return pixels a mm around points, [n, 2] mm: the median over them."""
    step = 0.5
    x, y = (view.pixels(xy + step * one) - view.pixels(xy) for one in np.eye(2))
    area = np.abs(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0])
    return float(np.sqrt(np.median(area))) / step
