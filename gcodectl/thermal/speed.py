"""Speeds: when to begin a layer, and how fast to print each partition, so that roads land where it is warm enough.

    minimise   sum of (T at each location when the head comes by - T_best)^2 + start + end, weighted
    over       the start, and a speed for every partition
    such that  T_low <= T <= T_high everywhere, nothing is printed before what lies beneath was,
               slowest <= speed <= fastest, and the head reaches each speed inside the partition (`graph.py`)

(c) instantaneous speeds: an acceleration of inf. (d) with acceleration: the head's own. Both are searched by A*
(`shortest.py`) on a coarse lattice over all that is possible, refined (`refine.py`) and polished in exact times
(`polish.py`). Where no plan keeps the band, the smallest widening that admits one is found (`nearest.py`), and the best
plan inside it.

(c) bounds (d) from below only nearly: a ramp changes its speed inside a partition, which (c) does not, and may gain by
it. The bound that is certified is `relaxation.py`'s.

Source: Fathizadan, dissertation (Arizona State University, 2022), eq. (4.17)-(4.37), sections 4.3.2, 4.3.3.
"""

from __future__ import annotations

import dataclasses
import enum
import math

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.errors import InputError, UsageError
from gcodectl.thermal.nearest import departures, smallest_widening
from gcodectl.thermal.partitions import Partitions
from gcodectl.thermal.polish import polish
from gcodectl.thermal.problem import Problem, Weights, cost_at, drive, pose, windows
from gcodectl.thermal.refine import Found, refine
from gcodectl.thermal.shortest import shortest
from gcodectl.thermal.surface import Band, Head, Surface

TOLERANCE = 0.01
"""degC; departures below it are rounding."""
WEIGHTS = Weights()


class Ruled(enum.IntEnum):
    """What kept a partition's speed from being another."""

    HEAT = 0
    """The temperatures it meets: neither limit of the head is touched."""
    SLOWEST = 1
    FASTEST = 2
    REACH = 3
    """The head could not change its speed by more inside the partition."""


@dataclasses.dataclass(frozen=True)
class SpeedsPlan:
    """When a layer begins, how fast it is printed, and what the head meets."""

    start: float
    """s, on the surface's clock."""
    speeds: Floats
    """N, one a partition, length/s."""
    borders: Floats
    """N + 1: when the head comes to each partition, and to the end; s."""
    times: Floats
    """M: when the head comes by each location, s."""
    temperatures: Floats
    """M: what it is then, degC."""
    outside: Floats
    """M: by how much it is outside the band (with its margin), degC; 0: inside."""
    ruled: Ints
    """N: `Ruled`, what kept a speed from being another."""
    cost: float
    widened: float
    """By how much the band had to be widened for there to be a plan, degC; 0: it is kept."""

    @property
    def end(self) -> float:
        """When the layer is done, s."""
        return float(self.borders[-1])

    def complaint(self) -> str:
        """Return what is wrong with the band, in a sentence; empty if it is kept."""
        rows = np.flatnonzero(self.outside > TOLERANCE)
        if self.widened <= TOLERANCE or not len(rows):
            return ""
        worst = rows[np.argsort(-self.outside[rows], kind="stable")[:5]]
        named = ", ".join(f"{row} ({self.temperatures[row]:.1f} degC, {self.outside[row]:.1f} out)" for row in worst)
        more = f" and {len(rows) - len(worst)} more" if len(rows) > len(worst) else ""
        return (
            f"no plan keeps the band: location {named}{more}; the nearest needs it {self.widened:.1f} degC wider on "
            f"either side, begins at {self.start:.1f} s and ends at {self.end:.1f} s"
        )


def plan_speeds(
    surface: Surface, partitions: Partitions, head: Head, band: Band, weights: Weights = WEIGHTS, *,
    entry: float | None = None, earliest: float = -math.inf, change: float = math.inf, margin: Floats | float = 0.0,
) -> SpeedsPlan:  # fmt: skip
    """Return the best plan; where the band cannot be kept, the best in the band widened as little as can be.

    `partitions`: `partitions.partition(surface, head, band)`, or made by the caller, each with its own limits and with
    pauses (travels) before it. `head.accel` inf: instantaneous speeds. `entry`: speed before the first partition; None:
    it may begin at any. `earliest`: s, on the surface's clock, before which the layer cannot begin. `change`: most that
    a partition's speed may differ from the one before, as a share of it. `margin`: degC, one or one a location, by
    which the band is narrowed on either side (`cooling.margin`: chance constraints). Raises UsageError for parts that
    do not fit, InputError where not even a widened band has a plan.
    """
    if change < 0.0 or not (math.isfinite(earliest) or earliest == -math.inf):
        raise UsageError("a plan needs a change of at least 0, and an earliest time that is a number")
    problem = pose(surface, partitions, head, band, weights, entry, change, margin)
    low = np.broadcast_to(band.low - band.best + np.asarray(margin, dtype=np.float64), len(surface)).copy()
    high = np.broadcast_to(band.high - band.best - np.asarray(margin, dtype=np.float64), len(surface)).copy()
    found = _cheapest(problem, earliest, low, high)
    if found is not None:
        return _plan(problem, found, surface, band, low, high, 0.0)
    nearest = smallest_widening(problem, earliest, low, high)
    if nearest is None:
        raise InputError("no speeds take the head along the path: do the partitions' limits and the acceleration fit?")
    widened = nearest[0] + TOLERANCE
    opens, shuts = windows(surface, band, np.asarray(margin) - widened)
    problem = dataclasses.replace(problem, opens=opens, shuts=shuts)
    found = _cheapest(problem, earliest, low - widened, high + widened)
    found = found or nearest[1]
    least = float(departures(problem, found.times, low, high).max())
    return _plan(problem, found, surface, band, low, high, least)


def _cheapest(problem: Problem, earliest: float, low: Floats, high: Floats) -> Found | None:
    """The cheapest plan inside the bounds, or None."""
    if not (problem.opens <= problem.shuts).all():
        return None

    def measure(posed: Problem, border: Floats, times: Floats) -> float:
        return cost_at(posed, border, times)

    found = refine(problem, earliest, shortest, measure)
    if found is None:
        return None
    step = 1e-3 * float(found.border[-1] - found.border[0])
    start, speeds = polish(problem, earliest, found.start, found.speeds, step)
    border, times = drive(problem, start, speeds)
    if float(departures(problem, times, low, high).max()) > TOLERANCE or float((problem.t0 - times).max()) > 1e-3:
        return None
    return Found(cost_at(problem, border, times), start, speeds, border, times)


def _plan(
    problem: Problem, found: Found, surface: Surface, band: Band, low: Floats, high: Floats, widened: float
) -> SpeedsPlan:
    """A plan, told."""
    temperatures = surface.at(found.times, band.ambient)
    before = np.append(found.speeds[0] if math.isnan(problem.entry) else problem.entry, found.speeds[:-1])
    free = problem.free
    ramp = np.abs(found.speeds**2 - before**2) / (2.0 * problem.accel)
    jump = np.abs(found.speeds - before)
    reach = ~free & ((ramp > 0.99 * problem.length) | (jump > 0.999 * problem.change * before))
    ruled = np.full(len(found.speeds), int(Ruled.HEAT), dtype=np.int64)
    ruled[reach] = Ruled.REACH
    ruled[found.speeds < problem.slowest * 1.001] = Ruled.SLOWEST
    ruled[found.speeds > problem.fastest * 0.999] = Ruled.FASTEST
    return SpeedsPlan(
        start=found.start, speeds=found.speeds, borders=found.border, times=found.times, temperatures=temperatures,
        outside=departures(problem, found.times, low, high), ruled=ruled,
        cost=cost_at(problem, found.border, found.times), widened=widened,
    )  # fmt: skip
