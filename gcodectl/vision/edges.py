"""Edges: where a road begins and ends across a line, to a fraction of a pixel, from its blurred profile.

    c   Ml ______ Mr              c(x) = Gl (1 - F1) + M(x) (F1 - F2) + Gr F2,   F = Phi((x - e) / sigma)
        __/      \\__              M(x) = Ml + (Mr - Ml) u - R (1 - sqrt(1 - v^2))
     Gl   e1    e2   Gr           u from 0 at e1 to 1 at e2, v = 2u - 1; width = e2 - e1

R, the rim, is what a bead's flanks are darker than its top: a half cylinder under an even sky gives back (1 + nz) / 2
of it, nz = sqrt(1 - v^2). It is a matter of lamps and material, one number for the whole strip, found where that is
wide.

Only what lies within a few sigma of an edge is fitted: a highlight on top, a shadow that fades and the next lane say
nothing. Each edge has its own levels on both sides, for a shadow falls on one side and a lamp on the other. What is
known beforehand (G near 0, M near the road's usual) leaves a wide road alone; on one that is thinner than the blur,
where only width times contrast can be seen, it decides, so that the area gives the width.

1. First guess: the run of c > 1/2 nearest the line, its holes closed; or, where all is fainter, its area.
2. Gauss-Newton for seven numbers a profile, all profiles at once; samples far off (Huber) weigh less.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.ndimage import binary_closing, gaussian_filter1d
from scipy.special import ndtr

from gcodectl.columns import Bools, Floats

FAINT = (0.06, 0.2)
"""c of the smoothed profile below which there is nothing, on a ground without grain, and at the most."""
HOLE = 0.6
"""Usual widths that a highlight may be wide."""
_ROUNDS = 14
_NEAR = 3.5
"""Sigmas from an edge that are fitted."""
_NOISE, _HUBER = 0.1, 0.15
_SHINE = 0.3
_GROUND, _LEVEL, _TILT = 0.3, 0.1, 0.1
"""Standard deviations of what is known beforehand: G, the mean of Ml and Mr, their difference."""
_RIM, _FREE_RIM = 0.02, 0.3
"""Of R, when it was found, and when it is to be."""


@dataclasses.dataclass(frozen=True)
class Edges:
    """Of every profile, [k]."""

    low: Floats
    high: Floats
    level: Floats
    """Mean of Ml and Mr."""
    rim: Floats
    """R"""
    rest: Floats
    """Rms of what the fit leaves."""
    there: Bools
    """Whether there is anything."""

    @property
    def width(self) -> Floats:
        """mm, 0 where there is nothing."""
        return np.asarray(np.where(self.there, np.maximum(self.high - self.low, 0.0), 0.0))


def runs(c: Floats, x: Floats, hole: float) -> tuple[Floats, Floats, Bools]:
    """Return where the run of c > 1/2 nearest to x = 0 begins and ends, holes under `hole` mm closed; and if any."""
    spacing = x[1] - x[0]
    size = max(1, int(hole / spacing))
    padded = np.pad(c > 0.5, ((0, 0), (size, size)))
    over = binary_closing(padded, np.ones((1, size), dtype=np.bool_))[:, size : size + len(x)]
    start = np.argmin(np.where(over, np.abs(x), np.inf), axis=1)
    places = np.arange(len(x))
    below = np.where(over, -1, places)
    before = np.maximum.accumulate(below, axis=1)
    after = np.minimum.accumulate(np.where(over, len(x), places)[:, ::-1], axis=1)[:, ::-1]
    row = np.arange(len(c))
    low, high = before[row, start] + 1, after[row, start] - 1
    return (
        x[low.clip(0, len(x) - 1)] - spacing / 2,
        x[high.clip(0, len(x) - 1)] + spacing / 2,
        np.asarray(over.any(axis=1)),
    )


def find_edges(
    c: Floats, x: Floats, sigma: float, nominal: float, level: float = 1.0, rim: float | None = None,
    faint: float = FAINT[1],
) -> Edges:  # fmt: skip
    """Return the edges of profiles, [k, m] at x[m] mm; `sigma`: the blur, mm, `nominal`: a usual width, mm.

    `level`: the road's usual M on its top; `rim`: its R (None: to be found). `faint`: what
    c must reach for a road that is thinner than the blur.
    """
    low, high, there = runs(c, x, HOLE * nominal)
    there &= (low < 0.75 * nominal) & (high > -0.75 * nominal)
    spacing = x[1] - x[0]
    smooth = gaussian_filter1d(c, sigma / spacing, axis=1)
    close = np.where(np.abs(x) < 0.6 * nominal, smooth, -np.inf)
    peak = np.argmax(close, axis=1)
    thin = ~there & (close.max(axis=1) > faint * level)
    around = np.abs(x - x[peak][:, None]) < 3.0 * sigma
    area = np.maximum(np.sum(np.where(around, c, 0.0), axis=1) * spacing / level, 0.3 * sigma)
    low = np.where(thin, x[peak] - 0.5 * area, low)
    high = np.where(thin, x[peak] + 0.5 * area, high)
    there = there | thin
    found = np.zeros((len(c), 7))
    found[:, 0], found[:, 1], found[:, 4:6], found[:, 6] = low, high, level, rim or 0.0
    rest = np.zeros(len(c))
    if there.any():
        found[there], rest[there] = _fitted(c[there], x, sigma, found[there], rim is None)
    there &= found[:, 1] > found[:, 0]
    return Edges(found[:, 0], found[:, 1], 0.5 * (found[:, 4] + found[:, 5]), found[:, 6], rest, there)


def find_blur(c: Floats, x: Floats, nominal: float, per_mm: float) -> float:
    """Return the blur of profiles, mm: with which the fit leaves least, between 0.35 and 6 px."""
    tried = np.geomspace(0.35, 6.0, 16) / per_mm
    rest = []
    for sigma in tried:
        low, high, there = runs(c, x, HOLE * nominal)
        begin = np.column_stack([low, high, np.zeros((len(c), 2)), np.ones((len(c), 2)), np.zeros(len(c))])[there]
        if len(begin) < 3:
            return float(tried[-1])
        rest.append(float(np.median(_fitted(c[there], x, sigma, begin, True, near=4.0 / per_mm)[1])))
    best = int(np.argmin(rest))
    if 0 < best < len(tried) - 1:
        a, b, c2 = rest[best - 1 : best + 2]
        lean = 0.5 * (a - c2) / max(a - 2.0 * b + c2, 1e-12)
        return float(tried[best] * (tried[1] / tried[0]) ** lean)
    return float(tried[best])


def _fitted(
    c: Floats, x: Floats, sigma: float, begin: Floats, free: bool, near: float = 0.0
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return e1, e2, Gl, Gr, Ml, Mr, R of each profile, [k, 7], and the rms that is left near the edges.

    `begin` is where it begins and, but for e, what is known beforehand; `free`: R is not.
    """
    p = begin.copy()
    near = near or _NEAR * sigma
    known = np.diag([0.0, 0.0, _GROUND**-2, _GROUND**-2, 0.0, 0.0, (_FREE_RIM if free else _RIM) ** -2])
    mean, tilt = np.array([0, 0, 0, 0, 0.5, 0.5, 0]), np.array([0, 0, 0, 0, 1.0, -1.0, 0])
    known += np.outer(mean, mean) / _LEVEL**2 + np.outer(tilt, tilt) / _TILT**2
    root = 1.0 / (sigma * np.sqrt(2.0 * np.pi))
    off, used = c, np.ones_like(c)
    for number in range(_ROUNDS + 1):
        e1, e2 = p[:, :1], p[:, 1:2]
        z1, z2 = (x - e1) / sigma, (x - e2) / sigma
        f1, f2 = ndtr(z1), ndtr(z2)
        u = np.clip((x - e1) / np.maximum(e2 - e1, 1e-9), 0.0, 1.0)
        side = 1.0 - np.sqrt(np.maximum(1.0 - (2.0 * u - 1.0) ** 2, 0.0))
        top = p[:, 4:5] + (p[:, 5:6] - p[:, 4:5]) * u - p[:, 6:7] * side
        off = c - (p[:, 2:3] * (1.0 - f1) + top * (f1 - f2) + p[:, 3:4] * f2)
        used = ((np.abs(x - e1) <= near) | (np.abs(x - e2) <= near)).astype(np.float64)
        if number == _ROUNDS:
            break
        slope = np.stack([
            -root * np.exp(-0.5 * z1**2) * (top - p[:, 2:3]), root * np.exp(-0.5 * z2**2) * (top - p[:, 3:4]),
            1.0 - f1, f2, (1.0 - u) * (f1 - f2), u * (f1 - f2), side * (f2 - f1),
        ], axis=2)  # fmt: skip
        weight = used * np.minimum(1.0, _HUBER / np.maximum(np.abs(off), 1e-9)) / _NOISE**2
        if number > 2:  # a highlight
            weight *= ~((z1 > 1.0) & (z2 < -1.0) & (np.abs(off) > _SHINE))
        normal = np.einsum("km,kmi,kmj->kij", weight, slope, slope, optimize=True) + known
        normal += np.diag([sigma**-2, sigma**-2, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6])
        right = np.einsum("km,kmi->ki", weight * off, slope) - (p - begin) @ known
        move = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
        move[:, :2] = np.clip(move[:, :2], -sigma, sigma)
        p = p + move
        swapped = p[:, 1] < p[:, 0]
        p[swapped, :2] = p[swapped, :2].mean(axis=1, keepdims=True)
    left = np.sqrt(np.sum(used * off**2, axis=1) / np.maximum(used.sum(axis=1), 1.0))
    return p, np.asarray(left)
