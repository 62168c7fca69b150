"""Calibrations that are made up by a rule that is known."""

from __future__ import annotations

import math

import numpy as np

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters

LEVELS = ("low", "medium", "high")


def by_rule(materials: int = 8, each: int = 3, noise: float = 0.05, seed: int = 0) -> list[Calibration]:
    """Pushout doubles with every level of elasticity; the fill is 1.2; each material has its own elasticity."""
    rng = np.random.default_rng(seed)
    made = []
    for number in range(materials):
        level = number % 3
        for k in range(each):
            wide = float(rng.uniform(0.4, 1.6))
            time = 0.1 * 2**level * math.exp(noise * rng.normal())
            attributes = Attributes(
                f"stuff {number}",
                elasticity=LEVELS[level],
                nozzle_diameter=wide,
                path_width=wide,
                path_height=0.7 * wide,
            )
            fill = 1.2 * math.exp(noise * rng.normal())
            parameters = Parameters(
                acceldelay=0.5 * time, pushoutspeed=20.0, pushouttime=time, inputspeed=fill * 10.0 * 0.7 * wide**2,
                outputspeed=10.0, deceldelay=time, pullbackspeed=20.0, pullbacktime=time,
            )  # fmt: skip
            made.append(Calibration(attributes, parameters, f"{number}.{k}"))
    return made
