"""What a start saves the learning loop: trials to the same error, every simulated material left out once.

    flat        trial 0 is the flow that is asked for
    suggested   twelve parameters, from hand calibrations of the others (`calibrate suggest`)
    model       a flow model, from those learned on the others (`learn.model_guess`), inverted along the routine
    its own     the flow model that was learned on this very material: what no guess can beat

All four are learned by the same `ModelLearner` and seen by the same camera (noise 0.3, the same draws trial by trial).
The error is true: what the plant gives without noise for that trial's signal. Reached is 1.1 times the least that the
flat start reaches within MOST trials; 2 times that is told beside it. A start that is refused, for want of a known
material of its kind of drive, is the flat one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from gcodectl.calibrate.calibration import Attributes, Calibration
from gcodectl.calibrate.features import asked_flow
from gcodectl.calibrate.profile import first_signal
from gcodectl.calibrate.suggestion import suggest
from gcodectl.columns import Floats
from gcodectl.config import Machine, load_machine
from gcodectl.errors import UnsafeError
from gcodectl.flow.flow_model import FlowModel
from gcodectl.learn.model_guess import guess_model, model_signal
from gcodectl.learn.reference import Routine
from gcodectl.learn.training import SHARE_OF_CAP, prepare
from learning_bench.guesses import hand_calibrated, interval
from learning_bench.materials import Material, Road, draw_materials
from plant_models.trial import as_trial, measured_by_camera

Cell = dict[str, Any]
First: TypeAlias = Callable[[Routine], Floats]
STARTS = ("flat", "suggested", "model", "its own")
MOST = 10
NOISE = 0.3
NEAR, TWICE = 1.1, 2.0


@dataclasses.dataclass(frozen=True)
class Run:
    """One learning: the true rms of each trial, mm^3/s, and the flow model that it ended with."""

    rms: tuple[float, ...]
    model: FlowModel
    refused: bool = False
    """Whether its start was refused, so that it is the flat start's."""

    def trials_to(self, error: float) -> int:
        """Return how many trials it took to an error; one more than MOST where it never did."""
        return next((number for number, rms in enumerate(self.rms, 1) if rms <= error), MOST + 1)


def measure(count: int, seed: int) -> list[Cell]:
    """Return a cell a material: what each start's trials were off by, and how many it took."""
    rng = np.random.default_rng(seed)
    machine = load_machine("syringe")
    materials = draw_materials(count, rng)
    known = hand_calibrated(materials, rng)
    road = _road(machine)
    seeds = [int(one) for one in rng.integers(2**31, size=count)]
    flat = [_learn(one, machine, None, number) for one, number in zip(materials, seeds, strict=True)]
    cells = []
    for place, material in enumerate(materials):
        attributes = road.attributes(material)
        others = [one for one in known if one.material != material.name]
        learned = [
            (road.attributes(one), flat[other].model) for other, one in enumerate(materials) if other != place
        ]  # fmt: skip
        starts: dict[str, First | None] = {
            "suggested": _suggested(others, attributes), "model": _modelled(learned, attributes, machine),
            "its own": _inverting(flat[place].model, machine),
        }  # fmt: skip
        runs = {"flat": flat[place]}
        for name, first in starts.items():
            try:
                runs[name] = _learn(material, machine, first, seeds[place]) if first else _refused(flat[place])
            except UnsafeError:
                runs[name] = _refused(flat[place])
        cells.append(_cell(material, seed, runs))
    return cells


def targets(cells: Sequence[Cell], seed: int = 0) -> list[Cell]:
    """Return the rows of the target: trials over the flat start's, and what the first trial was off by."""
    if not cells:
        return []
    rows = []
    for start in ("suggested", "model"):
        found = ratio(cells, start, "near")
        beside = {
            "interval": interval(found, seed), "of 2 x": float(np.median(ratio(cells, start, "twice"))),
            "trials, median": {name: _middle(cells, name, "near") for name in STARTS},
            "to 2 x": {name: _middle(cells, name, "twice") for name in STARTS},
            "mean": {name: float(np.mean([cell["starts"][name]["near"] for cell in cells])) for name in STARTS},
            "first trial, mm^3/s": {
                name: float(np.median([cell["starts"][name]["rms"][0] for cell in cells])) for name in STARTS
            },
            "refused": sum(start in cell["refused"] for cell in cells),
        }  # fmt: skip
        rows.append(
            {"name": f"simulated: trials to the same error, {start} start over flat, median of {len(cells)} materials",
             "value": float(np.median(found)), "unit": "of 1", "target": "<= 0.5",
             "met": bool(np.median(found) <= 0.5), "beside": beside}
        )  # fmt: skip
    return rows


def ratio(cells: Sequence[Cell], start: str, error: str) -> Floats:
    """Return each material's trials over those of the flat start."""
    return np.array([cell["starts"][start][error] / cell["starts"]["flat"][error] for cell in cells])


def _middle(cells: Sequence[Cell], start: str, error: str) -> float:
    return float(np.median([cell["starts"][start][error] for cell in cells]))


def _cell(material: Material, seed: int, runs: dict[str, Run]) -> Cell:
    least = min(runs["flat"].rms)
    starts = {
        name: {"near": run.trials_to(NEAR * least), "twice": run.trials_to(TWICE * least), "rms": list(run.rms)}
        for name, run in runs.items()
    }  # fmt: skip
    return {"part": "starts", "material": material.name, "plant": material.kind, "seed": seed, "starts": starts,
            "refused": [name for name, run in runs.items() if run.refused]}  # fmt: skip


def _refused(flat: Run) -> Run:
    return dataclasses.replace(flat, refused=True)


def _road(machine: Machine) -> Road:
    """Return the road that the training routine lays, see `learn.training.prepare`."""
    nozzle, flow = machine.nozzle, SHARE_OF_CAP * machine.max_flow
    return Road(nozzle, nozzle, 0.7 * nozzle, flow / (0.7 * nozzle**2))


def _suggested(known: Sequence[Calibration], attributes: Attributes) -> First | None:
    try:
        parameters = suggest(known, attributes).parameters
    except UnsafeError:
        return None
    asked = asked_flow(attributes, parameters.outputspeed)
    assert asked is not None, "a bench's road has a width and a height"
    return lambda routine: first_signal(parameters, asked, routine.roads, routine.q_ref, routine.dt, routine.flow)


def _modelled(
    known: Sequence[tuple[Attributes, FlowModel]], attributes: Attributes, machine: Machine
) -> First | None:  # fmt: skip
    try:
        found = guess_model(known, attributes, SHARE_OF_CAP * machine.max_flow)
    except UnsafeError:
        return None
    return _inverting(found.model, machine)


def _inverting(model: FlowModel, machine: Machine) -> First:
    return lambda routine: model_signal(model, routine.q_ref, routine.dt, machine.max_flow, machine.max_flow_slew)


def _learn(material: Material, machine: Machine, first: First | None, seed: int) -> Run:
    plant = as_trial(material.plant())
    setup = prepare(plant, machine, nozzle=machine.nozzle, max_trials=MOST, first=first)
    camera = measured_by_camera(plant, setup.routine.v, noise=NOISE, seed=seed)
    learner = setup.learner
    rms = []
    while learner.stop is None:
        trial = learner.observe(camera(learner.signal, learner.routine.dt))
        rms.append(float(np.sqrt(np.mean((learner.reference - plant(trial.u, learner.routine.dt)) ** 2))))
    assert learner.fitted is not None, "a trial has been observed"
    return Run(tuple(rms), learner.fitted.model)
