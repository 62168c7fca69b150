"""Road widths from photographs: a strip's width along its path, to a fraction of a pixel.

    photograph --> light --> markers: view --> ground and material: c --> registration: shift
                                                                              |
                     width every `step` mm  <-- edges of every profile <-- profiles of c across the path

What is measured is the outline that is seen. Where the camera looks at a bead aside, it sees its far side further out
than it stands on the ground: half an ellipse of height h, seen from m mm aside for every mm above, is w = a + sqrt(a^2 +
(h m)^2) wide instead of 2a. With the bead's height given, that is taken off (a = (w^2 - (h m)^2) / 2w; what is thinner
than the datum road is taken to be lower in proportion).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from gcodectl.columns import Bools, Floats
from gcodectl.errors import InputError, UsageError
from gcodectl.vision.edges import find_blur, find_edges, runs
from gcodectl.vision.line import Line, gap, line_along
from gcodectl.vision.photo import Photo, checked, light
from gcodectl.vision.profiles import Picture, Profiles, across
from gcodectl.vision.rectify import find_camera
from gcodectl.vision.register import Roads, register
from gcodectl.vision.segment import find_contrast, from_above
from gcodectl.vision.sheet import Sheet
from gcodectl.vision.view import Scale, Shift, View, per_mm

REACH = 10.0
"""mm by which the sheet may be off."""
LEAST_PIXELS = 3.0
"""Of the datum road's width."""
MOST_BLUR = 0.4
"""Of the datum road's width."""
MOST_GLARE = 0.5
"""Share of the strip's points that may be lost to light that fills the sensor."""
_WIDE = 2.4
"""Datum widths to either side that are looked at, where the lanes leave so much room."""
_CHUNK = 4000


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
    pixel = 1.0 / per_mm(view, shift.applied(roads.path.xy))
    usual, blur = _usual(picture, shift, roads, pixel, like.nominal if like else 0.0, name)
    x = _offsets(min(0.48 * roads.gap, _WIDE * usual), pixel)
    lines = int(np.clip(round(step / (1.5 * pixel)), 1, 5))
    parts = _parts(roads.path)
    level = _level(picture, shift, roads.path, x, blur, usual)
    found = [_measured(picture, shift, part, x, (lines, step), blur, usual, level) for part in parts]
    datum_width = like.nominal if like else float("nan")
    first = _measured(picture, shift, roads.datum[_inner(roads.datum)], x, (lines, step), blur, usual, level)
    if np.isfinite(first[0]).mean() > 0.5:
        datum_width = float(
            np.nanmedian(_on_ground(first[0], height, usual, view, shift, roads.datum[_inner(roads.datum)]))
        )
    width, edges, glare = (np.concatenate([one[k] for one in found]) for k in range(3))
    if glare.mean() > MOST_GLARE:
        raise InputError(
            f"it is overexposed: light fills the sensor on {100 * glare.mean():.0f} % of the road; expose it for less",
            source=name,
        )
    width = _on_ground(width, height, usual, view, shift, roads.path)
    notes = _notes(name, shift, residual, width, glare, blur / pixel)
    return Widths(roads.path.s, width, datum_width, shift, residual, edges, notes)


def measure_session(
    images: Sequence[tuple[str, Photo]], path: Floats, datum: Floats, sheet: Sheet | Scale, step: float = 0.25, *,
    height: float = 0.0,
) -> Widths:  # fmt: skip
    """Return the widths from several photographs, (name, image) each, of one print and an unmoved sheet, joined.

    Those that do not show the datum road go by the shift of one that does. Raises InputError, named after the
    photograph, as `measure_widths` does.
    """
    if not images:
        raise UsageError("there is no photograph to measure")
    found: list[Widths] = []
    later: list[tuple[str, Photo]] = []
    refused: InputError | None = None
    for name, image in images:
        try:
            found.append(measure_widths(image, path, datum, sheet, step, height=height, name=name))
        except InputError as error:
            refused = refused or error
            later.append((name, image))
    if not found and refused:
        raise refused
    for name, image in later:
        found.append(measure_widths(image, path, datum, sheet, step, height=height, like=found[0], name=name))
    return join_widths(found)


def join_widths(several: Sequence[Widths]) -> Widths:
    """Return the widths of one print from several photographs: the mean of those that see a place, NaN where none does.

    Raises UsageError where they are of different paths or steps.
    """
    if not several:
        raise UsageError("there are no widths to join")
    first = several[0]
    if any(len(one.s) != len(first.s) or not np.allclose(one.s, first.s) for one in several):
        raise UsageError("the photographs were measured along different paths or at different steps")
    if len(several) == 1:
        return first
    each = np.stack([one.width for one in several])
    seen = np.isfinite(each)
    count = seen.sum(axis=0)
    mean = np.where(count > 0, np.where(seen, each, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)
    apart = (each - mean)[:, count > 1]
    notes = [note for one in several for note in one.notes]
    if apart.size and first.nominal > 0:
        rms = float(np.sqrt(np.nanmean(apart**2)))
        notes.append(
            f"{100 * (count > 1).mean():.0f} % of the strip is seen more than once, {100 * rms / first.nominal:.1f} % of "
            "the datum road's width (rms) from the mean"
        )
    known = [one.nominal for one in several if np.isfinite(one.nominal)]
    return Widths(
        first.s, mean, float(np.mean(known)) if known else float("nan"), first.shift,
        max(one.residual for one in several), np.full((len(first.s), 2, 2), np.nan), tuple(notes),
    )  # fmt: skip


def _roads(path: Floats, datum: Floats, step: float) -> Roads:
    ends = np.asarray(datum, dtype=np.float64)
    if ends.shape != (2, 2):
        raise UsageError("the datum road takes two points, x and y each")
    long = float(np.linalg.norm(ends[1] - ends[0]))
    line = line_along(path, step)
    return Roads(line, line_along(ends, min(step, long / 20) if long > 0 else step, "datum road"), gap(path, ends))


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
    corners = view.plane(np.array([[0, 0], [0, image.shape[0] - 1], [image.shape[1] - 1, 0], image.shape[1::-1]]))
    low, high = corners.min(axis=0), corners.max(axis=0)
    return view, low, high, REACH if sheet.marks else 0.5 * float((high - low).max()), 0.0


def _inner(line: Line) -> slice:
    """Return the rows of a road without its ends."""
    return slice(len(line) // 10, len(line) - len(line) // 10)


def _offsets(half: float, pixel: float) -> Floats:
    """Return offsets across, mm, half a pixel apart."""
    count = max(8, int(np.ceil(2.0 * half / pixel)))
    return np.asarray(np.linspace(-half, half, 2 * (count // 2) + 1))


def _parts(line: Line) -> list[Line]:
    return [line[slice(k, k + _CHUNK)] for k in range(0, len(line), _CHUNK)]


def _usual(picture: Picture, shift: Shift, roads: Roads, pixel: float, known: float, name: str) -> tuple[float, float]:
    """Return the datum road's width and the blur, mm; from the strip, where the datum road is not seen."""
    x = _offsets(0.45 * roads.gap, pixel)
    shown = across(picture, shift, roads.datum[_inner(roads.datum)], x)
    if shown.seen.mean() < 0.5 and known:
        path = roads.path[slice(None, None, max(1, len(roads.path) // 400))]
        shown = across(picture, shift, path, x)
    c = shown.c[shown.seen]
    low, high, there = runs(c, x, 0.1 * roads.gap) if len(c) else (np.empty(0), np.empty(0), np.empty(0, dtype=bool))
    wide = known or (float(np.median((high - low)[there])) if there.any() else 0.0)
    if wide < LEAST_PIXELS * pixel:
        raise InputError(
            f"its datum road is {wide / pixel:.1f} px wide, too few to measure; come nearer, in several photographs",
            source=name,
        )
    good = np.flatnonzero(there & (high - low > 0.6 * wide))
    blur = find_blur(c[good[:: max(1, len(good) // 100)]], x, wide, 1.0 / pixel)
    if blur > MOST_BLUR * wide:
        raise InputError(
            f"it is blurred by {blur / pixel:.0f} px, beyond measuring a road of {wide / pixel:.0f} px; focus on the road",
            source=name,
        )
    return wide, blur


def _level(picture: Picture, shift: Shift, line: Line, x: Floats, blur: float, usual: float) -> float:
    """Return the c of a road wide enough to show it."""
    some = across(picture, shift, line[slice(None, None, max(1, len(line) // 500))], x)
    found = find_edges(some.c[some.seen], x, blur, usual)
    wide = found.there & (found.width > max(6.0 * blur, 0.5 * usual))
    return float(np.median(found.level[wide])) if wide.sum() >= 10 else 1.0


def _measured(
    picture: Picture, shift: Shift, line: Line, x: Floats, each: tuple[int, float], blur: float, usual: float,
    level: float,
) -> tuple[Floats, Floats, Bools]:  # fmt: skip
    """Return width, mm, NaN where it is not seen; the pixels of the edges; where light fills the sensor."""
    shown = across(picture, shift, line, x, lines=each[0], step=each[1])
    found = find_edges(shown.c, x, blur, usual, level)
    glare = _glare(shown, found.low, found.high, found.there) & shown.seen
    rim = max(2, len(x) // 12)
    covered = (np.median(shown.c[:, :rim], axis=1) > 0.5) | (np.median(shown.c[:, -rim:], axis=1) > 0.5)
    width = np.where(shown.seen & ~glare & ~covered, found.width, np.nan)
    ends = np.stack([found.high, found.low], axis=1)
    points = line.xy[:, None, :] + ends[:, :, None] * line.across[:, None, :]
    edges = picture.view.pixels(shift.applied(points))
    edges[~(width > 0)] = np.nan
    return width, edges, glare


def _glare(shown: Profiles, low: Floats, high: Floats, there: Bools) -> Bools:
    """Return where most of the ground beside the road, or of the road, fills the sensor."""
    inside = (shown.x > low[:, None]) & (shown.x < high[:, None]) & there[:, None]

    def share(where: Bools) -> Floats:
        return np.asarray((shown.full & where).sum(axis=1) / np.maximum(where.sum(axis=1), 1))

    return (share(~inside) > 0.3) | (share(inside) > 0.5)


def _on_ground(width: Floats, height: float, usual: float, view: View, shift: Shift, line: Line) -> Floats:
    """Return the widths on the ground of beads that are seen aside."""
    if not height or view.position is None:
        return width
    away = shift.applied(line.xy) - view.position[:2]
    slope = np.sum(away * shift.turned(line.across), axis=1) / view.position[2]
    rise = height * np.minimum(1.0, width / usual) * slope
    return np.asarray(np.where(width > 0, (width**2 - rise**2) / np.maximum(width, 1e-12), width))


def _notes(
    name: str, shift: Shift, residual: float, width: Floats, glare: Bools, blur: float
) -> tuple[str, ...]:  # fmt: skip
    notes = [
        f"{name}: the print lies {shift.x:+.2f}, {shift.y:+.2f} mm and {shift.degrees:+.2f} degrees off the sheet; markers "
        f"{residual:.3f} mm (rms), blur {blur:.1f} px"
    ]
    unseen = np.isnan(width)
    if unseen.any():
        lost = f" ({100 * glare.mean():.0f} % in glare)" if glare.any() else ""
        notes.append(f"{name}: {100 * unseen.mean():.0f} % of the strip is not seen{lost}")
    return tuple(notes)
