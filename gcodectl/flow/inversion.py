"""Inversion: which plunger rate makes a flow model give the flow that the roads ask for, within the plunger's limits.

    flow wanted --> dead time off, jumps made ramps --> course (backwards) --> pursuit (forwards) --> u
                                                        flow.course            flow.pursuit

A dead time is a shift: what is asked of the nozzle then is asked of the plunger now. What is asked is smoothed over the
time that the plunger needs to change its rate. A drive that swings (a speed loop) is told w + 2 z T w' + T^2 w'' for
the smooth rate w that it should reach.

BLOCK samples are decided at a time, `horizon` more looked at, always at multiples of BLOCK since a passage began: so
any chunking gives the same signal.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gcodectl.columns import Floats
from gcodectl.flow.course import LEAST, value_kernel
from gcodectl.flow.flow_model import DAMPING, SWING, FlowModel, K, loss_kernel, stored_kernel
from gcodectl.flow.pursuit import BELOW, advance_kernel, follow_kernel

LEVELS = 128
BLOCK = 512
SLOW_DRIVE = 0.4
"""Share of its cap that is asked of a drive that swings: the rest is for overcoming the swing."""


@dataclasses.dataclass(frozen=True)
class Inversion:
    """A flow model behind a plunger, ready to be inverted; mm^3/s, mm^3/s^2, s."""

    model: FlowModel
    max_flow: float
    max_flow_slew: float
    dt: float = 0.01

    @cached_property
    def cap(self) -> float:
        """The most that is asked of the plunger, mm^3/s."""
        finite = min(self.max_flow, 50.0 * self.model.steady_rate(self.model.flow))
        return finite * (SLOW_DRIVE if self.model.swing > 0 else 1.0)

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
        return math.ceil(min(rise + fall + 1.0, 10.0) / self.dt)

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
        """Return the seconds that filling from the pre-charge to `flow` (mm^3/s) and emptying take at the cap."""
        p = self.model.parameters
        stored = np.linspace(self.rest, float(stored_kernel(max(flow, LEAST * self.model.flow), p)), points)
        lost = np.array([loss_kernel(one, p) for one in stored])
        cap = self.cap
        up, down = p[K] * cap - lost, p[K] * min(cap, self.model.pull) + lost
        least = 0.02 * p[K] * cap
        return float(np.trapezoid(1 / np.maximum(up, least), stored)), float(
            np.trapezoid(1 / np.maximum(down, least), stored)
        )

    @cached_property
    def reach(self) -> int:
        """Samples on either side that `ask` looks at: a plunger that cannot jump cannot follow a flow that does."""
        span = min(math.sqrt(self.model.store / self.slew), self.cap / self.slew)
        return round(span / self.dt)

    def ask(self, wanted: Floats) -> Floats:
        """Return what is asked of the plunger now for the flow wanted[n]: dead time taken off, jumps made ramps.

        Its first sample is number `reach` of `wanted`; it is shorter by twice that and by the dead time.
        """
        weights = np.concatenate([np.arange(1, self.reach + 2), np.arange(self.reach, 0, -1)]).astype(np.float64)
        smooth = np.convolve(wanted, weights / weights.sum(), mode="valid")
        whole = int(self.delay)
        part = self.delay - whole
        n = len(smooth) - whole - 1
        return np.asarray((1.0 - part) * smooth[whole : whole + n] + part * smooth[whole + 1 : whole + 1 + n])

    def along(self, wanted: Floats) -> Floats:
        """Return the rates u[n] for the flow wanted[n] of a whole part, from rest, mm^3/s."""
        after = self.horizon + int(self.delay) + 2 + BLOCK + self.reach
        asked = self.ask(np.concatenate([np.zeros(self.reach), wanted, np.zeros(after)]))
        state, last = self.model.at_rest, 0.0
        parts: list[Floats] = []
        for k in range(0, len(wanted), BLOCK):
            n = min(BLOCK, len(wanted) - k)
            u, last = self.solve(asked[k : k + n + self.horizon], n, state, last)
            parts.append(u)
        return np.concatenate(parts)

    def solve(self, wanted: Floats, decided: int, state: Floats, last: float) -> tuple[Floats, float]:
        """Return the first `decided` rates for the flow wanted[n] (dead time taken off), and the last rate told.

        `state` is advanced in place.
        """
        p = self.model.parameters
        most = float(stored_kernel(1.6 * max(float(wanted.max(initial=0.0)), 0.05 * self.model.flow), p))
        value = np.empty((len(wanted) + 1, LEVELS))
        value_kernel(wanted, self.dt, p, self.cap, self.rest, most, value)
        if self.model.swing > 0:
            return self._against_swing(wanted, decided, state, last, value, most)
        u = np.empty(decided)
        last = follow_kernel(wanted, self.dt, p, self.cap, self.slew, self.rest, most, value, state, last, u)
        return u, last

    def _against_swing(
        self, wanted: Floats, decided: int, state: Floats, last: float, value: Floats, most: float
    ) -> tuple[Floats, float]:
        """Return what to tell a drive that swings: u = w + 2 z T w' + T^2 w'', for the rate w that it should reach."""
        stiff = self.model.parameters
        swing, damping = float(stiff[SWING]), float(stiff[DAMPING])
        stiff[SWING] = 0.0
        reach = round(3 * swing / self.dt)
        w = np.empty(min(decided + reach, len(wanted)))
        follow_kernel(
            wanted, self.dt, stiff, self.cap, self.slew, self.rest, most, value,
            state.copy(), float(state[2]), w,
        )  # fmt: skip
        before = state[2] + state[3] * self.dt * np.arange(-reach, 0)  # as the drive moves now
        smooth = gaussian_filter1d(np.concatenate([before, w]), 0.5 * swing / self.dt, mode="nearest")
        rate = np.gradient(smooth, self.dt)
        told = smooth + 2 * damping * swing * rate + swing**2 * np.gradient(rate, self.dt)
        u = np.clip(told[reach : reach + decided], -self.max_flow, self.max_flow)
        last = advance_kernel(state, u, self.dt, self.slew, last, self.model.parameters)
        return u, last
