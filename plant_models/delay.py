"""DeadTime: u takes effect `dead` seconds later; nothing else happens to it.

    u  __|---|______      dead = (whole + part) samples: what acts in sample k is the average of the shifted u,
    v  _____|---|___      (1 - part) u[k - whole] + part u[k - whole - 1]; no volume is lost

A dead time is what a library of learned signals must lead by and what a plain learning law diverges on.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from plant_models.actuator import Actuator
from plant_models.plant import Plant, require


class DeadTime(Actuator):
    """Delays u by `dead` seconds; before the first sample nothing moved."""

    def __init__(self, plant: Plant, dead: float):
        super().__init__(plant)
        require("dead time", least={"dead": dead})
        self.dead = dead

    def rest(self) -> Floats:
        """Return [], nothing under way."""
        return np.zeros(0)

    def move(self, own: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state [dt, samples under way ...] and the delayed u[n]."""
        whole = math.floor(self.dead / dt + 1e-9)
        part = max(self.dead / dt - whole, 0.0)
        known = np.concatenate([_under_way(own, whole + 1, dt), u])
        delayed = (1.0 - part) * known[1 : len(u) + 1] + part * known[: len(u)]
        return np.concatenate([np.array([dt]), known[len(u) :]]), delayed


def _under_way(own: Floats, count: int, dt: float) -> Floats:
    """Return the last `count` samples of length dt, cut anew from those in `own` where dt was another."""
    if not len(own):
        return np.zeros(count)
    old_dt, samples = float(own[0]), own[1:]
    if old_dt == dt:
        return samples
    volume = np.concatenate([np.zeros(1), np.cumsum(samples) * old_dt])
    edges = (np.arange(count + 1) - count) * dt + len(samples) * old_dt
    cut: Floats = np.diff(np.interp(edges, np.arange(len(volume)) * old_dt, volume)) / dt
    return cut
