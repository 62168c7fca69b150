"""Layout: where on the bed a trial is printed, as a chart recorder draws: flow over time as bead along a path.

     datum
       |     _________________________ ...
       |    |                   lane 2                   the head goes at one speed all the time, whatever flows:
       |    \\_____________________________               s = speed x t, and q = area x speed
       |                       lane 1    |
       |   ______________________________/
       |  ^ run-up            lane 0
       v /
       rest

The plunger does not know where the head is. So a trial need not stop where its routine would: what would be a blob
where the head stands becomes a place on the path, and everything that flows, ooze in pauses too, can be measured
there, with a camera or with calipers.

- The datum is a straight road at steady flow, laid first, downwards: it primes the nozzle, and its middle line is exact
  whatever the extruder does. Places are counted from it: lanes begin `gap` right of it. The head rests at its end until
  nothing flows any more, and never goes back over it. It reaches beyond the lanes at both ends, so that a photograph
  can tell them apart even where nothing lies on one of them.
- Lanes are joined by half circles, wide enough for the speed: v^2 / r is half the machine's acceleration at most.
- The speed is that of the routine, or the highest one at which the path fits on the bed; a bead may become WIDEST
  times as thick by that.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.errors import UsageError

MARGIN = 8.0
"""mm of the bed's rim, or as many nozzles, that are left free; a large bed's rim is wider."""
CHORD = math.radians(6.0)
"""Angle of a half circle that one line goes along."""
BESIDE = 3.0
"""Nozzles from the datum's middle to where the head sets off."""
SPACING = 5.0
"""Nozzles from lane to lane."""
WIDEST = 2.5
"""The bead's cross-section over the routine's own, at the most."""
SLOWER = 0.97
"""By how much the next speed is tried."""
DATUM_LAGS = 4.0
"""The datum lasts so many lags, so that its flow is steady where lanes are measured against it."""


@dataclasses.dataclass(frozen=True)
class Layout:
    """A trial's path on the bed, mm."""

    datum: Floats
    """From and to, shape (2, 2)."""
    set_off: Floats
    """Where the head sets off for the path, shape (2,)."""
    path: Floats
    """The path's corners, shape (n, 2); what is measured lies on it."""
    run_out: Floats
    """Where the head goes on to behind it, shape (m, 2)."""
    speed: float
    """mm/s, all along the path."""

    @property
    def places(self) -> Floats:
        """How far along the path each corner is, mm, shape (n,)."""
        return lengths(self.path)

    @property
    def length(self) -> float:
        """mm"""
        return float(self.places[-1])

    @property
    def datum_lasts(self) -> float:
        """Seconds that the datum takes."""
        return float(lengths(self.datum)[-1]) / self.speed

    @property
    def run_out_lasts(self) -> float:
        """Seconds that the run-out takes."""
        return float(lengths(np.concatenate([self.path[-1:], self.run_out]))[-1]) / self.speed


def lengths(path: Floats) -> Floats:
    """Return how far along a path (n, 2) each of its corners is."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])


def lay_out(machine: Machine, *, nozzle: float, duration: float, speed: float, lag: float) -> Layout:
    """Return the layout of a routine of `duration` s at `speed` mm/s; `lag` s is the extruder's, as far as is known.

    Raises UsageError where the machine's bed is too small for it.
    """
    now = min(speed, *machine.max_speed[:2])
    while now >= speed / WIDEST:
        found = _at_speed(machine, nozzle, duration, now, lag)
        if found is not None:
            return found
        now *= SLOWER
    x0, y0, x1, y1 = machine.bed
    if _at_speed(machine, nozzle, 0.0, 1e-3, 0.0) is None:
        raise UsageError(
            f"the bed of {machine.name} ({x1 - x0:g} x {y1 - y0:g} mm) has no room for lanes of a {nozzle:g} mm "
            "nozzle: use a finer nozzle, or set the profile's `bed`"
        )
    raise UsageError(
        f"the training routine is {duration * now / 1000:.1f} m long at {now:.1f} mm/s, and the bed of {machine.name} "
        f"({x1 - x0:g} x {y1 - y0:g} mm) has no room for it: ask for less flow (--flow), or set the profile's `bed`"
    )


def _at_speed(machine: Machine, nozzle: float, duration: float, speed: float, lag: float) -> Layout | None:
    """Return the layout at one speed, None where it does not fit."""
    x0, y0, x1, y1 = machine.bed
    accel = min(machine.accel, machine.travel_accel)
    margin = max(MARGIN, 2.0 * nozzle)
    spacing = max(SPACING * nozzle, 4.0 * speed**2 / accel)
    radius = spacing / 2.0
    brake = 1.5 * speed**2 / (2.0 * accel) + speed**1.5 / math.sqrt(machine.jerk) + 2.0
    beside = BESIDE * nozzle
    gap = max(beside + brake, radius + spacing, 6.0)
    left, right = x0 + margin + gap, x1 - margin - radius - 2.0 * nozzle
    lane, turn = right - left, math.pi * radius
    if lane < 4.0 * gap:
        return None
    total = duration * speed
    count = max(1, math.ceil((total + brake + turn) / (lane + turn)))
    height = (count - 1) * spacing
    datum = max(height + 2.0 * spacing, min(DATUM_LAGS * lag * speed, y1 - y0 - 2.0 * margin))
    if y0 + margin + datum > y1 - margin:
        return None
    x, foot = x0 + margin, y0 + margin
    points = _serpentine(left, right, foot + spacing, spacing, count)
    path, beyond = _cut(np.round(points, 3), total, brake)
    road = np.round([[x, foot + datum], [x, foot]], 3)
    return Layout(road, np.round([x + beside, foot + spacing], 3), path, beyond, speed)


def _serpentine(left: float, right: float, bottom: float, spacing: float, count: int) -> Floats:
    """Return the corners of `count` lanes and the half circles between them, the first lane from left to right."""
    radius = spacing / 2.0
    steps = math.ceil(math.pi / CHORD)
    angles = np.linspace(-math.pi / 2.0, math.pi / 2.0, steps + 1)
    corners = [np.array([[left, bottom]])]
    for lane in range(count):
        y, end, side = bottom + lane * spacing, (right, left)[lane % 2], (1.0, -1.0)[lane % 2]
        if lane == count - 1:
            corners.append(np.array([[end, y]]))
            break
        corners.append(np.stack([end + side * radius * np.cos(angles), y + radius + radius * np.sin(angles)], axis=1))
    return np.concatenate(corners)


def _cut(points: Floats, total: float, beyond: float) -> tuple[Floats, Floats]:
    """Cut a path behind `total` mm, and again `beyond` mm later; the second piece without its first corner."""
    places = lengths(points)
    assert places[-1] >= total + beyond, "there are lanes enough"

    def at(s: float) -> Floats:
        return np.round([[np.interp(s, places, points[:, 0]), np.interp(s, places, points[:, 1])]], 3)

    end = total + beyond
    first = np.concatenate([points[places < total - 1e-6], at(total)])
    return first, np.concatenate([points[(places > total + 1e-6) & (places < end - 1e-6)], at(end)])
