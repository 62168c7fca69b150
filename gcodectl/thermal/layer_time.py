"""Layer and print time: when to lay the next layer, if the head's speed is not to be planned.

    cost |\\               /    every location wants its own time; the sum has one minimum where it is convex (before
         | \\    ___     _/     gamma), and may have others behind
         |  \\__/   \\___/
         +--|-----------|---- t
            t_low       t_high   every location inside the band: an interval, as each one's own is

(a) layer time, 3.21-3.25: t counts from when each location was laid, the same for all; T_low and T_high are kept with
    probability 1 - alpha each, so by the prediction bounds of `cooling.py`.
(b) print time, 4.13-4.16: t is when the head starts, and location i is met its way at the given speed later.

Both are one-dimensional: the roots of the derivative are bracketed on a fine grid, found by Brent's method, and
compared, with the interval's ends; so the minimum is global whether convex or not. Proposition 1 is sufficient (every
term convex); proposition 2 is published as necessary and sufficient, but takes one root gamma, and says nothing of an
interval that the second derivative's other roots lie in. Both verdicts are given; neither is needed.

Source: Fathizadan, dissertation (Arizona State University, 2022), eq. (3.21)-(3.33), (4.13)-(4.16), (4.38)-(4.42),
propositions 1 and 2, appendix A.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from gcodectl.columns import Floats
from gcodectl.errors import InputError, UsageError
from gcodectl.thermal.chance import chance_windows
from gcodectl.thermal.cooling import Cooling
from gcodectl.thermal.problem import windows
from gcodectl.thermal.surface import Band, Surface

GRID = 2000
"""Points between which a root of the derivative is looked for."""
Reach = Callable[[float], tuple[float, float]]
"""By how much the band is widened -> between which times every location is inside it."""


@dataclasses.dataclass(frozen=True)
class BestTime:
    """When to print, and what is known of it."""

    time: float
    """s."""
    cost: float
    low: float
    """s, between which times every location is inside the band."""
    high: float
    gamma: float
    """Until when the cost is convex for certain, s; inf: throughout."""
    minima: int
    """How many local minima the interval has, its ends included."""
    temperatures: Floats
    widened: float = 0.0
    """By how much the band had to be widened for there to be an interval, degC."""

    @property
    def convex(self) -> bool:
        """Whether the proposition's test says that the problem is convex."""
        return self.high <= self.gamma


def layer_time(
    cooling: Cooling, band: Band, alpha: float = 0.05, weight: float = 1.0, earliest: float = 0.0
) -> BestTime:
    """Return the best time from laying a location to laying the next layer on it, (a).

    `alpha`: probability with which a location may be below the band, and above it; `weight`: of a second, degC^2.
    Raises UsageError for an alpha that is none; an infeasible band is widened as little as can be (`widened`).
    """
    if not 0.0 < alpha < 1.0:
        raise UsageError(f"alpha is a probability between 0 and 1, not {alpha:g}")
    fresh = dataclasses.replace(cooling, t0=np.zeros(len(cooling)))
    surface = fresh.surface(np.zeros(len(cooling)))

    def reach(widened: float) -> tuple[float, float]:
        opens, shuts = chance_windows(fresh, band, alpha, widened)
        return float(max(opens.max(), earliest)), float(shuts.min())

    rest = band.ambient - surface.b0 / surface.b1
    gamma = _first_below(surface, 0.5 * (rest + band.best), rest)
    return _best(surface, band, np.zeros(len(surface)), weight, reach, gamma)


def print_time(
    surface: Surface, speed: float, band: Band, weight: float = 1.0, earliest: float = -math.inf,
    margin: Floats | float = 0.0,
) -> BestTime:  # fmt: skip
    """Return the best time to start a layer that is printed at one speed, (b); `margin` as in `speed.plan_speeds`."""
    if not speed > 0.0:
        raise UsageError(f"a print speed must be above 0, not {speed:g}")
    way = (surface.s - surface.s[0]) / speed

    def reach(widened: float) -> tuple[float, float]:
        opens, shuts = windows(surface, band, np.asarray(margin) - widened)
        return float(max((opens - way).max(), earliest)), float((shuts - way).min())

    best = _best(surface, band, way, weight, reach, math.inf)
    return dataclasses.replace(best, gamma=_gamma(surface, band, way, best.low))


def _first_below(surface: Surface, level: Floats, rest: Floats) -> float:
    """The first time at which any location falls below its level, s; inf: none ever does. Proposition 1, (3.26)."""
    share = (level - rest) / np.where(surface.temp0 > rest, surface.temp0 - rest, math.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        when = np.where(share > 0.0, np.maximum(np.log(share) / surface.b1, 0.0), math.inf)
    return float(np.min(np.where(np.isnan(when), math.inf, when)))


def _cost(surface: Surface, band: Band, way: Floats, t: Floats, weight: float) -> tuple[Floats, Floats, Floats]:
    """Cost at each of the times t, and its first and second derivative."""
    rest = (band.ambient - surface.b0 / surface.b1)[:, None]
    b1 = surface.b1[:, None]
    above = (surface.temp0[:, None] - rest) * np.exp(b1 * (t[None, :] + (way - surface.t0)[:, None]))
    off = rest + above - band.best
    first = 2.0 * (off * b1 * above).sum(axis=0) + weight
    second = 2.0 * ((b1 * above) ** 2 + off * b1**2 * above).sum(axis=0)
    return (off**2).sum(axis=0) + weight * t, first, second


def _gamma(surface: Surface, band: Band, way: Floats, start: float) -> float:
    """The first root of the second derivative from `start` on, s; inf: none. Proposition 2, (4.41)."""
    far = start - 20.0 / float(surface.b1.max())
    grid = np.linspace(start, far, GRID)
    second = _cost(surface, band, way, grid, 0.0)[2]
    below = np.flatnonzero(second < 0.0)
    if not len(below):
        return math.inf
    if below[0] == 0:
        return start

    def curvature(t: float) -> float:
        return float(_cost(surface, band, way, np.array([t]), 0.0)[2][0])

    return float(brentq(curvature, grid[below[0] - 1], grid[below[0]]))


def _interval(reach: Reach) -> tuple[float, float, float]:
    """The interval in which every location is inside the band, and by how much that had to be widened for it."""
    low, high = reach(0.0)
    if low <= high:
        return low, high, 0.0
    inside, outside = 0.0, 1.0
    while outside < 1000.0:
        low, high = reach(outside)
        if low <= high and math.isfinite(low):
            break
        inside, outside = outside, 2.0 * outside
    else:
        raise InputError("no time is right for all locations, however wide the band: does every one of them cool?")
    for _ in range(30):
        middle = 0.5 * (inside + outside)
        low, high = reach(middle)
        inside, outside = (inside, middle) if low <= high else (middle, outside)
    low, high = reach(outside)
    return low, high, outside


def _best(surface: Surface, band: Band, way: Floats, weight: float, reach: Reach, gamma: float) -> BestTime:
    """The least of all local minima between the times that `reach` gives for a widening of the band."""
    low, high, widened = _interval(reach)
    last = high if math.isfinite(high) else low - 20.0 / float(surface.b1.max())
    grid = np.linspace(low, last, GRID)
    first = _cost(surface, band, way, grid, weight)[1]

    def slope(t: float) -> float:
        return float(_cost(surface, band, way, np.array([t]), weight)[1][0])

    found = [
        float(brentq(slope, grid[k], grid[k + 1])) for k in np.flatnonzero((first[:-1] < 0.0) & (first[1:] >= 0.0))
    ]
    if first[0] >= 0.0:
        found.append(low)
    if first[-1] < 0.0:
        found.append(last)
    costs = _cost(surface, band, way, np.array(found), weight)[0]
    time = found[int(costs.argmin())]
    return BestTime(
        time=time, cost=float(costs.min()), low=low, high=high, gamma=gamma, minima=len(found),
        temperatures=surface.at(time + way, band.ambient), widened=widened,
    )  # fmt: skip
