"""What gcodectl knows of a plant: a library from at most 10 noisy trials of one routine, and filters made of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.flow.library import BasisSet
from gcodectl.flow.limits import within_limits
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import identify_by_step
from gcodectl.learn.training import finish, prepare
from gcodectl.learn.trials import run_trials
from gcodectl.pipeline import Options, filter_bytes
from plant_models.plant import Plant
from plant_models.printing import Bench
from plant_models.trial import Trial, as_extruder, measured_by_camera
from plant_models.whole import Update

MAX_TRIALS = 10
BEAD_SHARE = 0.7
"""Height of the training bead, in nozzles (`learn.training.prepare`)."""


def learn_library(plant: str, machine: Machine, flow: float, seed: int, noise: float) -> BasisSet:
    """Learn on `plant` (nominal parameters, made for `flow`, mm^3/s) as a camera sees it; nothing else is known of it.

    `noise` is a factor on the measured road widths' (`plant_models.noise`); the identifying steps are measured alike.
    """
    extruder = as_extruder(plant, seed=seed + 1, flow=flow)  # another day than the print
    speed = flow / (BEAD_SHARE * machine.nozzle**2)
    setup = prepare(
        _seen(extruder, speed, noise, seed), machine, nozzle=machine.nozzle, flow=flow, max_trials=MAX_TRIALS
    )
    measured = measured_by_camera(extruder, setup.routine.v, noise=noise, seed=seed) if noise else extruder
    for _ in run_trials(measured, setup.learner):
        pass
    made_by = {"plant": plant, "seed": seed, "noise": noise}
    return finish(setup, material=plant.rpartition("/")[2], nozzle=machine.nozzle, made_by=made_by)


def filtered(
    data: bytes, machine: Machine, learned: BasisSet, sequencer: str = "", quality: float | None = None
) -> bytes:
    """Filter a file as gcodectl does by default, or with another sequencer or `quality`."""
    options = Options(machine, (learned,))
    changes: dict[str, Any] = {"sequencer": sequencer} if sequencer else {}
    if quality is not None:
        changes["quality"] = quality
    return filter_bytes(data, dataclasses.replace(options, **changes))


def laws(bench: Bench, flow: float) -> dict[int, Update]:
    """Return a learning law for every tool, its model identified from a step of the plant."""

    def law_of(plant: Plant) -> Update:
        law = Law(identify_by_step(lambda u, dt: plant.run(plant.initial(), u, dt)[1], flow, 0.01), bench.dt)
        flow_limit, slew = bench.machine.max_flow, bench.machine.max_flow_slew
        return lambda u, error: within_limits(law.update(u, error), flow_limit, slew, bench.dt)

    return {tool: law_of(plant) for tool, plant in bench.plants.items()}


def _seen(extruder: Trial, speed: float, noise: float, seed: int) -> Trial:
    """Return the extruder as a camera sees it at one speed, mm/s, however long the trial is."""

    def measured(u: Floats, dt: float) -> Floats:
        camera: Callable[[Floats, float], Floats] = measured_by_camera(
            extruder, np.full(len(u), speed), noise=noise, seed=seed + 1000
        )
        return camera(u, dt)

    return measured if noise else extruder
