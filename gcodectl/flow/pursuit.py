"""Pursuit: follow the course forward, with all that the model knows (backlash, slew).

Each sample's rate is the one that leads to the course's next point. A plunger told to go from u0 to u1 gets there at
`slew`, so that in its first sample it moves less than u1 dt; the rate told is the one that moves the volume wanted.

    u   ____|--------        told: u1         moved, the shaded part:   ___/###|####
            last -> u1                                                    /####|####

Towards its goal a store is never filled, nor drained, faster than the plunger can still slow down within what is left:

    stays +- sqrt(2 slew left)        stays: the rate that keeps the store on its goal as that goes on

Source: the braking parabola of a limited slew; no more of the extruder is known than the fitted model.
"""

from __future__ import annotations

import math

from gcodectl.columns import Floats
from gcodectl.flow.course import CAP, CLOSE, COURSE, DT, LEAST, PULLED, RATE, SLEW
from gcodectl.flow.flow_model import (
    GAP,
    LAG,
    LEAK,
    PLACE,
    POWER,
    PRESSURE,
    STORE,
    STORED,
    THRESHOLD,
    F,
    K,
    drive_kernel,
    flow_kernel,
)
from gcodectl.jit import jit_lean

BELOW = 0.02
"""The pre-charge lies below the threshold by this share of the volume stored at nominal flow."""


@jit_lean
def slewed_kernel(told: float, last: float, most: float) -> float:
    """Mean rate of a sample in which the plunger goes from `last` to `told`, by at most `most` a sample."""
    change = abs(told - last)
    return last + math.copysign(change - change * change / (2.0 * most), told - last)


@jit_lean
def telling_kernel(mean: float, last: float, most: float) -> float:
    """What to tell a plunger that goes at `last` so that the sample's mean comes out: slewed_kernel inverted."""
    left = 1.0 - 2.0 * abs(mean - last) / most
    return last + math.copysign(most * (1.0 - math.sqrt(left)) if left > 0.0 else most, mean - last)


@jit_lean
def braked_kernel(left: float, slew: float, dt: float) -> float:
    """The fastest rate (mm^3/s) that `slew` can still bring to nothing within `left` mm^3, a sample at a time."""
    return math.sqrt(2.0 * slew * left + (0.5 * slew * dt) ** 2) - 0.5 * slew * dt


@jit_lean
def leaving_kernel(stored: float, flow: float, p: Floats) -> float:
    """What leaves a store whose flow is known, mm^3/s."""
    return float(stored / p[LAG] if p[PRESSURE] > 0.0 else flow + p[LEAK] * stored)


@jit_lean
def easing_kernel(stored: float, flow: float, p: Floats) -> float:
    """What a linearly implicit step of one sample divides by: how much more leaves as the store fills."""
    if p[PRESSURE] > 0.0:
        return float(1.0 + 0.5 * p[DT] / p[LAG])
    slope = p[POWER] * flow / (stored - p[THRESHOLD]) if flow > 0.0 else 0.0
    return float(1.0 + 0.5 * p[DT] * (slope + p[LEAK]))


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
def follow_kernel(
    wanted: Floats, goals: Floats, at: int, n: int, p: Floats, work: Floats, state: Floats, last: float
) -> float:
    """Fill n samples of row RATE with the rates told, advancing `state`; returns the last of them.

    wanted[at] and goals[at] belong to the first sample, work[COURSE, 1] to its end. A drive that swings is left out.
    """
    dt, most = p[DT], p[SLEW] * p[DT]
    close, rests = CLOSE * p[STORE], 0.5 * BELOW * p[STORE]
    at_goal, flow_there = False, 0.0
    for k in range(n):
        stored, asked, goal, target = state[STORED], wanted[at + k], goals[at + k], work[COURSE, k + 1]
        flow = flow_there if at_goal else flow_kernel(stored, p)
        flow_there = asked if asked > LEAST * p[F] else 0.0
        if flow_there == 0.0 and target == goal and abs(stored - goal) < rests:
            goal = target = stored  # near enough: the plunger rests
        leaving, gain = leaving_kernel(stored, flow, p), dt / easing_kernel(stored, flow, p)
        upper, lower = min(p[CAP], last + most), max(-p[PULLED], last - most)
        lower = min(lower, upper)
        top = stored + gain * (p[K] * slewed_kernel(upper, last, most) - leaving)
        bottom = stored + gain * (p[K] * slewed_kernel(lower, last, most) - leaving)
        target = min(max(target, bottom), top)
        rate = ((target - stored) / gain + leaving) / p[K]
        if p[GAP] > 0.0 and rate < -1e-6 * p[F]:  # across the backlash first
            small = target >= goal and stored - goal < p[K] * p[GAP]
            rate = 0.0 if small and state[PLACE] > 0.0 else rate - state[PLACE] / dt
        elif p[GAP] > 0.0 and rate > 1e-6 * p[F]:
            rate += (p[GAP] - state[PLACE]) / dt
        told = telling_kernel(rate, last, most)
        rises = (goals[at + k + 1] - goal) / dt
        stays = (leaving_kernel(goal, flow_there, p) + rises) / p[K]
        if target <= goal:
            left = max(goal - stored, 0.0) / p[K] + p[GAP] - state[PLACE]
            told = min(told, max(stays, 0.0) + braked_kernel(left, p[SLEW], dt))
        if target >= goal:
            left = max(stored - goal, 0.0) / p[K] + state[PLACE]
            told = max(told, min(stays, 0.0) - braked_kernel(left, p[SLEW], dt))
        told = min(max(told, lower), upper)
        work[RATE, k] = told
        moved = slewed_kernel(told, last, most)
        if p[GAP] > 0.0:
            place = state[PLACE] + moved * dt
            state[PLACE] = min(max(place, 0.0), p[GAP])
            moved = (place - state[PLACE]) / dt
        state[STORED] = stored + gain * (p[K] * moved - leaving)
        at_goal = abs(state[STORED] - goals[at + k]) < close
        last = told
    return last
