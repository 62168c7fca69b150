"""Registration: where the next layer is in the frame, from the frame alone.

    ....|####|....   fresh road in the hottest image      A pinhole sees the plane z = n h through
    ----+-->x+----   the path, where the last layer's         M_n = M_0 + n h [0 0 p],  p = K r3,
        |    |       perspective puts it                  so only the third column moves: three numbers, found from
        e = centre of the road - path, across it          some hundred offsets e, straight edges and all.

1. A first guess: the last perspective, or the column for which the bounding boxes' sides meet (one that the frame cuts
   off says nothing); whichever has more of the path on fresh pixels.
2. Across every location: the centre of what is fresh. Locations that are hidden, cut off or too wide say nothing.
3. Least squares for the column's move, offsets beyond 2.5 robust deviations left out; again from 2 until it rests.

Sides of older layers, warm and just beside, stay below Otsu's threshold and do not pull the centre. The side of the
fresh layer itself is as hot as its top, and does: by half of what is seen of it, the same in every layer. So the first
layer is registered against its own matching points, and what is found beyond them is taken off every later one; where
that is more than an eighth of a bead or two pixels, the points were not marked on it, and the frame is believed.
Source: the need, Fathizadan, dissertation (2022), section 4.1.2; the column, from the pinhole's own geometry.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Bools, Floats
from gcodectl.errors import InputError
from gcodectl.thermal.frames import Image
from gcodectl.thermal.fresh import bounding_box, fresh_threshold
from gcodectl.thermal.perspective import Perspective
from gcodectl.thermal.road import Road

_REACH = 1.5
"""Bead widths to either side in which the road is sought."""
_SAMPLES = 73
_ROUNDS = 12
_SETTLED = 0.01
"""px"""
LEAST_ON = 0.8
"""Share of the locations in the frame that must lie on fresh road."""
LEAST_INSIDE = 0.8
"""Share of the path that must be in the frame."""


@dataclasses.dataclass(frozen=True)
class Registered:
    """A layer's perspective, and how well it fits."""

    perspective: Perspective
    moved: float
    """px, mean over the path, from where it was thought to be."""
    rms: float
    """px; of the offsets across the road that are left."""
    found: float
    """Share of the locations in the frame across which the road's middle was found."""
    aside: Floats
    """What the third column has beyond the road's top: shape (3,)."""


def inside(perspective: Perspective, road: Road, shape: tuple[int, int], where: str) -> Bools:
    """Return which locations are in a frame; raises InputError, named after `where`, when too many are not."""
    pixels = perspective.pixels(road.xy)
    seen = np.all((pixels >= 0) & (pixels <= [shape[1] - 1, shape[0] - 1]), axis=1)
    if seen.mean() < LEAST_INSIDE:
        first = int(np.flatnonzero(~seen)[0])
        raise InputError(
            f"{100 * (1 - seen.mean()):.0f} % of the path is outside the frame ({shape[1]} x {shape[0]} px): x "
            f"{road.xy[first, 0]:.0f}, y {road.xy[first, 1]:.0f} mm would be at column {pixels[first, 0]:.0f}, row "
            f"{pixels[first, 1]:.0f}; check the matching points, or turn the camera",
            source=where,
        )
    return np.asarray(seen)


def register(image: Image, road: Road, before: Perspective | Registered, warm: float, where: str) -> Registered:
    """Return where a layer is in an image of its fresh road; `warm`: what older layers may read at the most, degC.

    `before`: an earlier layer, or for the first its perspective from matching points. Raises InputError, named after
    `where`, if the road is not found.
    """
    last = before if isinstance(before, Perspective) else before.perspective
    threshold = fresh_threshold(image, warm)
    mask = image > threshold
    if not mask.any():
        raise InputError(f"there is no fresh road in it: nothing reads above {threshold:.0f} degC", source=where)
    start = last if isinstance(before, Perspective) else _shifted(last, before.aside)
    guesses = (start, _boxed(mask, road, start))
    perspective = max(guesses, key=lambda one: _on(mask, one.pixels(road.xy)))
    seen = inside(perspective, road, mask.shape, where)
    rms, found = np.inf, 0.0
    for _ in range(_ROUNDS):
        perspective, step, rms, found = _moved(image, threshold, road[seen], perspective)
        if step < _SETTLED:
            break
    on = _on(mask, perspective.pixels(road.xy[seen]))
    if on < LEAST_ON:
        raise InputError(
            f"only {100 * on:.0f} % of the path lies on fresh road; does the path belong to these frames, and were the "
            "matching points marked in them?",
            source=where,
        )
    if isinstance(before, Registered):
        aside = before.aside
    else:
        aside = _column(perspective, last)
        far = _apart(perspective, last, road)[seen].mean()
        wide = np.linalg.norm(last.pixels(road.xy + road.bead * road.across) - last.pixels(road.xy), axis=1).mean()
        aside = aside if far <= max(2.0, 0.125 * wide) else np.zeros(3)
    perspective = _shifted(perspective, -aside)
    return Registered(perspective, float(_apart(perspective, last, road)[seen].mean()), rms, found, aside)


def _apart(one: Perspective, other: Perspective, road: Road) -> Floats:
    """Return how far apart two perspectives put the locations, px."""
    return np.asarray(np.linalg.norm(one.pixels(road.xy) - other.pixels(road.xy), axis=1))


def _column(one: Perspective, other: Perspective) -> Floats:
    return np.asarray(one.matrix[:, 2] - other.matrix[:, 2])


def _shifted(one: Perspective, column: Floats) -> Perspective:
    matrix = one.matrix.copy()
    matrix[:, 2] += column
    return Perspective(matrix)


def _on(mask: Bools, pixels: Floats) -> float:
    """Return the share of pixels that lie on a mask."""
    near = np.clip(np.round(pixels), -1, 2**20).astype(np.int64)
    good = np.all((near >= 0) & (near < [mask.shape[1], mask.shape[0]]), axis=1)
    return float(mask[near[good, 1], near[good, 0]].sum() / len(pixels))


def _boxed(mask: Bools, road: Road, last: Perspective) -> Perspective:
    """Return the perspective whose column makes the bounding boxes meet, sides that the frame cuts off aside."""
    rim = np.concatenate([road.xy - 0.5 * road.bead * road.across, road.xy + 0.5 * road.bead * road.across])
    seen, limit = bounding_box(mask), np.array([mask.shape[1] - 1, mask.shape[0] - 1])
    for _ in range(4):
        edge = last.pixels(rim)
        rows, errors = [], []
        for side, extreme in enumerate((edge.argmin(axis=0), edge.argmax(axis=0))):
            for axis in (0, 1):
                thought = edge[extreme[axis], axis]
                if min(thought, seen[side, axis]) >= 2 and max(thought, seen[side, axis]) <= limit[axis] - 2:
                    depth = float(np.append(rim[extreme[axis]], 1.0) @ last.matrix[2])
                    rows.append(np.append(np.eye(2)[axis], -thought) / depth)
                    errors.append(seen[side, axis] - thought)
        if not rows:
            break
        last = _shifted(last, _least(np.array(rows), np.array(errors)))
    return last


def _least(rows: Floats, errors: Floats) -> Floats:
    """Return the column's move that leaves the least squares of `errors`."""
    scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    return np.asarray(np.linalg.lstsq(rows / scale, errors, rcond=1e-6)[0] / scale)


def _moved(image: Image, threshold: float, road: Road, last: Perspective) -> tuple[Perspective, float, float, float]:
    """Return the perspective after one step, by how many px it moved, the rms of the offsets, and the share found."""
    offset, found = _offsets(image, threshold, road, last)
    if found.sum() < 6:
        return last, 0.0, np.inf, float(found.mean())
    road, offset = road[found], offset[found]
    at, ahead = last.pixels(road.xy), last.pixels(road.xy + offset[:, None] * road.across)
    beside = last.pixels(road.xy + 0.5 * road.bead * np.stack([road.across[:, 1], -road.across[:, 0]], axis=1)) - at
    normal = np.stack([-beside[:, 1], beside[:, 0]], axis=1) / np.linalg.norm(beside, axis=1)[:, None]
    error = np.einsum("ij,ij->i", ahead - at, normal)
    depth = np.column_stack([road.xy, np.ones(len(road))]) @ last.matrix[2]
    rows = np.column_stack([normal, -np.einsum("ij,ij->i", normal, at)]) / depth[:, None]
    kept = np.ones(len(error), dtype=bool)
    column, rest = np.zeros(3), error
    for _ in range(5):
        column = _least(rows[kept], error[kept])
        rest = error - rows @ column
        spread = max(1.4826 * float(np.median(np.abs(rest[kept]))), 0.02)
        kept = np.abs(rest) < 2.5 * spread
    after = _shifted(last, column)
    step = float(np.linalg.norm(after.pixels(road.xy) - at, axis=1).max())
    return after, step, float(np.sqrt(np.mean(rest[kept] ** 2))), float(found.mean())


def _offsets(image: Image, threshold: float, road: Road, perspective: Perspective) -> tuple[Floats, Bools]:
    """Return how far across the path the middle of the fresh road is, mm, and where it was found."""
    import cv2

    across = np.linspace(-_REACH, _REACH, _SAMPLES) * road.bead
    points = road.xy[:, None, :] + across[None, :, None] * road.across[:, None, :]
    pixels = perspective.pixels(points.reshape(-1, 2)).astype(np.float32).reshape(len(road), _SAMPLES, 2)
    profile = cv2.remap(
        image, pixels[:, :, 0], pixels[:, :, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0
    )
    fresh = (profile > threshold).astype(np.float64)
    width = fresh.sum(axis=1) * (across[1] - across[0])
    middle = fresh @ across / np.maximum(fresh.sum(axis=1), 1.0)
    whole = (fresh[:, 0] == 0) & (fresh[:, -1] == 0)
    return middle, whole & (width > 0.5 * road.bead) & (width < 1.5 * road.bead)
