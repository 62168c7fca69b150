"""Inversion: which plunger rate makes a flow model give the flow that the roads ask for, within the plunger's limits.

    flow wanted --> dead time off, jumps made ramps --> goals --> course --> pursuit --> u
                    flow.asking                                   flow.course  flow.pursuit

A dead time is a shift: what is asked of the nozzle then is asked of the plunger now. What is asked is smoothed over the
time that the plunger needs to change its rate. A drive that swings is told more than it should reach (`flow.swing`).
Here is what all of them need to know of a model and the plunger before it; `flow.plungers` decides, block by block.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.course import (
    CAP,
    DELAY,
    DOWN,
    DT,
    FLOW,
    HORIZON,
    LEAST,
    LOW,
    PER_DT,
    PER_K,
    PLACES,
    PULLED,
    REACH,
    REST,
    SCALE,
    SLEW,
    SMOOTH,
    TABLE,
    TOLD,
    UP,
)
from gcodectl.flow.flow_model import PARAMETERS, STORED, FlowModel
from gcodectl.flow.plungers import NODES, Plungers
from gcodectl.flow.pursuit import BELOW
from gcodectl.flow.swing import smoothing

SLOW_DRIVE = 0.4
"""Share of its cap that is asked of a drive that swings: the rest is for overcoming the swing."""
FASTEST = 8.0
"""Up to this many times the nominal flow an inversion's table goes."""
AHEAD = 0.25
"""Share of the time that the slew takes which lies ahead of the road, or behind it (`flow.slewing`)."""
LEAST_CHANGE = 0.02
"""Share of what the cap can put in that a store is taken to change by at least, however full it is."""


@dataclasses.dataclass(frozen=True)
class Inversion:
    """A flow model behind a plunger, ready to be inverted; mm^3/s, mm^3/s^2, s."""

    model: FlowModel
    max_flow: float
    max_flow_slew: float
    dt: float = 0.01
    carried: float = math.inf
    """The most that firmware takes in lines of G-code, mm^3/s."""

    @cached_property
    def able(self) -> float:
        """The most that the plunger itself can be asked for, mm^3/s."""
        finite = min(self.max_flow, 50.0 * self.model.steady_rate(self.model.flow))
        return finite * (SLOW_DRIVE if self.model.swing > 0 else 1.0)

    @cached_property
    def cap(self) -> float:
        """The most that is asked of it, mm^3/s: that, or what is carried there."""
        return min(self.able, max(self.carried, 2.0 * self.model.steady_rate(self.model.flow)))

    @cached_property
    def slew(self) -> float:
        """The most that its rate may change by, mm^3/s^2."""
        return min(self.max_flow_slew, 20.0 * self.cap / self.dt)

    @cached_property
    def rest(self) -> float:
        """What is stored between roads, mm^3: the pre-charge."""
        return self.model.threshold - BELOW * self.model.store

    @cached_property
    def horizon(self) -> int:
        """Samples to look at beyond a block: filling and emptying, and a moment."""
        rise, fall = self.transit(self.model.flow)
        return max(math.ceil(min(rise + fall + 1.0, 10.0) / self.dt), self.smooth + 1)

    @cached_property
    def weights(self) -> Floats:
        """How the rates of a drive that swings are smoothed."""
        return smoothing(self.model.swing, self.dt)

    @property
    def smooth(self) -> int:
        """Samples beyond a block that a drive which swings is told after."""
        return len(self.weights) + 1

    @property
    def delay(self) -> float:
        """Samples of dead time."""
        return self.model.delay / self.dt

    @property
    def lead(self) -> float:
        """The most that a Start begins ahead of its road, s."""
        return self.transit(self.model.flow)[0] + self.model.delay

    @property
    def tail(self) -> float:
        """The most that a Stop goes on after its road, s."""
        return self.transit(self.model.flow)[1]

    def transit(self, flow: float, points: int = 200) -> tuple[float, float]:
        """Return the seconds that filling from the pre-charge to `flow` (mm^3/s) and emptying take of a road."""
        model, cap = self.model, self.cap
        stored = np.linspace(self.rest, model.stored(max(flow, LEAST * model.flow)), points)
        lost = model.outflow(stored)[2]
        up, down = model.K * cap - lost, model.K * min(cap, model.pull) + lost
        least = LEAST_CHANGE * model.K * cap
        rise = float(np.trapezoid(1 / np.maximum(up, least), stored))
        fall = float(np.trapezoid(1 / np.maximum(down, least), stored))
        return self._slewed(rise), self._slewed(fall)

    def _slewed(self, seconds: float) -> float:
        r"""How long of a road it takes, s, what takes `seconds` at the cap: a trapezoid of the rate, or a triangle.

        u | cap  ____                   the volume, cap x seconds, takes the slew's `ramp` longer,
          |     /    \      /\          less what of that may lie beside the road
          |____/______\____/__\__
        """
        ramp = self.cap / self.slew
        most = seconds + ramp if seconds >= ramp else 2.0 * math.sqrt(seconds * ramp)
        return seconds + (1.0 - AHEAD) * (most - seconds)

    @cached_property
    def reach(self) -> int:
        """Samples on either side that are smoothed over: a plunger that cannot jump cannot follow a flow that does."""
        span = min(math.sqrt(self.model.store / self.slew), self.able / self.slew)
        return round(span / self.dt)

    @cached_property
    def table(self) -> Floats:
        """What one sample at either cap changes, and the flow, by what is stored; see `course.TABLE`."""
        model, dt = self.model, self.dt
        stored = np.linspace(min(0.0, self.rest), model.stored(FASTEST * model.flow), NODES)
        flow, slope, lost = model.outflow(stored)
        eased = 1.0 + 0.5 * dt * slope
        table = np.empty((NODES, TABLE))
        pulled = min(self.cap, model.pull)
        table[:, UP] = np.maximum(model.K * self.cap - lost, LEAST_CHANGE * model.K * self.cap) * dt / eased
        table[:, DOWN] = -np.maximum(model.K * pulled + lost, LEAST_CHANGE * model.K * pulled) * dt / eased
        table[:, FLOW] = flow
        return table

    @cached_property
    def row(self) -> Floats:
        """The row that the kernels take: the model's parameters, and the plunger's."""
        row = np.zeros(PLACES)
        row[:PARAMETERS] = self.model.parameters
        row[[DT, CAP, PULLED, SLEW]] = self.dt, self.cap, min(self.cap, self.model.pull), self.slew
        row[[TOLD, REST, LOW]] = self.max_flow, self.rest, min(0.0, self.rest)
        row[SCALE] = (NODES - 1) / (self.model.stored(FASTEST * self.model.flow) - row[LOW])
        row[[PER_DT, PER_K]] = 1.0 / self.dt, 1.0 / self.model.K  # what divides every sample
        row[[DELAY, REACH, HORIZON, SMOOTH]] = self.delay, self.reach, self.horizon, self.smooth
        return row

    def along(self, wanted: Floats) -> Floats:
        """Return the rates u[n] for the flow wanted[n] of a whole part, from rest, mm^3/s."""
        plungers = Plungers([self], 0)
        plungers.barrels[0, STORED] = self.model.at_rest[STORED]
        plungers.grow(len(wanted))
        plungers.wanted[: len(wanted)] = wanted
        plungers.decide(len(wanted) - 1, ended=True)
        return plungers.u[: len(wanted)].copy()
