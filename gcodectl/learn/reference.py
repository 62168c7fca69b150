"""The training routine: a pulse of flow with a momentary pause of the gantry in it.

    q_ref          ____________      ____________
                  /            \\    /            \\
      ___________/              \\__/              \\____________
      No-Flow    Start  Steady   Corner   Steady   Stop   No-Flow
                 ^               ^  ^              ^
                 start           corner            stop

A corner is where the gantry slows: the routine goes straight on instead of turning, so that a camera can measure it,
brakes to a stop, waits a moment and goes on; the flow wanted is the bead times the speed, at every instant.
A slow material needs longer stretches, or one task's signal would run into the next one's.

`with_levels` adds roads at other flows, after pauses of other lengths, for what a single pulse cannot show: how the lag
depends on the flow, and what a barrel still holds when the next road begins.

Source: Hoelzle et al., "Iterative Learning Control Using a Basis Signal Library", section III.A and Fig. 3.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import UsageError


@dataclasses.dataclass(frozen=True)
class Routine:
    """One training routine on a grid of dt seconds: what the gantry does and what flow it asks for."""

    dt: float
    flow: float
    """Nominal flow rate, mm^3/s."""
    speed: float
    """Nominal gantry speed, mm/s."""
    accel: float
    """mm/s^2"""
    start: float
    """When the gantry begins to move and the road begins, s."""
    corner: tuple[float, float]
    """When the gantry begins to brake for the corner, and when it has its speed again, s."""
    stop: float
    """When the gantry comes to rest and the road ends, s."""
    duration: float
    """s"""
    more: tuple[tuple[float, float, float], ...] = ()
    """Further roads without a corner: when each begins and ends, s, and its speed as a share of the nominal one."""

    @property
    def t(self) -> Floats:
        """Sample times, s: each sample's beginning."""
        return np.asarray(np.arange(round(self.duration / self.dt)) * self.dt, dtype=np.float64)

    @property
    def v(self) -> Floats:
        """Gantry speed, mm/s, the mean over each sample: how far it goes in one, over dt."""
        ends: Floats = np.arange(len(self.t) + 1, dtype=np.float64) * self.dt
        ramp = self.speed / self.accel
        brake, again = self.corner
        gone = np.zeros(len(ends))
        for sign, begin in ((1, self.start), (-1, brake), (1, again - ramp), (-1, self.stop - ramp)):
            since = np.clip(ends - begin, 0, None)
            gone += sign * np.where(since < ramp, since**2 / (2 * ramp), since - ramp / 2)
        for begin, end, level in self.more:
            ramp = level * self.speed / self.accel
            for sign, at in ((1, begin), (-1, end - ramp)):
                since = np.clip(ends - at, 0, None)
                gone += sign * level * np.where(since < ramp, since**2 / (2 * ramp), since - ramp / 2)
        return np.asarray(self.speed * np.diff(gone) / self.dt, dtype=np.float64)

    @property
    def first(self) -> Routine:
        """The routine without the further roads: as the paper has it."""
        if not self.more:
            return self
        return dataclasses.replace(self, duration=self.more[0][0], more=())

    @property
    def roads(self) -> tuple[tuple[float, float, float], ...]:
        """When each road begins and ends, s, and its speed as a share of the nominal one."""
        return ((self.start, self.stop, 1.0), *self.more)

    @property
    def q_ref(self) -> Floats:
        """The flow wanted, mm^3/s, the mean over each sample."""
        return self.v * (self.flow / self.speed)

    @property
    def dip(self) -> float:
        """Seconds of nominal flow that the corner leaves out."""
        brake, again = self.corner
        return again - brake - self.speed / self.accel

    @property
    def corner_middle(self) -> float:
        """The middle of the corner's dip, s."""
        return (self.corner[0] + self.corner[1]) / 2


def training_routine(
    flow: float,
    *,
    lag: float = 3.0,
    speed: float = 10.0,
    accel: float = 500.0,
    pause: float = 0.2,
    dt: float = 0.01,
    lengths: tuple[float, float, float, float] | None = None,
) -> Routine:
    """Lay out the routine for a nominal flow (mm^3/s) at a gantry speed (mm/s) and acceleration (mm/s^2).

    `lag` is an estimate of the extruder's, s: the four stretches (No-Flow, Steady-State twice, No-Flow) last at least
    4, 6, 6 and 4 s, and long enough for it; `lengths` (s) sets them outright. Raises UsageError where it cannot be.
    """
    for name, value in (("flow", flow), ("lag", lag), ("speed", speed), ("accel", accel), ("dt", dt)):
        if not value > 0:
            raise UsageError(f"the training routine's {name} is {value:g}; it must be positive")
    if pause < 0:
        raise UsageError(f"the training routine's pause is {pause:g} s; it cannot be negative")
    long = max(1.0, lag / 3.0)
    before, first, second, after = lengths or (4 * long, 6 * long, 6 * long, 4 * long)
    ramp = speed / accel
    if min(before, after) <= 0 or min(first, second) <= 2 * ramp:
        raise UsageError(f"the training routine's stretches are too short for ramps of {ramp:g} s")
    brake = before + first
    again = brake + 2 * ramp + pause
    stop = again + second
    return Routine(dt, flow, speed, accel, before, (brake, again), stop, stop + after)


LEVELS = ((0.5, 3.0, 0.4), (1.0, 2.0, 0.25), (0.3, 2.0, 1.0), (1.3, 2.0, 3.0))
"""Further roads: their flow as a share of the nominal one, seconds on the road, seconds of No-Flow after it."""


def with_levels(routine: Routine) -> Routine:
    """Return the routine with the roads of LEVELS after it."""
    roads: list[tuple[float, float, float]] = []
    now = routine.duration
    for level, lasts, pause in LEVELS:
        roads.append((now, now + lasts, level))
        now += lasts + pause
    return dataclasses.replace(routine, duration=now, more=tuple(roads))
