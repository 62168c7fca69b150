"""Chance constraints: from when to when a location is inside the band with a probability, not just in the mean.

    T_high ---o.------------------      u: the upper bound falls through T_high: from here on P(T > T_high) <= alpha
              | u'-._   mean            l: the lower bound falls through T_low: up to here P(T < T_low) <= alpha
    T_low ----|-----l-'-o---------
              opens     shuts  (of the mean: u and l lie between them)

Source: Fathizadan, dissertation (Arizona State University, 2022), eq. (3.22)-(3.25).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.special import stdtrit

from gcodectl.columns import Bools, Floats
from gcodectl.thermal.cooling import Cooling
from gcodectl.thermal.problem import windows
from gcodectl.thermal.surface import Band

HALVINGS = 40
FOREVER = 30.0
"""Time constants after which a location is at rest."""


def chance_windows(cooling: Cooling, band: Band, alpha: float, widened: float = 0.0) -> tuple[Floats, Floats]:
    """Return from when to when each location is inside the band with probability 1 - alpha at either side; s.

    `widened`: degC by which the band is wider at either side.
    """
    surface = cooling.surface(np.zeros(len(cooling)))
    opens, shuts = windows(surface, band, -widened)
    never = np.isinf(opens) | (shuts < opens)
    begin = np.where(never, surface.t0, opens)
    end = np.where(never, surface.t0, np.where(np.isinf(shuts), begin - FOREVER / surface.b1, shuts))

    def hot(t: Floats) -> Bools:
        return np.asarray(cooling.bounds(t, band.ambient, alpha)[1] > band.high + widened)

    def warm(t: Floats) -> Bools:
        return np.asarray(cooling.bounds(t, band.ambient, alpha)[0] >= band.low - widened)

    first, last = _last_true(hot, begin, end), _last_true(warm, begin, end)
    stays = np.isinf(shuts) & warm(end)
    none = never | hot(end) | ~warm(begin)
    return np.where(none, math.inf, first), np.where(none, -math.inf, np.where(stays, math.inf, last))


def margin(cooling: Cooling, band: Band, alpha: float) -> Floats:
    """Return by how much the band is to be narrowed at either side for `alpha`, degC; for `plan_speeds`.

    The standard error changes little while a location is inside the band; the larger of its two ends is taken.
    """
    surface = cooling.surface(np.zeros(len(cooling)))
    opens, shuts = windows(surface, band)
    ends = [np.where(np.isfinite(one), one, surface.t0) for one in (opens, shuts)]
    error = np.maximum(*(cooling.predict(one, band.ambient)[1] for one in ends))
    return np.asarray(stdtrit(cooling.freedom, 1.0 - alpha) * error)


def _last_true(test: Callable[[Floats], Bools], begin: Floats, end: Floats) -> Floats:
    """When a test that holds first and then no more ceases to hold, between two times; by bisection, all at once."""
    early, late = begin.copy(), end.copy()
    for _ in range(HALVINGS):
        middle = 0.5 * (early + late)
        holds = test(middle)
        early, late = np.where(holds, middle, early), np.where(holds, late, middle)
    return np.where(test(begin), np.where(test(end), end, early), begin)
