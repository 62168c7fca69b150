"""The scan: a circular window, as wide as the bead, slides along the path; the highest reading in it is the location's.

      ..............
     .   ( o )      .     the window is a circle in the plane of the layer, so in the frame it is what perspective
    ===( o  o  o )=====   makes of it; every pixel whose centre lies in it counts. The maximum forgives a road that
     .   ( o )      .     registration missed by a pixel or two, and leaves the window's cold edge out.

Of n pixels with noise the maximum is too high by about sqrt(2 ln n) of it, a degree for n = 80 and half a degree of
noise; where the bead is wide enough in the frame, pixels are averaged with their eight neighbours first (a third of
the noise is left), which costs nothing in the middle of the road.
Where the path comes by again later (the end of a ring laps over its start), the window leaves out what the later road
covers: that is younger, and hotter, and the maximum would take it. Source: Fathizadan, dissertation (2022), 4.1.2.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.thermal.frames import Frames, Image
from gcodectl.thermal.perspective import Perspective
from gcodectl.thermal.road import Road

_SMOOTHED = 5.0
"""px; where the bead is as wide as this, 3 x 3 pixels are averaged."""
_ASIDE = 0.25
"""Bead widths around a later road that are left out with it: registration and the lens are that exact at the best."""


@dataclasses.dataclass(frozen=True)
class Window:
    """Which pixels each location's window has: `pixel` in the order of locations, `first` of each location's in it."""

    pixel: Ints
    """Index into the frame, row by row."""
    first: Ints
    seen: Bools
    """Which locations are in the frame at all; those that are not have one pixel that does not count."""
    smooth: Bools
    """Where the bead is wide enough to average 3 x 3 pixels."""

    def highest(self, image: Image) -> Floats:
        """Return the highest reading in every location's window, NaN where it is not in the frame."""
        import cv2

        most = np.maximum.reduceat(image.ravel()[self.pixel], self.first)
        if self.smooth.any():
            smoothed = np.maximum.reduceat(cv2.blur(image, (3, 3)).ravel()[self.pixel], self.first)
            most = np.where(self.smooth, smoothed, most)
        return np.asarray(np.where(self.seen, most, np.nan), dtype=np.float64)


def window(perspective: Perspective, road: Road, shape: tuple[int, int]) -> Window:
    """Return the windows of a road's locations in frames of a shape."""
    height, width = shape
    half = 0.5 * road.bead
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    rim = half * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rims = perspective.pixels((road.xy[:, None, :] + rim).reshape(-1, 2)).reshape(len(road), 16, 2)
    low = np.clip(np.floor(rims.min(axis=1)), 0, [width - 1, height - 1]).astype(np.int64)
    high = np.clip(np.ceil(rims.max(axis=1)), 0, [width - 1, height - 1]).astype(np.int64)
    centres = perspective.pixels(road.xy)
    seen = np.all((centres >= 0) & (centres <= [width - 1, height - 1]), axis=1)
    pixels: list[Ints] = []
    for location in range(len(road)):
        columns = np.arange(low[location, 0], high[location, 0] + 1)
        rows = np.arange(low[location, 1], high[location, 1] + 1)
        grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        points = perspective.plane(grid.astype(np.float64))
        away = np.linalg.norm(points - road.xy[location], axis=1)
        within = away <= half
        bare = within & ~_covered(points, road, location)
        within = bare if bare.any() else within
        chosen = grid[within] if seen[location] and within.any() else grid[[int(away.argmin())]]
        pixels.append(chosen[:, 1] * width + chosen[:, 0])
    counts = np.array([len(one) for one in pixels])
    ahead = np.linalg.norm(perspective.pixels(road.xy + half * road.across) - centres, axis=1)
    smooth = 2.0 * ahead >= _SMOOTHED
    return Window(np.concatenate(pixels), np.concatenate([[0], np.cumsum(counts)[:-1]]), seen, smooth)


def _covered(points: Floats, road: Road, location: int) -> Bools:
    """Return which points lie on road that comes by later, two beads on along the path at the least."""
    covered = np.zeros(len(points), dtype=bool)
    half, reach = (0.5 + _ASIDE) * road.bead, 0.5 * (road.s[1] - road.s[0])
    later = np.flatnonzero(road.s > road.s[location] + 2.0 * road.bead)
    near = later[np.linalg.norm(road.xy[later] - road.xy[location], axis=1) < 2.0 * road.bead + reach]
    for other in near:
        left = road.across[other]
        apart = points - road.xy[other]
        along = apart @ np.array([left[1], -left[0]])
        end = reach + (half if other == len(road) - 1 else 0.0)
        covered |= (np.abs(apart @ left) <= half) & (along >= -reach) & (along <= end)
    return covered


def scan(frames: Frames, perspective: Perspective, road: Road) -> Floats:
    """Return the readings of a road's locations over the frames, [locations, frames] degC."""
    slots = window(perspective, road, frames[0].shape)
    return np.stack([slots.highest(frames[k]) for k in range(len(frames))], axis=1)
