"""A plant as learning sees it: the plunger rate of one trial in, from rest, and the measured flow out."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from gcodectl.columns import Floats
from plant_models.plant import Plant, load_plant

Trial: TypeAlias = Callable[[Floats, float], Floats]


def as_extruder(spec: str, *, seed: int = 0, flow: float | None = None) -> Trial:
    """Return `extruder(u, dt) -> q` (n samples, mm^3/s) for the plant that `spec` names; every call begins at rest."""
    return as_trial(load_plant(spec, seed=seed, flow=flow))


def as_trial(plant: Plant) -> Trial:
    """Return the same for a plant that is there already."""

    def extruder(u: Floats, dt: float) -> Floats:
        return plant.run(plant.initial(), u, dt)[1]

    return extruder


def measured_by_camera(extruder: Trial, v: Floats, *, noise: float, seed: int) -> Trial:
    """Return `extruder` as a camera sees it that rides along at speed v[n], mm/s: each call is another print.

    `noise` is a factor on that of the measured road widths, see `plant_models.noise`.
    """
    from plant_models.noise import ROAD_WIDTHS

    camera = ROAD_WIDTHS.scaled(noise)
    rng = np.random.default_rng(seed)

    def measured(u: Floats, dt: float) -> Floats:
        return np.asarray(extruder(u, dt) * (1 + camera.along(np.cumsum(v) * dt, rng)), dtype=np.float64)

    return measured
