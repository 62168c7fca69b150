"""A flow model for a material that has not been learned yet: from those that have been, and from its attributes.

    learned materials   attributes, flow model                      new material   attributes
                                     |  in logarithms, each parameter              |
                                     v  by the learner that serves best            v
                        K, lag, power, dead time, yield   ---->   K, lag, power, dead time, yield
                                                                       |  inverted along the routine
                                                                       v
                                                                    trial 0

Twelve parameters of a road's ends know one flow, and nothing of corners or of short pauses; a flow model knows what is
stored at any flow, so that its inversion is a whole first trial. Models learned at other flows are brought to the one
that is asked for, exactly, as f(S) stays the same function. Where structures differ, all that conserve volume (linear,
plunger, backlash) are taken for `plunger`; a guess knows no backlash. Only models of the same kind of drive serve
(`calibrate.drives`).

What it saves is the first trial's error, not the last one's: from the second trial on, learning rests on what was
measured, and gets as far as from any start (`tools/bench_learning --part starts`).

Source: the learners are `gcodectl.calibrate`'s; the model, `flow.flow_model`.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters
from gcodectl.calibrate.drives import same_drive
from gcodectl.calibrate.evaluation import Known
from gcodectl.calibrate.guess import guess_one
from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.flow.flow_model import FlowModel
from gcodectl.flow.inversion import Inversion
from gcodectl.flow.library import Library

CONSERVING = ("linear", "plunger", "backlash")
"""Structures that are guessed as `plunger`."""
SHORT = 0.02
"""s; added to a dead time before its logarithm is taken."""
LEAST_POWER = 0.5


@dataclasses.dataclass(frozen=True)
class ModelGuess:
    """A flow model for a material that nobody has learned yet."""

    model: FlowModel
    learners: dict[str, str]
    """Which one guessed each parameter."""
    materials: tuple[str, ...]
    """Whose models it was guessed from."""
    notes: tuple[str, ...]


def learned_models(library: Library, known: Sequence[Calibration]) -> list[tuple[Attributes, FlowModel]]:
    """Return the flow models of the materials in a library that calibrations describe, by their names."""
    described = {one.material: one.attributes for one in known}
    return [
        (described[name], one.model)
        for one in library.sets
        if one.model is not None and (name := Calibration(Attributes(one.material), Parameters()).material) in described
    ]


def guess_model(known: Sequence[tuple[Attributes, FlowModel]], attributes: Attributes, flow: float) -> ModelGuess:
    """Return the flow model to begin with at a nominal flow (mm^3/s), from the models of other materials.

    Raises UsageError where there are none, UnsafeError where there are only those of another kind of drive.
    """
    if not known:
        raise UsageError("no learned material is known to guess a flow model from")
    carriers = [Calibration(one, Parameters(), str(place)) for place, (one, _) in enumerate(known)]
    kept, notes = same_drive(carriers, attributes)
    models = [at_flow(known[int(one.source)][1], flow) for one in kept]
    structure = Counter(_structure(one) for one in models).most_common(1)[0][0]
    pairs = [(one, model) for one, model in zip(kept, models, strict=True) if _structure(model) == structure]
    rows = [_coded(model) for _, model in pairs]
    values, learners = {}, {}
    for name in rows[0]:
        learned = Known(name, tuple(one for one, _ in pairs), np.array([row[name] for row in rows]))
        guess = guess_one(learned, attributes)
        values[name], learners[name] = guess.value, guess.learner
    materials = tuple(sorted({one.material for one, _ in pairs}))
    return ModelGuess(_decoded(structure, values, flow), learners, materials, tuple(notes))


def at_flow(model: FlowModel, flow: float) -> FlowModel:
    """Return the same model with another nominal flow (mm^3/s)."""
    store = model.store * (flow / model.flow) ** (1.0 / model.power)
    return dataclasses.replace(model, flow=flow, store=store)


def model_signal(model: FlowModel, q_ref: Floats, dt: float, max_flow: float, max_flow_slew: float) -> Floats:
    """Return u (mm^3/s) that the model says gives the flow q_ref[n], samples of dt s, within the plunger's limits."""
    return Inversion(model, max_flow, max_flow_slew, dt).along(q_ref)


def _structure(model: FlowModel) -> str:
    return "plunger" if model.structure in CONSERVING else model.structure


def _coded(model: FlowModel) -> dict[str, float]:
    """Return what is guessed of a model: logarithms, volumes as seconds of the nominal flow."""
    found = {
        "K": math.log(model.K), "lag": math.log(model.quickness), "power": math.log(model.power),
        "delay": math.log(model.delay + SHORT), "threshold": model.threshold / model.flow,
    }  # fmt: skip
    if model.structure == "pressure":
        found |= {"store": math.log(model.store / model.flow), "pull": math.log(model.pull / model.flow)}
    if model.structure == "screw":
        found |= {
            "leak": math.log(model.leak + 1e-3),
            "swing": math.log(model.swing),
            "damping": math.log(model.damping),
        }
    return found


def _decoded(structure: str, values: dict[str, float], flow: float) -> FlowModel:
    lag, power = math.exp(values["lag"]), max(math.exp(values["power"]), LEAST_POWER)
    more: dict[str, float] = {}
    if structure == "pressure":
        more = {"lag": lag, "pull": flow * math.exp(values["pull"])}
    if structure == "screw":
        more = {"leak": max(math.exp(values["leak"]) - 1e-3, 0.0), "swing": math.exp(values["swing"]),
                "damping": math.exp(values["damping"])}  # fmt: skip
    return FlowModel(
        structure, K=math.exp(values["K"]), flow=flow, power=power,
        store=flow * math.exp(values["store"]) if structure == "pressure" else lag * power * flow,
        threshold=flow * values["threshold"], delay=max(math.exp(values["delay"]) - SHORT, 0.0), **more,
    )  # fmt: skip
