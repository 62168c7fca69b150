"""A plant as learning sees it: the plunger rate of one trial in, from rest, and the measured flow out."""

from __future__ import annotations

from collections.abc import Callable

from gcodectl.columns import Floats
from plant_models.plant import load_plant


def as_extruder(spec: str, *, seed: int = 0, flow: float | None = None) -> Callable[[Floats, float], Floats]:
    """Return `extruder(u, dt) -> q` (n samples, mm^3/s) for the plant that `spec` names; every call begins at rest."""
    plant = load_plant(spec, seed=seed, flow=flow)

    def extruder(u: Floats, dt: float) -> Floats:
        return plant.run(plant.initial(), u, dt)[1]

    return extruder
