"""Road widths from photographs: a strip's width along its path, to a fraction of a pixel.

    photograph --> light --> markers: view --> ground and material: c --> registration: shift
                                                                              |
                     width every `step` mm  <-- edges of every profile <-- profiles of c across the path

What is measured is the outline that is seen. Where the camera looks at a bead aside, it sees its far side further out
than it stands on the ground: half an ellipse of height h, seen from m mm aside for every mm above, is w = a + sqrt(a^2
+ (h m)^2) wide instead of 2a. With the bead's height given, that is taken off (a = (w^2 - (h m)^2) / 2w; what is
thinner than the datum road is taken to be lower in proportion).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError, UsageError
from gcodectl.vision.line import Line, gap, line_along
from gcodectl.vision.photo import Photo, checked, light
from gcodectl.vision.profiles import Picture
from gcodectl.vision.reading import Read, Reading, inner, reading_of
from gcodectl.vision.rectify import find_camera
from gcodectl.vision.register import Roads, register
from gcodectl.vision.segment import find_contrast, from_above
from gcodectl.vision.sheet import Sheet
from gcodectl.vision.view import Scale, Shift, View, per_mm

REACH = 10.0
"""mm by which the sheet may be off."""
MOST_GLARE = 0.5
"""Share of the strip's points that may be lost to light that fills the sensor."""


@dataclasses.dataclass(frozen=True)
class Widths:
    """The width of a strip along its path."""

    s: Floats
    """mm along the path, [k]"""
    width: Floats
    """mm, [k]; NaN where it is not seen."""
    nominal: float
    """Width of the datum road as measured, mm."""
    shift: Shift
    """How the print lay on the sheet."""
    residual: float
    """Rms by which the markers are off, mm on the bed; 0 without a sheet."""
    edges: Floats
    """Pixels of the edges, left and right, [k, 2, 2]: where `overlay` draws them; NaN where there are none."""
    notes: tuple[str, ...] = ()


def measure_widths(
    image: Photo, path: Floats, datum: Floats, sheet: Sheet | Scale, step: float = 0.25, *,
    height: float = 0.0, like: Widths | None = None, name: str = "photograph",
) -> Widths:  # fmt: skip
    """Return the widths of a strip every `step` mm of its path.

    image: [h, w] or [h, w, 3], 8 bits; path [n, 2] and datum [2, 2]: bed coordinates, mm; height: of the bead, mm (0:
    flat). `like`: what another photograph of the same sheet gave; the datum road may then be outside this one. Raises
    InputError, named after `name`, for what is no photograph of the road; UsageError for a path that is none.
    """
    roads = _roads(path, datum, step)
    image = checked(image, name)
    view, low, high, reach, residual = _view(image, sheet, roads, name)
    seen = light(image)
    above = from_above(seen, view, low, high)
    contrast, mask = find_contrast(above, name)
    picture = Picture(seen, view, contrast)
    shift = register(picture, above, mask, roads, reach, like.shift if like else None, name)
    reading = reading_of(picture, shift, roads, like.nominal if like else None, name)
    strip = reading.read(roads.path, step)
    if strip.glare.mean() > MOST_GLARE:
        raise InputError(
            f"it is overexposed: light fills the sensor on {100 * strip.glare.mean():.0f} % of the road; expose it for "
            "less",
            source=name,
        )
    steady = inner(roads.datum)
    nominal = _on_ground(reading.read(steady, step).width, height, reading, steady)
    known = np.isfinite(nominal).mean() > 0.5
    return Widths(
        roads.path.s, _on_ground(strip.width, height, reading, roads.path),
        float(np.nanmedian(nominal)) if known else reading.usual, shift, residual, strip.edges,
        _notes(name, residual, strip, reading),
    )  # fmt: skip


def _roads(path: Floats, datum: Floats, step: float) -> Roads:
    ends = np.asarray(datum, dtype=np.float64)
    if ends.shape != (2, 2) or not np.isfinite(ends).all() or not np.any(ends[0] != ends[1]):
        raise UsageError("the datum road takes two different points, x and y each")
    line = line_along(path, step)
    beside = line_along(ends, min(step, float(np.linalg.norm(ends[1] - ends[0])) / 20), "datum road")
    return Roads(line, beside, gap(path, ends))


def _view(
    image: Photo, sheet: Sheet | Scale, roads: Roads, name: str
) -> tuple[View, Floats, Floats, float, float]:  # fmt: skip
    """Return the view, the window's corners, by how much the print may be off, and the markers' residual; mm."""
    if isinstance(sheet, Sheet):
        camera = find_camera(image, sheet, name)
        inset = max(0.5, 0.06 * sheet.marker)  # the window is cut by hand
        scale = per_mm(camera, sheet.corners.reshape(-1, 2))
        return camera, np.asarray(sheet.low) + inset, np.asarray(sheet.high) - inset, REACH, camera.rms / scale
    view = sheet.view(image.shape, roads.middle)
    bottom, right = image.shape[0] - 1, image.shape[1] - 1
    corners = view.plane(np.array([[0, 0], [0, bottom], [right, 0], [right, bottom]], dtype=np.float64))
    low, high = corners.min(axis=0), corners.max(axis=0)
    return view, low, high, REACH if sheet.marks else 0.5 * float((high - low).max()), 0.0


def _on_ground(width: Floats, height: float, reading: Reading, line: Line) -> Floats:
    """Return the widths on the ground of beads that are seen aside."""
    position = reading.picture.view.position
    if not height or position is None:
        return width
    away = reading.shift.applied(line.xy) - position[:2]
    slope = np.sum(away * reading.shift.turned(line.across), axis=1) / position[2]
    rise = height * np.minimum(1.0, width / reading.usual) * slope
    return np.asarray(np.where(width > 0, (width**2 - rise**2) / np.maximum(width, 1e-12), width))


def _notes(name: str, residual: float, strip: Read, reading: Reading) -> tuple[str, ...]:
    shift = reading.shift
    notes = [
        f"{name}: the print lies {shift.x:+.2f}, {shift.y:+.2f} mm and {shift.degrees:+.2f} degrees off the sheet; "
        f"markers {residual:.3f} mm (rms), blur {reading.blur / reading.pixel:.1f} px"
    ]
    unseen = np.isnan(strip.width)
    if unseen.any():
        lost = f" ({100 * strip.glare.mean():.0f} % in glare)" if strip.glare.any() else ""
        notes.append(f"{name}: {100 * unseen.mean():.0f} % of the strip is not seen{lost}")
    return tuple(notes)
