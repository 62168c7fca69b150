"""Drift: the drive delivers a little more, then a little less than it is told, over minutes.

    factor   1 + amplitude * wave(t),   wave = a sum of three sines of incommensurate periods, |wave| <= 1

Barrel slip, settling paste, a breathing supply pressure, a screw's heat: all drift too slowly for a signal of seconds
to know, and too far for an open loop to ignore. Phases come from the seed, the time is carried in the state.
Range (chosen): amplitude 0.01 to 0.05, period 200 to 1200 s.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.jit import jit
from plant_models.actuator import Actuator
from plant_models.plant import Plant, require

_SHARES = np.array([0.6, 0.25, 0.15])
_PERIODS = np.array([1.0, 1.0 / 1.618034, 1.0 / 4.236068])  # powers of the golden ratio: never in step


@jit
def drift_kernel(
    t: float, u: Floats, dt: float, heights: Floats, omegas: Floats, phases: Floats, moved: Floats
) -> float:
    """Fill `moved` with u times 1 + the sines' sum at mid-sample; return the time after it."""
    for k in range(len(u)):
        wave = 0.0
        for i in range(len(heights)):
            wave += heights[i] * math.sin(omegas[i] * (t + 0.5 * dt) + phases[i])
        moved[k] = u[k] * (1.0 + wave)
        t += dt
    return t


class Drift(Actuator):
    """Multiplies u by 1 + amplitude wave(t); the slowest sine has `period` seconds."""

    def __init__(self, plant: Plant, amplitude: float, period: float = 600.0, *, seed: int = 0):
        super().__init__(plant)
        require("drift", positive={"drift_period": period}, least={"drift": amplitude})
        self.heights = amplitude * _SHARES
        self.omegas = 2.0 * math.pi / (period * _PERIODS)
        self.phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, len(_SHARES))

    def rest(self) -> Floats:
        """Return [time, s]."""
        return np.zeros(1)

    def move(self, own: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state and the rates that are delivered."""
        moved = np.empty_like(u)
        t = drift_kernel(float(own[0]), u, dt, self.heights, self.omegas, self.phases, moved)
        return np.array([t]), moved
