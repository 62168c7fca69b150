"""Pursuit: follow the cheapest course forward, with all that the model knows (backlash, slew, the drive's swing).

Each sample's rate is chosen by the prices it leads to. A plunger told to go from u0 to u1 gets there at `slew`, so that
in its first sample it moves less than u1 dt; the rate told is the one that moves the volume wanted; and each choice is
weighed by where the store will be once the plunger has slowed down again.

    u   ____|--------        told: u1         moved, the shaded part:   ___/###|####
            last -> u1                                                    /####|####

Source: the braking parabola of a limited slew; no more of the extruder is known than the fitted model.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.course import LEAST, ahead_kernel, between_kernel, goal_kernel, price_kernel, rate_kernel
from gcodectl.flow.flow_model import (
    GAP,
    PLACE,
    PULL,
    STORE,
    STORED,
    F,
    K,
    drive_kernel,
    flow_kernel,
    loss_kernel,
    store_kernel,
)
from gcodectl.jit import jit

WORTH = 2e-3
"""A price must be lower by this to lead away from the goal: the grid's own error is not to be followed."""
CHOICES = 19
"""Rates, from one limit to the other, that are weighed when the course is followed."""
BELOW = 0.02
"""The pre-charge lies below the threshold by this share of the volume stored at nominal flow."""


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
