"""Registration: how the print lies on the sheet, from what stands out in the photograph.

    datum  |  ____________________         1. The path's and the datum road's bands, turned by degrees in small steps,
           |  ____________________)           are laid on what is material, wherever they may be (correlation): most
           | (____________________            in common wins, the datum road counting thrice.
           |  ____________________)        2. Across every point of both: the middle of what is material there; least
              begins may be empty             squares for the move and the turn, again until it rests.
                                           3. So with the best FEW places of step 1, each a good part of a lane away
                                              from the others; the one that then has most in common is taken.

Lanes look alike one pitch further on: the half circles and the datum road, which nothing interrupts, tell them apart.
So a photograph without most of the datum road cannot be registered by itself; where another of the same sheet was, it
begins from that one's shift, with step 2.
Source: the cross-correlation is Fisher's matched filter; step 2, Besl and McKay's iterated closest points (1992).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Bools, Floats
from gcodectl.errors import InputError
from gcodectl.vision.line import Line
from gcodectl.vision.profiles import Picture, across
from gcodectl.vision.segment import Above
from gcodectl.vision.view import Shift

MOST_DEGREES = 4.0
LEAST_DATUM = 0.6
"""Share of the datum road that must be in the picture."""
LEAST_ON = 0.8
"""Share of it that must be found there."""
LEAST_EXPLAINED = 0.6
"""Share of what is material, the datum road aside, that must lie in the path's band."""
FEW, APART = 6, 0.7
"""How many places are tried, and how far apart at least, in gaps."""
_SPECKS = 0.1
"""Share of what is material that may lie anywhere."""
_DATUM = 3.0
_BAND = 0.2
"""Half-width of a band, in gaps between lanes."""
_MOST_TURNS = 61
_COARSE = 150_000
"""Pixels of the correlation."""
_ROUNDS = 8


@dataclasses.dataclass(frozen=True)
class Roads:
    """What is sought: the path and the datum road, and how near their parts come to each other, mm."""

    path: Line
    datum: Line
    gap: float

    @property
    def middle(self) -> Floats:
        """Of the rectangle around both, mm."""
        points = np.concatenate([self.path.xy, self.datum.xy])
        return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def register(
    picture: Picture, above: Above, mask: Bools, roads: Roads, reach: float, before: Shift | None, name: str
) -> Shift:
    """Return how the print lies on the sheet, at most `reach` mm off; `before`: as another photograph has it.

    Raises InputError, named after `name`, where the road is not found.
    """
    starts = [before] if before else _laid_on(above, mask, roads, reach)
    rested = [_rested(picture, roads, start) for start in starts]
    shift = max(rested, key=lambda one: _in_common(above, mask, roads, one))
    datum = across(picture, shift, roads.datum, np.linspace(-0.3, 0.3, 61) * roads.gap)
    if before is None and datum.seen.mean() < LEAST_DATUM:
        raise InputError(
            f"only {100 * datum.seen.mean():.0f} % of the datum road is in the picture, without which lanes cannot be "
            "told apart; show all of it, or give a photograph that does before this one",
            source=name,
        )
    on = float(np.mean(datum.c[datum.seen].max(axis=1) > 0.5)) if datum.seen.any() else 1.0
    if (before is None or datum.seen.mean() > LEAST_DATUM) and on < LEAST_ON:
        raise InputError(
            f"the road is not found in it: only {100 * on:.0f} % of the datum road lies on what stands out; is it this "
            "path, on this sheet, whole and not moved?",
            source=name,
        )
    explained = _explained(above, mask, roads, shift)
    if explained < LEAST_EXPLAINED:
        raise InputError(
            f"the road is not found in it: {100 * (1 - explained):.0f} % of what stands out from the ground is not "
            "near the path; is it this path, and is the ground clear?",
            source=name,
        )
    return shift


def _bands(above: Above, roads: Roads, shift: Shift, half: float) -> tuple[Bools, Bools]:
    """Return the path's and the datum road's band on the bed from above."""
    import cv2

    planes = []
    for line in (roads.path, roads.datum):
        plane = np.zeros(above.seen.shape, dtype=np.uint8)
        points = np.round(256.0 * above.index(shift.applied(line.xy))).astype(np.int32)
        cv2.polylines(plane, [points[:, None, :]], False, 1, max(1, round(2.0 * half / above.spacing)), shift=8)
        planes.append(plane > 0)
    return planes[0], planes[1]


def _explained(above: Above, mask: Bools, roads: Roads, shift: Shift) -> float:
    path, _ = _bands(above, roads, shift, _BAND * roads.gap)
    _, datum = _bands(above, roads, shift, 0.4 * roads.gap)
    strip = mask & ~datum
    if strip.sum() < _SPECKS * mask.sum():  # nothing came out yet
        return 1.0
    return float((strip & path).sum() / strip.sum())


def _in_common(above: Above, mask: Bools, roads: Roads, shift: Shift) -> float:
    path, datum = _bands(above, roads, shift, _BAND * roads.gap)
    return float((mask & path).sum() + _DATUM * (mask & datum).sum())


def _laid_on(above: Above, mask: Bools, roads: Roads, reach: float) -> list[Shift]:
    """Return the FEW shifts whose bands have most in common with what is material, apart from each other."""
    import cv2

    factor = min(1.0, float(np.sqrt(_COARSE / mask.size)), 1.0)
    shape = tuple(max(8, round(side * factor)) for side in mask.shape)
    low, spacing = above.low, above.spacing * mask.shape[0] / shape[0]
    coarse = Above(low, spacing, above.light, np.zeros(shape, dtype=np.bool_))
    found = cv2.resize(mask.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA)
    room = [min(int(reach / spacing) + 1, shape[k] - 1) for k in (0, 1)]
    padded = cv2.copyMakeBorder(found, room[0], room[0], room[1], room[1], cv2.BORDER_CONSTANT, value=0.0)
    middle = roads.middle
    lever = 0.5 * float(np.ptp(roads.path.xy, axis=0).max())
    step = float(np.degrees(_BAND * roads.gap / lever))
    turns = np.linspace(-MOST_DEGREES, MOST_DEGREES, min(_MOST_TURNS, 2 * int(np.ceil(MOST_DEGREES / step)) + 1))
    found_there: list[tuple[float, Shift]] = []
    apart = max(1, round(APART * roads.gap / spacing))
    for degrees in turns:
        turned = Shift(0.0, 0.0, float(degrees), (float(middle[0]), float(middle[1])))
        path, datum = _bands(coarse, roads, turned, _BAND * roads.gap)
        common = cv2.matchTemplate(padded, path.astype(np.float32) + np.float32(_DATUM) * datum, cv2.TM_CCORR)
        for _ in range(FEW):
            _, score, _, (column, row) = cv2.minMaxLoc(common)
            there = dataclasses.replace(turned, x=(column - room[1]) * spacing, y=(row - room[0]) * spacing)
            found_there.append((score, there))
            common[max(0, row - apart) : row + apart + 1, max(0, column - apart) : column + apart + 1] = -np.inf
    best: list[Shift] = []
    for _, there in sorted(found_there, key=lambda one: -one[0]):
        if all(np.hypot(there.x - one.x, there.y - one.y) > APART * roads.gap for one in best):
            best.append(there)
    return best[:FEW]


def _rested(picture: Picture, roads: Roads, start: Shift) -> Shift:
    """Return the shift that brings the middles of what is material onto the lines."""
    shift = start
    every = [max(1, len(line) // 600) for line in (roads.path, roads.datum)]
    lines = [line[slice(None, None, n)] for line, n in zip((roads.path, roads.datum), every, strict=True)]
    for number in range(_ROUNDS):
        half = (0.4 if number < 3 else 0.3) * roads.gap
        x = np.linspace(-half, half, 61)
        rows, offsets = [], []
        for line in lines:
            seen = across(picture, shift, line, x)
            c = np.where(seen.c > 0.4, np.clip(seen.c, 0.0, 1.0), 0.0)
            mass = c.sum(axis=1)
            good = seen.seen & (mass > 2) & (np.maximum(c[:, 0], c[:, -1]) == 0)
            normal = shift.turned(line.across[good])
            lever = shift.applied(line.xy[good]) - np.array(shift.middle) - [shift.x, shift.y]
            rows.append(np.column_stack([normal, normal[:, 1] * lever[:, 0] - normal[:, 0] * lever[:, 1]]))
            offsets.append((c[good] @ x) / mass[good])
        matrix, offset = np.concatenate(rows), np.concatenate(offsets)
        if len(offset) < 10:
            return shift
        move = _least(matrix, offset)
        shift = dataclasses.replace(
            shift, x=shift.x + move[0], y=shift.y + move[1], degrees=shift.degrees + float(np.degrees(move[2]))
        )
        if np.abs(move[:2]).max() < 1e-4 * roads.gap:
            break
    return shift


def _least(matrix: Floats, offset: Floats) -> Floats:
    """Return the move that leaves the least squares, far offsets left out."""
    kept = np.ones(len(offset), dtype=np.bool_)
    scale = np.maximum(np.abs(matrix).max(axis=0), 1e-9)
    move = np.zeros(3)
    for _ in range(4):
        move = np.linalg.lstsq(matrix[kept] / scale, offset[kept], rcond=1e-6)[0] / scale
        rest = offset - matrix @ move
        kept = np.abs(rest) <= max(3.0 * 1.4826 * float(np.median(np.abs(rest[kept]))), 1e-6)
    return np.asarray(move)
