"""Segmentation: what is material in a photograph, 0 where there is ground and 1 where there is road.

    light L --> the bed from above --> ground G: a cubic in x, y of log L, fitted to what most of the window is
                                       r = L / G - 1, three colours: free of lamps and vignetting
                                       c = w r / (w m),  w = S^-1 m:   m the material's r, S the ground's spread

1. The ground is fitted to the middles of blocks, then to all that lies near it, again and again.
2. What is farthest from it, in its own spread, is material first (Otsu); then what has c > 1/2.
3. A highlight adds as much to all colours, a shadow takes a share of each, which matters beside a dark material: S has
   such spreads added, so that c looks at what neither changes, where there is any.

c is linear in light, and so is what a blur does to it: edges stay where they are, and areas are kept.
Source: Fisher's linear discriminant (1936); Otsu (1979).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats
from gcodectl.errors import InputError
from gcodectl.vision.photo import Light
from gcodectl.vision.view import View

PIXELS = 400_000
"""Of the bed from above."""
_FLOOR = 2e-3
"""Light that is taken for black."""
_SHADOW = 0.15
"""Standard deviation of a shadow's depth, for S."""
_GLOSS, _ADDED = 0.02, 0.04
"""Light that a mirrored lamp adds to all colours, and that noise and compression add to each."""
_BLOCKS = 12
_LEAST = 60
"""Pixels of material, below which there is none."""
MOST_SPREAD = 0.2
"""Standard deviation of the ground's c, above which nothing stands out."""


@dataclasses.dataclass(frozen=True)
class Above:
    """A rectangle of the bed as seen from straight above, row 0 at the lowest y."""

    low: Floats
    spacing: float
    """mm"""
    light: NDArray[np.float32]
    """[rows, columns, 3]"""
    seen: Bools

    @property
    def xy(self) -> Floats:
        """Where the pixels are, mm, [rows, columns, 2]."""
        rows, columns = self.seen.shape
        x, y = (self.low[k] + self.spacing * (np.arange(n) + 0.5) for k, n in ((0, columns), (1, rows)))
        return np.stack(np.meshgrid(x, y), axis=-1)

    def index(self, xy: Floats) -> Floats:
        """Return where points are among its pixels, column and row, [n, 2]."""
        return np.asarray((xy - self.low) / self.spacing - 0.5)


@dataclasses.dataclass(frozen=True)
class Contrast:
    """What tells material from ground."""

    low: Floats
    size: Floats
    ground: Floats
    """Coefficients of the log of its light, [10, 3]."""
    weights: Floats
    """[3]; c = weights . (L / G - 1)"""
    spread: float
    """Standard deviation of the ground's c."""

    def of(self, light: NDArray[np.float32], xy: Floats) -> Floats:
        """Return c of light, [..., 3], at points of the sheet, [..., 2]."""
        ratio = light / np.exp(_cubic((xy - self.low) / self.size) @ self.ground) - 1.0
        return np.asarray(ratio @ self.weights, dtype=np.float64)


def from_above(light: Light, view: View, low: Floats, high: Floats) -> Above:
    """Return the bed between two corners as seen from above, about PIXELS of it."""
    import cv2

    size = np.asarray(high) - low
    spacing = float(np.sqrt(size[0] * size[1] / PIXELS))
    columns, rows = (max(8, int(side / spacing)) for side in size)
    above = Above(np.asarray(low, dtype=np.float64), spacing, np.empty(0, dtype=np.float32),
                  np.zeros((rows, columns), dtype=np.bool_))  # fmt: skip
    pixels = view.pixels(above.xy)
    across = pixels[rows // 2, columns // 2] - pixels[rows // 2, columns // 2 - 1]
    coarse = max(1, int(np.hypot(*across)))
    small = cv2.blur(light, (coarse, coarse)) if coarse > 1 else light
    maps = pixels.astype(np.float32)
    seen = np.all((pixels >= 0) & (pixels <= [light.shape[1] - 1, light.shape[0] - 1]), axis=2)
    flat = cv2.remap(small, maps[:, :, 0], maps[:, :, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return dataclasses.replace(above, light=np.maximum(flat, np.float32(_FLOOR)), seen=seen)


def find_contrast(above: Above, name: str) -> tuple[Contrast, Bools]:
    """Return what tells material from ground, and where there is material; raises InputError where none stands out."""
    import cv2

    size = above.spacing * np.array(above.seen.shape[::-1])
    basis = _cubic((above.xy - above.low) / size)
    ground, near = _ground(above, basis)
    ratio = above.light / np.exp(basis @ ground) - 1.0
    near &= above.seen
    mask = _farthest(ratio, near, above.seen)
    dark = 1.0 / np.exp(np.mean(basis[near] @ ground, axis=0))
    shadow = _SHADOW if np.mean(np.median(ratio[mask], axis=0)) < 0 else 0.0
    spread = np.cov(ratio[near].T) + shadow**2 + _GLOSS**2 * np.outer(dark, dark) + _ADDED**2 * np.diag(dark**2)
    weights: Floats = np.zeros(3)
    deviation = np.inf
    for _ in range(4):
        inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
        inner = inner if inner.sum() >= _LEAST else mask
        if inner.sum() < _LEAST:
            break
        middle = np.median(ratio[inner], axis=0)
        weights = np.asarray(np.linalg.solve(spread, middle), dtype=np.float64)
        weights /= weights @ middle
        shown = ratio @ weights
        clear = shown[near & ~mask]
        deviation = 1.4826 * float(np.median(np.abs(clear - np.median(clear)))) if clear.size else np.inf
        mask = above.seen & (shown > 0.5)
    if not deviation < MOST_SPREAD or mask.sum() < _LEAST:
        raise InputError(
            "nothing stands out from the ground in it: is there a road, in another colour than what it lies on?",
            source=name,
        )
    return Contrast(above.low, size, ground, weights, deviation), mask


def _farthest(ratio: Floats, near: Bools, seen: Bools) -> Bools:
    """Return what is farthest from the ground, in the ground's own spread."""
    import cv2

    inverse = np.linalg.inv(np.cov(ratio[near].T) + 1e-6 * np.eye(3))
    far = np.sqrt(np.einsum("...i,ij,...j", ratio, inverse, ratio, optimize=True))
    levels = np.clip(255.0 * far / max(float(np.quantile(far[seen], 0.995)), 1e-9), 0, 255).astype(np.uint8)
    level, _ = cv2.threshold(levels[seen][None, :], 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    return np.asarray(seen & (levels > level))


def _ground(above: Above, basis: Floats) -> tuple[Floats, Bools]:
    """Return the coefficients of the ground's log light, [10, 3], and which pixels are near to it."""
    log = np.log(above.light.astype(np.float64))
    rows = np.array_split(np.arange(log.shape[0]), _BLOCKS)
    columns = np.array_split(np.arange(log.shape[1]), _BLOCKS)
    middles, places = [], []
    for some in rows:
        for others in columns:
            block = np.ix_(some, others)
            if above.seen[block].mean() > 0.5:
                middles.append(np.median(log[block][above.seen[block]], axis=0))
                places.append(basis[block][above.seen[block]].mean(axis=0))
    found = _robust(np.array(places), np.array(middles), 0.05)
    thin = np.zeros_like(above.seen)
    thin[::3, ::3] = above.seen[::3, ::3]
    near = above.seen
    for _ in range(6):
        off = np.abs(log - basis @ found)
        limit = 3.0 * 1.4826 * np.maximum(np.median(off[thin], axis=0), 0.005)
        near = np.all(off < limit, axis=2)
        used = thin & near
        found = np.linalg.lstsq(basis[used], log[used], rcond=None)[0]
    return np.asarray(found), np.asarray(near)


def _robust(basis: Floats, values: Floats, least: float) -> Floats:
    """Return a fit's coefficients, by least absolute deviations (reweighted squares)."""
    weights = np.ones(len(values))
    found: Floats = np.zeros((basis.shape[1], values.shape[1]))
    for _ in range(15):
        root = np.sqrt(weights)[:, None]
        found = np.asarray(np.linalg.lstsq(root * basis, root * values, rcond=None)[0])
        weights = 1.0 / np.maximum(np.linalg.norm(values - basis @ found, axis=1), least)
    return np.asarray(found)


def _cubic(at: Floats) -> Floats:
    """Return the terms of a cubic in x, y, [..., 10]."""
    x, y = 2.0 * at[..., 0] - 1.0, 2.0 * at[..., 1] - 1.0
    return np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=-1)
