r"""Slewing: a course that a plunger which cannot change its rate at once can go, as near to the one planned as may be.

    rate planned  ____            late: followed from the front   early: from the back    their mean
                      |___            ____                          __                     ___
                                          \___                        \______                 \__

Following late and following early err by the same volume with opposite signs at a step; so on the way of their mean as
much has gone in before the step as is missing after it, and once all is steady the store is where it was planned to be.
Where nothing steps, nothing changes.

Source: `flow.limits`, which keeps a whole signal's slew in this way.
"""

from __future__ import annotations

import math

from gcodectl.columns import Floats
from gcodectl.flow.course import COURSE, DT, FLOW, GOAL, LATE, LEAST, PLAN, SLEW, read_kernel
from gcodectl.flow.flow_model import LAG, LEAK, POWER, PRESSURE, THRESHOLD, F, K
from gcodectl.jit import jit_lean

STEADY = 0.005
"""Share of what a sample can change of the rate: a plan that is met as well as this steps no more."""


@jit_lean
def slewed_kernel(told: float, last: float, most: float) -> float:
    """Mean rate of a sample in which the plunger goes from `last` to `told`, by at most `most` a sample."""
    change = abs(told - last)
    return last + math.copysign(change - change * change / (2.0 * most), told - last)


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
def plan_kernel(wanted: Floats, at: int, n: int, p: Floats, table: Floats, work: Floats) -> bool:
    """Fill row PLAN with the rates that follow the course; returns whether the slew does not allow all of them."""
    most, steps = p[SLEW] * p[DT], False
    plan = 0.0
    for k in range(n):
        stored, flow = work[COURSE, k], 0.0
        if k == 0 or stored != work[GOAL, k]:
            flow = max(read_kernel(stored, FLOW, p, table), 0.0)
        elif wanted[at + k - 1] > LEAST * p[F]:
            flow = wanted[at + k - 1]
        rises = (work[COURSE, k + 1] - stored) / p[DT]
        rate = (rises * easing_kernel(stored, flow, p) + leaving_kernel(stored, flow, p)) / p[K]
        steps |= k > 0 and abs(rate - plan) > 0.5 * most
        plan = work[PLAN, k] = rate
    return steps


@jit_lean
def slew_course_kernel(wanted: Floats, at: int, n: int, last: float, p: Floats, table: Floats, work: Floats) -> None:
    """Change the row COURSE of n samples to one that the slew allows, for a plunger that goes at `last` now."""
    if not plan_kernel(wanted, at, n, p, table, work):
        return
    most, late, ahead = 2.0 * p[SLEW] * p[DT], last, 0.0  # each takes one half of a step
    for k in range(n):
        told = min(max(work[PLAN, k], late - most), late + most)
        work[LATE, k], late = slewed_kernel(told, late, most), told
    early = work[PLAN, n - 1]
    for k in range(n - 1, -1, -1):
        told = min(max(work[PLAN, k], early - most), early + most)
        work[LATE, k], early = 0.5 * (work[LATE, k] + slewed_kernel(told, early, most)) - work[PLAN, k], told
    for k in range(n):
        ahead = ahead + work[LATE, k] * p[K] * p[DT] if abs(work[LATE, k]) > STEADY * most else 0.0
        work[COURSE, k + 1] += ahead
