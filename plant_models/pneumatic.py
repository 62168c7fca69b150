"""pneumatic: u sets an air pressure; the paste flows as its yield stress and power law let it.

    p_set = (P_y + P_over) u / flow      (u = flow gives q = flow, and that is all that they have in common)
    p     = p_set behind the regulator's lag tau, never below -vacuum
    q     = k (p - P_y)^(1/n), 0 below P_y

         q |          /
           |        /         no steady flow is a multiple of u: nothing below P_y / (P_y + P_over) of
           |_____.-'_ u       the nominal u, then ever steeper

A vented barrel stops without oozing; a vacuum (suck-back) draws the paste up, which is left out: q is never below 0.

Ranges, and where they come from
    tau      0.02 to 0.5 s   regulator, valve and the air above the paste, more as the barrel empties (chosen)
    n        0.3 to 0.8      as for the syringe
    P_y, P_over  20 to 600 kPa   chosen: bench supplies end at 700 kPa
    dead     0 to 0.1 s      chosen
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.jit import jit
from plant_models.delay import DeadTime
from plant_models.drift import Drift
from plant_models.plant import Plant, checked, require


@jit
def pneumatic_kernel(
    p: float, p_set: Floats, ratio: float, panels: int, P_y: float, k: float, exponent: float, q: Floats
) -> float:
    """Fill q with sample averages of k (p - P_y)^exponent (Simpson, 2 panels' points each); return the pressure after.

    `ratio` is dt / tau: p follows p_set as a first-order lag, known exactly at every point.
    """
    for i in range(len(p_set)):
        total = 0.0
        for j in range(2 * panels + 1):
            here = p_set[i] + (p - p_set[i]) * math.exp(-ratio * j / (2 * panels))
            over = max(here - P_y, 0.0)
            weight = 1.0 if j in (0, 2 * panels) else 4.0 if j % 2 else 2.0
            total += weight * over**exponent
        q[i] = k * total / (6 * panels)
        p = p_set[i] + (p - p_set[i]) * math.exp(-ratio)
    return p


class Pneumatic:
    """Pressure-driven paste; parameters hold at the nominal `flow`; gain is a factor on q, lag on tau."""

    def __init__(
        self,
        *,
        flow: float,
        tau: float = 0.15,
        n: float = 0.5,
        P_y: float = 100.0,
        P_over: float = 200.0,
        vacuum: float = 20.0,
        gain: float = 1.0,
        lag: float = 1.0,
    ):
        require("pneumatic", positive={"flow": flow, "tau": tau, "n": n, "P_over": P_over, "gain": gain, "lag": lag})
        require("pneumatic", least={"P_y": P_y, "vacuum": vacuum, "1 - n": 1.0 - n})
        self.flow, self.tau, self.P_y, self.vacuum = flow, tau * lag, P_y, vacuum
        self.per_u = (P_y + P_over) / flow
        self.k, self.exponent = gain * flow / P_over ** (1.0 / n), 1.0 / n

    def initial(self) -> Floats:
        """Return the state [p, kPa]: vented."""
        return np.zeros(1)

    def run(self, state: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state after u[n] and the flow q[n]."""
        p_set = np.maximum(self.per_u * checked(u, dt), -self.vacuum)
        q = np.empty(len(p_set))
        panels = max(2, math.ceil(4.0 * dt / self.tau))
        p = pneumatic_kernel(float(state[0]), p_set, dt / self.tau, panels, self.P_y, self.k, self.exponent, q)
        return np.array([p]), q


def pneumatic(
    *,
    flow: float,
    seed: int = 0,
    tau: float = 0.15,
    n: float = 0.5,
    P_y: float = 100.0,
    P_over: float = 200.0,
    vacuum: float = 20.0,
    dead: float = 0.05,
    drift: float = 0.0,
    drift_period: float = 600.0,
    gain: float = 1.0,
    lag: float = 1.0,
) -> Plant:
    """Return a pressure-driven syringe for a nominal `flow`, mm^3/s; `gain` is a factor on q, `lag` on tau."""
    plant: Plant = Pneumatic(flow=flow, tau=tau, n=n, P_y=P_y, P_over=P_over, vacuum=vacuum, gain=gain, lag=lag)
    if dead:
        plant = DeadTime(plant, dead)
    if drift:
        plant = Drift(plant, drift, drift_period, seed=seed)
    return plant
