"""From an unknown extruder to a basis set: identify, check, learn, segment, and keep the record.

downward step -> nominal model -> routine, law -> convergence check -> trials -> basis set and flow model
                 (no dead time in it, as in the paper: the trials show whether that will do)
"""

from __future__ import annotations

import dataclasses
import math
import platform
from collections.abc import Callable
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.flow.library import BasisSet
from gcodectl.learn.convergence import Convergence, convergence
from gcodectl.learn.ilc import Law
from gcodectl.learn.margin import find_margin, with_margin
from gcodectl.learn.model import Extruder, Model, identify_by_step
from gcodectl.learn.model_learner import ModelLearner
from gcodectl.learn.reference import Routine, training_routine, with_levels
from gcodectl.learn.segmentation import basis_set
from gcodectl.learn.trials import Limits, Stop
from gcodectl.version import VERSION

DT = 0.01
"""Seconds a sample of what is learned."""
SHARE_OF_CAP = 0.2
"""Nominal flow where none is given, as a share of the plunger's cap: room enough to catch up with a lag."""


@dataclasses.dataclass(frozen=True)
class Setup:
    """Everything that is fixed before the first trial."""

    machine: Machine
    model: Model
    """As the downward step showed it."""
    routine: Routine
    learner: ModelLearner
    check: Convergence
    """The law on the nominal model."""


def prepare(
    extruder: Extruder,
    machine: Machine,
    *,
    nozzle: float,
    flow: float | None = None,
    speed: float | None = None,
    pause: float = 0.2,
    max_trials: int = 9,
    first: Callable[[Routine], Floats] | None = None,
) -> Setup:
    """Identify `extruder` by a downward step at `flow` (mm^3/s), and set up learning on `machine`.

    Without `flow` a fifth of the plunger's cap is taken; without `speed` (mm/s) that of a bead 0.7 nozzles high and one
    wide. `first` makes trial 0's signal for the routine; without it that is the flow asked for. Raises InputError where
    the flow does not follow the plunger, UsageError where the routine cannot be.
    """
    flow = SHARE_OF_CAP * machine.max_flow if flow is None else flow
    speed = flow / (0.7 * nozzle**2) if speed is None else speed
    model = identify_by_step(extruder, flow, DT)
    routine = with_levels(training_routine(flow, lag=model.tau, speed=speed, accel=machine.accel, pause=pause, dt=DT))
    law = Law(dataclasses.replace(model, delay=0.0), DT)
    learner = ModelLearner(
        routine, law, Limits(machine.max_flow, machine.max_flow_slew), max_trials=max_trials,
        first=None if first is None else first(routine),
    )  # fmt: skip
    return Setup(machine, model, routine, learner, convergence(law))


def finish(setup: Setup, *, material: str, nozzle: float, made_by: dict[str, Any], date: str | None = None) -> BasisSet:
    """Segment the best trial and give it its margin; `made_by` (plant, seed, ...) and `date` go into the record."""
    best, first = setup.learner.best, setup.routine.first
    samples = len(first.t)
    learned = basis_set(
        best.u[:samples],
        first,
        material=material,
        nozzle=nozzle,
        training={**made_by, **record(setup), **({"date": date} if date else {})},
    )
    learned = with_margin(learned, find_margin(best.q[:samples], first, nozzle))
    return dataclasses.replace(learned, model=setup.learner.model)


def record(setup: Setup) -> dict[str, Any]:
    """Return what made a basis set, as JSON values: model, limits, errors by trial, versions."""
    learner, routine = setup.learner, setup.routine
    assert learner.stop is not None, "learning has not stopped"
    first, best, limits = learner.trials[0], learner.best, dataclasses.asdict(learner.limits)
    return {
        "machine": setup.machine.name,
        "model": _model(setup.model),
        "model_from_trials": _model(learner.found) if learner.found else None,
        "flow_model": _flow_model(learner),
        "delay_in_law": round(best.delay, 6),
        "gain": learner.law.gain,
        "bandwidth": learner.law.bandwidth,
        "convergence": {"worst": round(setup.check.worst, 6), "at": round(setup.check.worst_frequency, 6)},
        "routine": {
            "speed": round(routine.speed, 6),
            "accel": routine.accel,
            "pause": round(routine.dip - routine.speed / routine.accel, 6),
            "duration": round(routine.duration, 6),
        },
        "limits": {name: value if math.isfinite(value) else None for name, value in limits.items()},
        "trials": len(learner.trials),
        "best": best.number,
        "rms": [round(trial.rms, 6) for trial in learner.trials],
        "ratio": round(best.rms / first.rms, 6) if first.rms > 0 else None,
        "stop": str(learner.stop),
        "safe": learner.stop is not Stop.DIVERGING,
        "notes": learner.notes,
        "versions": {"gcodectl": VERSION, "numpy": np.__version__, "python": platform.python_version()},
    }


def _model(model: Model) -> dict[str, float]:
    return {"K": round(model.K, 6), "tau": round(model.tau, 6), "delay": round(model.delay, 6)}


def _flow_model(learner: ModelLearner) -> dict[str, Any] | None:
    """Return what is said of the flow model: what its prediction of the last trial missed by, and whether it serves."""
    if learner.fitted is None:
        return None
    return {
        "structure": learner.fitted.model.structure,
        "prediction_off": round(learner.missed, 6),
        "serves": learner.model is not None,
    }
