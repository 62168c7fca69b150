"""Pursuit: follow the course forward, with all that the model knows (backlash, slew).

Each sample's rate is the one that leads to the course's next point. A plunger told to go from u0 to u1 gets there at
`slew`, so that in its first sample it moves less than u1 dt; the rate told is the one that moves the volume wanted.

    u   ____|--------        told: u1         moved, the shaded part:   ___/###|####
            last -> u1                                                    /####|####

Towards its goal a store is never filled, nor drained, faster than the plunger can still slow down within what is left:

    stays +- sqrt(2 slew left)        stays: the rate that keeps the store on its goal as that goes on

which within the next sample it can do in any case from half of what it can change in one.

Source: the braking parabola of a limited slew; no more of the extruder is known than the fitted model.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.course import CAP, CLOSE, COURSE, DT, LEAST, PULLED, RATE, SLEW
from gcodectl.flow.flow_model import (
    GAP,
    PLACE,
    STORE,
    STORED,
    F,
    K,
    drive_kernel,
    flow_kernel,
)
from gcodectl.flow.slewing import easing_kernel, leaving_kernel, slewed_kernel
from gcodectl.jit import jit_lean

BELOW = 0.02
"""The pre-charge lies below the threshold by this share of the volume stored at nominal flow."""


@jit_lean
def telling_kernel(mean: float, last: float, most: float) -> float:
    """What to tell a plunger that goes at `last` so that the sample's mean comes out: slewed_kernel inverted."""
    if abs(mean - last) < 1e-6 * most:
        return mean  # to the last digit, so that what is steady is seen to be
    left = 1.0 - abs(mean - last) * (2.0 / most)
    return last + math.copysign(most * (1.0 - math.sqrt(left)) if left > 0.0 else most, mean - last)


@jit_lean
def braked_kernel(left: float, slew: float, dt: float) -> float:
    """The fastest rate (mm^3/s) that `slew` can still bring to nothing within `left` mm^3, a sample at a time."""
    return math.sqrt(2.0 * slew * left + (0.5 * slew * dt) ** 2) - 0.5 * slew * dt


@jit_lean
def stand_kernel(state: Floats, told: float, last: float, p: Floats) -> float:
    """Advance `state` by one sample of a rate told after `last`; returns by how much the store changed, mm^3."""
    stored = state[STORED]
    flow = flow_kernel(stored, p)
    moved = drive_kernel(state, slewed_kernel(told, last, p[SLEW] * p[DT]), p[DT], p)
    change = p[DT] * (p[K] * moved - leaving_kernel(stored, flow, p)) / easing_kernel(stored, flow, p)
    state[STORED] = stored + change
    return float(change)


@jit_lean
def across_kernel(rate: float, left: float, dt: float, small: float, p: Floats, state: Floats) -> float:
    """The rate that reaches the store at `rate`, across the backlash first; `left` mm^3 less than `small` can wait."""
    if rate < -1e-6 * p[F]:
        return 0.0 if left < small and state[PLACE] > 0.0 else rate - state[PLACE] / dt
    return rate + (p[GAP] - state[PLACE]) / dt if rate > 1e-6 * p[F] else rate


@jit_lean
def follow_kernel(
    wanted: Floats, goals: Floats, rates: Floats, n: int, p: Floats, work: Floats, state: Floats, last: float
) -> float:
    """Fill n samples of row RATE with the rates told, advancing `state`; returns the last of them.

    wanted[0], goals[0] and rates[0] belong to the first sample, work[COURSE, 1] to its end. A drive that swings is left
    out.
    """
    dt, slew, gain_k, gap, cap, pulled = p[DT], p[SLEW], p[K], p[GAP], p[CAP], p[PULLED]
    most, rests, least = slew * dt, 0.5 * BELOW * p[STORE], LEAST * p[F]
    stored, goal, flow_there = state[STORED], np.nan, 0.0
    for k in range(n):
        before, goal, target = goal, goals[k], work[COURSE, k + 1]
        rate, stays = rates[k], rates[k + 1]
        highest, lowest = max(stays, 0.0) + 0.5 * most, min(stays, 0.0) - 0.5 * most
        flow = flow_there if stored == before else np.nan
        flow_there = wanted[k] if wanted[k] > least else 0.0
        if stored == before and target == goal and gap == 0.0 and abs(rate - last) < 0.5 * most:
            told = telling_kernel(rate, last, most)
            if max(lowest, -pulled) <= told <= min(highest, cap):
                work[RATE, k] = last = told
                stored = goal
                continue
        if stored != before:
            flow = flow_kernel(stored, p)
        leaving, gain = leaving_kernel(stored, flow, p), dt / easing_kernel(stored, flow, p)
        near = goal
        if flow_there == 0.0 and abs(target - goal) < rests and abs(stored - goal) < rests:
            near = target = stored  # near enough: the plunger rests
        upper, lower = min(cap, last + most), max(-pulled, last - most)
        lower = min(lower, upper)
        top = stored + gain * (gain_k * slewed_kernel(upper, last, most) - leaving)
        bottom = stored + gain * (gain_k * slewed_kernel(lower, last, most) - leaving)
        target = min(max(target, bottom), top)
        rate = ((target - stored) / gain + leaving) / gain_k
        if gap > 0.0:
            rate = across_kernel(rate, stored - near, dt, gain_k * gap if target >= near else -np.inf, p, state)
        told = telling_kernel(rate, last, most)
        if target <= near and told > highest:
            left = max(near - stored, 0.0) / gain_k + gap - state[PLACE]
            told = min(told, max(highest, max(stays, 0.0) + braked_kernel(left, slew, dt)))
        if target >= near and told < lowest:
            left = max(stored - near, 0.0) / gain_k + state[PLACE]
            told = max(told, min(lowest, min(stays, 0.0) - braked_kernel(left, slew, dt)))
        told = min(max(told, lower), upper)
        work[RATE, k] = told
        moved = slewed_kernel(told, last, most)
        if gap > 0.0:
            place = state[PLACE] + moved * dt
            state[PLACE] = min(max(place, 0.0), gap)
            moved = (place - state[PLACE]) / dt
        stored += gain * (gain_k * moved - leaving)
        if abs(stored - goal) < CLOSE * p[STORE]:
            stored = goal
        last = told
    state[STORED] = stored
    return last
