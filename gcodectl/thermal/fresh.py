"""The fresh layer in a frame, found by Otsu's threshold; and which frames show one being laid.

    pixels |#                                   Otsu: the threshold that leaves the least variance within the two
           |#                                   classes. What lies below the fresh road is warm as well, and where
           |##     .:.            :##           there is much of it, it joins the upper class: then the upper class
           +-------------|-------------> T      is split once more.
            room   older layers   fresh

    laying   a pixel is newly hot where it passes half-way from the band's top to the deposition temperature and was
             not hot in the last 20 s (the head hides for less). Frames with newly hot pixels, close together in time,
             are the laying of one layer; the next one begins with the next such frame.

Source: Fathizadan, dissertation (2022), eq. (4.3)-(4.9); Otsu, IEEE Trans. SMC 9(1), 1979.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats
from gcodectl.errors import InputError
from gcodectl.thermal.frames import Frames, Image

_STEPS = 4.0
"""Levels a degC that temperatures are rounded to before the threshold is sought."""
GAP = 20.0
"""s, or three frames where those are further apart; what is hidden for less is not laid anew, and a pause in laying
that is shorter does not end a layer."""
FEWEST = 4
"""Newly hot pixels that a frame of laying has at the least."""


@dataclasses.dataclass(frozen=True)
class Laying:
    """Which frames belong to a layer: laid from frame `first` to `last`, and seen until before `until`."""

    first: int
    last: int
    until: int


def otsu(values: NDArray[np.float32]) -> float:
    """Return Otsu's threshold of temperatures, degC."""
    import cv2

    low = float(values.min())
    levels = np.clip(np.round((values.ravel() - low) * _STEPS), 0, 65535).astype(np.uint16)
    level, _ = cv2.threshold(levels[None, :], 0, 65535, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    return low + (float(level) + 0.5) / _STEPS


def fresh_threshold(image: Image, warm: float) -> float:
    """Return the reading above which a pixel is of the fresh layer; `warm`: what older layers may read at the most."""
    threshold = otsu(image)
    return threshold if threshold > warm else max(warm, otsu(image[image > threshold]))


def bounding_box(mask: Bools) -> Floats:
    """Return the first and the last column and row that have a pixel of the mask: [[left, top], [right, bottom]]."""
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    return np.array([[columns[0], rows[0]], [columns[-1], rows[-1]]], dtype=np.float64)


def layings(frames: Frames, hot: float) -> list[Laying]:
    """Return the layers that a recording shows being laid, in order; `hot`: the reading from which a pixel is fresh.

    Raises InputError where there is none.
    """
    gap = max(GAP, 3.0 * float(np.median(np.diff(frames.times)))) if len(frames) > 1 else GAP
    counts, warmest = _newly_hot(frames, hot, gap)
    busy = np.flatnonzero(counts >= FEWEST)
    if not len(busy):
        raise InputError(
            f"no frame from {frames.names[0]} to {frames.names[-1]} shows a road being laid: the hottest pixel reads "
            f"{warmest:.0f} degC, a fresh one would read {hot:.0f}; check the scale of the frames, the deposition "
            "temperature and the emissivity"
        )
    cuts = np.flatnonzero(np.diff(frames.times[busy]) > gap)
    firsts = busy[np.concatenate([[0], cuts + 1])]
    lasts = busy[np.concatenate([cuts, [len(busy) - 1]])]
    untils = np.append(firsts[1:], len(frames))
    return [Laying(int(a), int(b), int(c)) for a, b, c in zip(firsts, lasts, untils, strict=True)]


def hottest(frames: Frames, laying: Laying, after: float = GAP) -> Image:
    """Return the highest reading of every pixel while a layer was laid and shortly after: the head leaves no mark."""
    image = frames[laying.first].copy()
    for k in range(laying.first + 1, laying.until):
        if frames.times[k] > frames.times[laying.last] + after:
            break
        np.maximum(image, frames[k], out=image)
    return image


def _newly_hot(frames: Frames, hot: float, gap: float) -> tuple[Floats, float]:
    """Return how many pixels of each frame are newly hot, and the hottest reading of all."""
    counts, warmest = np.zeros(len(frames)), -np.inf
    when: Floats | None = None
    for k in range(len(frames)):
        image = frames[k]
        if when is None:
            when = np.full(image.size, -np.inf)
        warmest = max(warmest, float(image.max()))
        now = np.flatnonzero(image.ravel() > hot)
        counts[k] = np.count_nonzero(frames.times[k] - when[now] > gap)
        when[now] = frames.times[k]
    return counts, warmest
