"""Drives: how a motor follows the rate it is told.

    told       ___|-------      DriveLag     1 / (tau s + 1): a stiff motor on a soft coupling
    DriveLag   ___/```----      SpeedLoop    w^2 / (s^2 + 2 zeta w s + w^2): a screw's speed controller;
    SpeedLoop  ___/^~-----                   below zeta 1 it overshoots by exp(-pi zeta / sqrt(1 - zeta^2))

Both are discretised exactly for a u held over each sample and pass on sample averages, so no volume is lost.
Ranges (chosen): tau 0.01 to 0.1 s for a stepper with belt or lead screw; SpeedLoop 0.1 to 1 s, zeta 0.4 to 1, for a
geared screw drive.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from gcodectl.columns import Floats
from gcodectl.jit import jit
from plant_models.actuator import Actuator
from plant_models.linear import first_order
from plant_models.plant import Plant, require


@jit
def second_order_kernel(w: float, a: float, u: Floats, step: Floats, dt: float, moved: Floats) -> tuple[float, float]:
    """Fill `moved` with sample averages of the speed; return it and its rate.

    `step` is 3 x 3: rows speed, its rate, travel; columns w, a, u.
    """
    for k in range(len(u)):
        moved[k] = (step[2, 0] * w + step[2, 1] * a + step[2, 2] * u[k]) / dt
        new_w = step[0, 0] * w + step[0, 1] * a + step[0, 2] * u[k]
        a = step[1, 0] * w + step[1, 1] * a + step[1, 2] * u[k]
        w = new_w
    return w, a


class DriveLag(Actuator):
    """Follows u as a first-order lag of `tau` seconds."""

    def __init__(self, plant: Plant, tau: float):
        super().__init__(plant)
        require("drive lag", least={"tau": tau})
        self.tau = tau

    def rest(self) -> Floats:
        """Return [rate now]."""
        return np.zeros(1)

    def move(self, own: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state and the rates that the motor reaches."""
        x, moved = first_order(float(own[0]), u, dt, 1.0, self.tau)
        return np.array([x]), moved


class SpeedLoop(Actuator):
    """Follows u as a second-order loop: natural period / 2 pi = `tau` seconds, damping ratio `zeta`."""

    def __init__(self, plant: Plant, tau: float, zeta: float):
        super().__init__(plant)
        require("speed loop", positive={"tau": tau, "zeta": zeta})
        self.tau, self.zeta = tau, zeta

    def rest(self) -> Floats:
        """Return [rate now, its change a second]."""
        return np.zeros(2)

    def move(self, own: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state and the rates that the motor reaches."""
        moved = np.empty_like(u)
        w, a = second_order_kernel(float(own[0]), float(own[1]), u, self._step(dt), dt, moved)
        return np.array([w, a]), moved

    def _step(self, dt: float) -> Floats:
        natural = 1.0 / self.tau
        rates = np.zeros((4, 4))  # speed, its rate, travel, u
        rates[0, 1] = rates[2, 0] = 1.0
        rates[1] = [-(natural**2), -2.0 * self.zeta * natural, 0.0, natural**2]
        return np.ascontiguousarray(np.asarray(expm(rates * dt), dtype=np.float64)[:3, [0, 1, 3]])
