"""Plunger: how fast it can move, and what its gear loses.

    asked  ____|---------|______      Plunger: |u| <= max_flow and |du/dt| <= max_flow_slew, both ways,
    moves  ____.-'-------'-.____      counted a sample: |u[k] - u[k - 1]| <= max_flow_slew dt

    drive    [ |   gap   | ]          Backlash: at each reversal the drive crosses the gap before the plunger
    plunger  [ ->|     |<- ]          follows; the volume `gap` is lost each time

Ranges: max_flow is the machine profile's; a stepper-driven syringe reaches some 2 to 10 times its printing flow, a gap
of 0.02 to 0.1 s of flow is a lead screw's without anti-backlash nut (both chosen).
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.jit import jit
from plant_models.actuator import Actuator
from plant_models.plant import Plant, require


@jit
def limit_kernel(last: float, u: Floats, max_flow: float, max_step: float, moved: Floats) -> float:
    """Fill `moved` with u, clipped to max_flow and to steps of max_step; return its last value."""
    for k in range(len(u)):
        goal = min(max(u[k], -max_flow), max_flow)
        last = min(max(goal, last - max_step), last + max_step)
        moved[k] = last
    return last


@jit
def backlash_kernel(place: float, u: Floats, dt: float, gap: float, moved: Floats) -> float:
    """Fill `moved` with what a drive that plays between 0 and `gap` (mm^3) passes on; return its place in the gap."""
    for k in range(len(u)):
        goal = place + u[k] * dt
        place = min(max(goal, 0.0), gap)
        moved[k] = (goal - place) / dt if place != goal else 0.0
    return place


class Plunger(Actuator):
    """Limits the rate to `max_flow`, mm^3/s, and its change to `max_flow_slew`, mm^3/s^2, both ways."""

    def __init__(self, plant: Plant, max_flow: float, max_flow_slew: float = math.inf):
        super().__init__(plant)
        require("plunger", least={"max_flow": max_flow, "max_flow_slew": max_flow_slew})
        self.max_flow, self.max_flow_slew = max_flow, max_flow_slew

    def rest(self) -> Floats:
        """Return [rate now]: standing still."""
        return np.zeros(1)

    def move(self, own: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state and the rates that the plunger reaches."""
        moved = np.empty_like(u)
        last = limit_kernel(float(own[0]), u, self.max_flow, self.max_flow_slew * dt, moved)
        return np.array([last]), moved


class Backlash(Actuator):
    """Loses `gap`, mm^3 of plunger travel, at each reversal; starts engaged forward."""

    def __init__(self, plant: Plant, gap: float):
        super().__init__(plant)
        require("backlash", least={"gap": gap})
        self.gap = gap

    def rest(self) -> Floats:
        """Return [place in the gap, mm^3]: at its front, engaged."""
        return np.array([self.gap])

    def move(self, own: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state and the rates that reach the plunger."""
        moved = np.empty_like(u)
        place = backlash_kernel(float(own[0]), u, dt, self.gap, moved)
        return np.array([place]), moved
