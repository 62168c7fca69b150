"""Inversion: which plunger rate makes a flow model give the flow that the roads ask for, within the plunger's limits.

The stored volume S sets the flow, so the question is which course S should take. It cannot jump: at the plunger's cap U
it rises by K U - h(S) and falls by K U + h(S) a second.

      q_ref        ____________
                  |            |               a sharp road
           _______|            |_______
      S         ___________                    begun early, so that the road starts full, and drained early enough:
               /           \\                   how early is a matter of price: flow that misses a road is a gap in it,
       yield _/             \\_                 flow beside it is a thread in a travel
             pre-charged to just below the threshold: that is free, nothing flows

Prices, a sample:  on a road      MISSING (q - q_ref)^2 / (max(q_ref, F/5) F)
                   beside it      OOZE q / F,  and next to nothing for every mm^3 away from the pre-charge

The cheapest course is found by dynamic programming, backwards over a grid of S. Only four rates need be tried at each
point: both caps, the rate that holds S, and the one that makes the flow right at once; what lies between never wins
(the cost is convex about the goal). Then the course is followed forward with the whole model (backlash, slew, the
drive's swing), which chooses each sample's rate by the prices it leads to. A dead time is a shift: what is asked of the
nozzle then is asked of the plunger now.

BLOCK samples are decided at a time, `horizon` more looked at, always at multiples of BLOCK since a passage began: so
any chunking gives the same signal.

Slew: what is asked is smoothed over the time that the plunger needs to change its rate. And a plunger told to go from
u0 to u1 gets there at `slew`, so that in its first sample it moves less than u1 dt; the rate told is the one that moves
the volume wanted; and each choice is weighed by where the store will be once the plunger has slowed down again.

Source: Bellman's principle; the volume balance is `flow.flow_model`'s. No part of it knows more of the extruder than
the model that was fitted to its trials.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gcodectl.columns import Floats
from gcodectl.flow.flow_model import (
    DAMPING,
    GAP,
    LEAK,
    PLACE,
    PRESSURE,
    PULL,
    STORE,
    STORED,
    SWING,
    THRESHOLD,
    F,
    FlowModel,
    K,
    drive_kernel,
    flow_kernel,
    loss_kernel,
    slope_kernel,
    store_kernel,
    stored_kernel,
)
from gcodectl.jit import jit

MISSING, OOZE, TIDY = 10.0, 1.0, 1e-4
WORTH = 2e-3
"""A price must be lower by this to lead away from the goal: the grid's own error is not to be followed."""
LEVELS = 128
CHOICES = 19
"""Rates, from one limit to the other, that are weighed when the course is followed."""
BLOCK = 512
BELOW = 0.02
"""The pre-charge lies below the threshold by this share of the volume stored at nominal flow."""
LEAST = 1e-9
"""A flow below this share of the nominal one is none."""
SLOW_DRIVE = 0.4
"""Share of its cap that is asked of a drive that swings: the rest is for overcoming the swing."""


@jit
def price_kernel(q: float, stored: float, wanted: float, rest: float, p: Floats) -> float:
    """Price of a sample with flow q at `stored` mm^3 where `wanted` mm^3/s is asked for."""
    if wanted > LEAST * p[F]:
        return float(MISSING * (q - wanted) ** 2 / (max(wanted, 0.2 * p[F]) * p[F]))
    return float(OOZE * q / p[F] + TIDY * abs(stored - rest) / p[STORE])


@jit
def goal_kernel(wanted: float, rest: float, p: Floats) -> float:
    """What should be stored for the flow wanted: the pre-charge where none is."""
    return stored_kernel(wanted, p) if wanted > LEAST * p[F] else rest


@jit
def ahead_kernel(stored: float, rate: float, dt: float, p: Floats) -> float:
    """What is stored one sample later if `rate` reaches the store (one linearly implicit step)."""
    slope = slope_kernel(stored, p) + p[LEAK] if p[PRESSURE] == 0.0 else 0.0
    return float(stored + dt * (p[K] * rate - loss_kernel(stored, p)) / (1.0 + 0.5 * dt * slope))


@jit
def rate_kernel(stored: float, goal: float, dt: float, p: Floats) -> float:
    """The rate that makes `stored` the goal one sample later: ahead_kernel inverted."""
    slope = slope_kernel(stored, p) + p[LEAK] if p[PRESSURE] == 0.0 else 0.0
    return float(((goal - stored) / dt * (1.0 + 0.5 * dt * slope) + loss_kernel(stored, p)) / p[K])


@jit
def between_kernel(row: Floats, stored: float, low: float, step: float) -> float:
    """Interpolate a row over the grid of stored volumes; constant beyond its ends."""
    place = (stored - low) / step
    if place <= 0.0:
        return float(row[0])
    if place >= len(row) - 1:
        return float(row[-1])
    i = int(place)
    return float(row[i] + (place - i) * (row[i + 1] - row[i]))


@jit
def value_kernel(wanted: Floats, dt: float, p: Floats, cap: float, low: float, high: float, value: Floats) -> None:
    """Fill value[n + 1, LEVELS]: the least price of all samples from k on, by what is stored when k begins."""
    levels = value.shape[1]
    step = (high - low) / (levels - 1)
    least = min(cap, p[PULL])
    top, bottom, flow = np.empty(levels), np.empty(levels), np.empty(levels)
    for i in range(levels):
        stored = low + i * step
        top[i] = ahead_kernel(stored, cap, dt, p)
        bottom[i] = max(low, ahead_kernel(stored, -least, dt, p))
        flow[i] = flow_kernel(stored, p)
    after = np.empty(levels)
    for i in range(levels):  # a store that is left charged will ooze until it is at its threshold
        value[len(wanted), i] = OOZE * max(0.0, low + i * step - p[THRESHOLD]) / p[F] / dt
    for k in range(len(wanted) - 1, -1, -1):
        goal = goal_kernel(wanted[k], low, p)
        for i in range(levels):
            after[i] = value[k + 1, i] + price_kernel(flow[i], low + i * step, wanted[k], low, p)
        for i in range(levels):
            stored = low + i * step
            best = min(between_kernel(after, top[i], low, step), between_kernel(after, bottom[i], low, step))
            best = min(best, between_kernel(after, min(max(goal, bottom[i]), top[i]), low, step))
            value[k, i] = min(best, between_kernel(after, min(max(stored, bottom[i]), top[i]), low, step))


@jit
def slewed_kernel(told: float, last: float, most: float) -> float:
    """Mean rate of a sample in which the plunger goes from `last` to `told`, by at most `most` a sample."""
    change = abs(told - last)
    return last + math.copysign(change - change * change / (2.0 * most), told - last)


@jit
def telling_kernel(mean: float, last: float, most: float) -> float:
    """What to tell a plunger that goes at `last` so that the sample's mean comes out: slewed_kernel inverted."""
    left = 1.0 - 2.0 * abs(mean - last) / most
    return last + math.copysign(most * (1.0 - math.sqrt(left)) if left > 0.0 else most, mean - last)


@jit
def braked_kernel(left: float, slew: float, dt: float) -> float:
    """The fastest rate (mm^3/s) that `slew` can still bring to nothing within `left` mm^3, a sample at a time."""
    return math.sqrt(2.0 * slew * left + (0.5 * slew * dt) ** 2) - 0.5 * slew * dt


@jit
def follow_kernel(
    wanted: Floats, dt: float, p: Floats, cap: float, slew: float, low: float, high: float, value: Floats,
    state: Floats, last: float, u: Floats,
) -> float:  # fmt: skip
    """Fill u with the rates told, advancing `state` and the plunger's rate `last`; returns the latter."""
    step = (high - low) / (value.shape[1] - 1)
    most = slew * dt
    for k in range(len(u)):
        stored = state[STORED]
        upper, lower = min(cap, last + most), max(-min(cap, p[PULL]), last - most)
        lower = min(lower, upper)
        top = ahead_kernel(stored, slewed_kernel(upper, last, most), dt, p)
        bottom = ahead_kernel(stored, slewed_kernel(lower, last, most), dt, p)
        goal = goal_kernel(wanted[k], low, p)
        if wanted[k] <= LEAST * p[F] and abs(stored - low) < 0.5 * BELOW * p[STORE]:
            goal = stored  # near enough: the plunger rests
        hold = loss_kernel(goal, p) / p[K]
        best, chosen = np.inf, stored
        for c in range(CHOICES + 3):
            target = bottom + (top - bottom) * (c - 3) / (CHOICES - 1.0)
            if c < 3:
                target = min(max((goal, stored, low)[c], bottom), top)
            told = telling_kernel(rate_kernel(stored, target, dt, p), last, most)
            ends = target + math.copysign(0.5 * p[K] * (told - hold) ** 2 / slew, told - hold)
            price = price_kernel(flow_kernel(target, p), target, wanted[k], low, p)
            price += between_kernel(value[k + 1], ends, low, step)
            if price < best - (WORTH if c else 0.0):
                best, chosen = price, target
        rate = rate_kernel(stored, chosen, dt, p)
        if rate < -1e-6 * p[F]:  # across the backlash first
            small = chosen >= goal and stored - goal < p[K] * p[GAP]
            rate = 0.0 if small and state[PLACE] > 0.0 else rate - state[PLACE] / dt
        elif rate > 1e-6 * p[F]:
            rate += (p[GAP] - state[PLACE]) / dt
        u[k] = telling_kernel(rate, last, most)
        if chosen <= goal:
            rises = (goal_kernel(wanted[k + 1], low, p) - goal) / dt if k + 1 < len(wanted) else 0.0
            stays = max(0.0, (loss_kernel(goal, p) + rises) / p[K])
            u[k] = min(u[k], stays + braked_kernel(max(goal - stored, 0.0) / p[K] + p[GAP] - state[PLACE], slew, dt))
        u[k] = min(max(u[k], lower), upper)
        store_kernel(state, drive_kernel(state, slewed_kernel(u[k], last, most), dt, p), dt, p)
        last = u[k]
    return last


@jit
def advance_kernel(state: Floats, u: Floats, dt: float, slew: float, last: float, p: Floats) -> float:
    """Advance `state` by rates told; returns the last of them."""
    for k in range(len(u)):
        store_kernel(state, drive_kernel(state, slewed_kernel(u[k], last, slew * dt), dt, p), dt, p)
        last = u[k]
    return last


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
