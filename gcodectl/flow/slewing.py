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

from gcodectl.columns import Floats
from gcodectl.flow.course import CAP, COURSE, DT, GOAL, LATE, PER_DT, PER_K, PLAN, PULLED, SLEW, course_kernel
from gcodectl.flow.flow_model import LAG, LEAK, POWER, PRESSURE, THRESHOLD, K, flow_kernel
from gcodectl.jit import jit_lean

STEADY = 0.005
"""Share of what a sample can change of the rate: a plan that is met as well as this steps no more."""


@jit_lean
def slewed_kernel(told: float, last: float, most: float) -> float:
    """Mean rate of a sample in which the plunger goes from `last` to `told`, by at most `most` a sample."""
    change = told - last
    return told - change * abs(change) * (0.5 / most)  # a division by what no sample changes is done once


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
def needed_kernel(stored: float, flow: float, then: float, p: Floats) -> float:
    """The rate that takes a store whose flow is known to `then` within a sample."""
    eased = easing_kernel(stored, flow, p)
    return float(((then - stored) * p[PER_DT] * eased + leaving_kernel(stored, flow, p)) * p[PER_K])


@jit_lean
def plan_kernel(rates: Floats, n: int, p: Floats, work: Floats) -> None:
    """Fill row PLAN with the rates that follow the course; `rates` are those that follow the goals."""
    for k in range(n):
        stored, then = work[COURSE, k], work[COURSE, k + 1]
        work[PLAN, k] = rates[k]
        if k == 0 or stored != work[GOAL, k] or then != work[GOAL, k + 1]:
            work[PLAN, k] = needed_kernel(stored, flow_kernel(stored, p), then, p)


@jit_lean
def steps_kernel(n: int, most: float, work: Floats) -> bool:
    """Whether the rates planned change by more than `most` from sample to sample."""
    steps = False
    for k in range(1, n):
        steps |= abs(work[PLAN, k] - work[PLAN, k - 1]) > most
    return steps


@jit_lean
def both_ways_kernel(n: int, last: float, most: float, work: Floats) -> None:
    """Fill row LATE with what the mean of following late, from `last` on, and early is beside n rates planned."""
    if abs(work[PLAN, 0] - last) <= most and not steps_kernel(n, most, work):  # no sample waits for those beside it
        work[LATE, 0], work[PLAN, n] = slewed_kernel(work[PLAN, 0], last, most), work[PLAN, n - 1]
        for k in range(1, n):
            work[LATE, k] = slewed_kernel(work[PLAN, k], work[PLAN, k - 1], most)
        for k in range(n):
            told = work[PLAN, k]
            work[LATE, k] = 0.5 * (work[LATE, k] + slewed_kernel(told, work[PLAN, k + 1], most)) - told
        return
    late = last
    for k in range(n):
        told = min(max(work[PLAN, k], late - most), late + most)
        work[LATE, k], late = slewed_kernel(told, late, most), told
    early = work[PLAN, n - 1]
    for k in range(n - 1, -1, -1):
        told = min(max(work[PLAN, k], early - most), early + most)
        work[LATE, k], early = 0.5 * (work[LATE, k] + slewed_kernel(told, early, most)) - work[PLAN, k], told


@jit_lean
def slew_course_kernel(n: int, last: float, p: Floats, work: Floats) -> None:
    """Change the row COURSE of n samples to one that the slew allows, for a plunger that goes at `last` now."""
    most, ahead = 2.0 * p[SLEW] * p[DT], 0.0  # each way takes one half of a step
    both_ways_kernel(n, last, most, work)
    for k in range(n):
        if abs(work[LATE, k]) > STEADY * most:
            ahead += work[LATE, k] * p[K] * p[DT]
            work[COURSE, k + 1] += ahead
        else:
            ahead = 0.0


@jit_lean
def goals_kernel(goals: Floats, rates: Floats, p: Floats, work: Floats) -> tuple[bool, bool]:
    """Make the goals the COURSE, and the rates that follow them the PLAN: (whether a plunger can, whether it steps)."""
    pulled, cap, most = p[PULLED], p[CAP], 0.5 * p[SLEW] * p[DT]
    work[GOAL, 0] = stored = work[COURSE, 0]
    for k in range(len(goals)):
        work[GOAL, k + 1] = work[COURSE, k + 1] = goals[k]
    for k in range(len(rates)):
        work[PLAN, k] = rates[k]
    work[PLAN, 0] = needed_kernel(stored, flow_kernel(stored, p), goals[0], p)
    follows = True
    for k in range(len(rates)):
        follows &= -pulled <= work[PLAN, k] <= cap
    return follows, steps_kernel(len(rates), most, work)


@jit_lean
def lay_course_kernel(
    asked: Floats, goals: Floats, rates: Floats, decided: int, n: int, last: float, p: Floats, table: Floats,
    work: Floats, cheapest: Floats,
) -> None:  # fmt: skip
    """Fill the rows GOAL and COURSE of n samples, from what COURSE begins with; `decided` of them will be followed."""
    follows, steps = goals_kernel(goals[:n], rates[:n], p, work)
    if not follows:
        most = p[SLEW] * p[DT]
        course_kernel(asked, decided + int(2.0 * p[CAP] / most) + 1, n, p, table, work, cheapest)
        plan_kernel(rates, n, p, work)
        steps = steps_kernel(n, 0.5 * most, work)
    if steps:
        slew_course_kernel(n, last, p, work)
