"""Reading: all that widths are read with in one photograph, the blur and the material's looks found in it first.

1. The datum road, of steady width, gives a usual width and the blur; the strip, where the datum road is not shown.
2. Wide places of the strip give the material's usual c, and how much darker its flanks are.
3. Then any line is read: the edges of every profile across it, and where there is nothing to be read.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Bools, Floats
from gcodectl.errors import InputError
from gcodectl.vision.edges import FAINT, Edges, find_blur, find_edges, runs
from gcodectl.vision.line import Line
from gcodectl.vision.profiles import Picture, Profiles, across
from gcodectl.vision.register import Roads
from gcodectl.vision.view import Shift, per_mm

LEAST_PIXELS = 3.0
"""Of the datum road's width."""
MOST_BLUR = 0.4
"""Of the datum road's width."""
_WIDE = 2.4
"""Datum widths to either side that are looked at, where the lanes leave so much room."""
_SURE = 3.0
"""Of the ground's spread, that a road stands out by."""
_CHUNK = 4000


@dataclasses.dataclass(frozen=True)
class Read:
    """Of every point of a line."""

    width: Floats
    """mm, as seen, [k]; NaN where it is not."""
    edges: Floats
    """Pixels of the left and the right edge, [k, 2, 2]; NaN where there are none."""
    glare: Bools
    """Whether light fills the sensor there, [k]."""


@dataclasses.dataclass(frozen=True)
class Reading:
    """What widths are read with."""

    picture: Picture
    shift: Shift
    usual: float
    """Width of the datum road, mm, roughly."""
    blur: float
    """mm, standard deviation."""
    pixel: float
    """mm"""
    half: float
    """mm to either side that is looked at."""
    level: float = 1.0
    rim: float | None = None
    """What `find_edges` takes."""

    @property
    def x(self) -> Floats:
        """Offsets across, mm, half a pixel apart."""
        count = max(8, int(np.ceil(2.0 * self.half / self.pixel)))
        return np.asarray(np.linspace(-self.half, self.half, 2 * (count // 2) + 1))

    def read(self, line: Line, step: float) -> Read:
        """Return the widths along a line, each the mean over `step` mm of it."""
        parts = [self._part(line[slice(k, k + _CHUNK)], step) for k in range(0, len(line), _CHUNK)]
        width, edges, glare = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("width", "edges", "glare")
        )
        return Read(width, edges, glare)

    def _part(self, line: Line, step: float) -> Read:
        lines = int(np.clip(round(step / (1.5 * self.pixel)), 1, 5))
        shown = across(self.picture, self.shift, line, self.x, lines=lines, step=step)
        faint = float(np.clip(_SURE * self.picture.contrast.spread, *FAINT))
        found = find_edges(shown.c, shown.x, self.blur, self.usual, self.level, self.rim, faint)
        glare = _glare(shown, found) & shown.seen
        edge = max(2, len(shown.x) // 12)
        hidden = (np.median(shown.c[:, :edge], axis=1) > 0.5) | (np.median(shown.c[:, -edge:], axis=1) > 0.5)
        width = np.where(shown.seen & ~glare & ~hidden, found.width, np.nan)
        ends = np.stack([found.high, found.low], axis=1)
        points = line.xy[:, None, :] + ends[:, :, None] * line.across[:, None, :]
        edges = self.picture.view.pixels(self.shift.applied(points))
        edges[~(width > 0)] = np.nan
        return Read(width, edges, glare)


def reading_of(picture: Picture, shift: Shift, roads: Roads, known: float | None, name: str) -> Reading:
    """Return what widths are read with; `known`: the datum road's width, from another photograph, mm.

    Raises InputError, named after `name`, where the road is too small or too blurred in it.
    """
    pixel = 1.0 / per_mm(picture.view, shift.applied(roads.path.xy))
    rough = Reading(picture, shift, roads.gap, pixel, pixel, 0.45 * roads.gap)
    shown = across(picture, shift, inner(roads.datum), rough.x)
    if shown.seen.mean() < 0.5 and known:
        shown = across(picture, shift, _some(roads.path, 400), rough.x)
    c = shown.c[shown.seen]
    low, high, there = runs(c, rough.x, 0.1 * roads.gap)
    usual = known or (float(np.median((high - low)[there])) if there.any() else 0.0)
    if usual < LEAST_PIXELS * pixel:
        raise InputError(
            f"its datum road is {usual / pixel:.1f} px wide, too few to measure; come nearer, in several photographs",
            source=name,
        )
    good = np.flatnonzero(there & (high - low > 0.6 * usual))
    blur = find_blur(c[good[:: max(1, len(good) // 100)]], rough.x, usual, 1.0 / pixel)
    if blur > MOST_BLUR * usual:
        raise InputError(
            f"it is blurred by {blur / pixel:.0f} px, beyond measuring a road of {usual / pixel:.0f} px; focus on it",
            source=name,
        )
    reading = dataclasses.replace(rough, usual=usual, blur=blur, half=min(0.48 * roads.gap, _WIDE * usual))
    some = across(picture, shift, _some(roads.path, 500), reading.x)
    found = find_edges(some.c[some.seen], some.x, blur, usual)
    wide = found.there & (found.width > max(6.0 * blur, 0.5 * usual))
    if wide.sum() < 10:
        return dataclasses.replace(reading, rim=0.0)
    return dataclasses.replace(
        reading, level=float(np.median(found.level[wide])), rim=float(np.median(found.rim[wide]))
    )


def inner(road: Line) -> Line:
    """Return a road without its ends."""
    return road[slice(len(road) // 10, len(road) - len(road) // 10)]


def _some(line: Line, count: int) -> Line:
    return line[slice(None, None, max(1, len(line) // count))]


def _glare(shown: Profiles, found: Edges) -> Bools:
    """Return where light fills the sensor on much of the ground beside the road, or of the road."""
    inside = (shown.x > found.low[:, None]) & (shown.x < found.high[:, None]) & found.there[:, None]

    def share(where: Bools) -> Floats:
        return np.asarray((shown.full & where).sum(axis=1) / np.maximum(where.sum(axis=1), 1))

    return np.asarray((share(~inside) > 0.3) | (share(inside) > 0.5))
