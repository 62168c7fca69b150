"""The first trial's signal from a suggestion's file: by its flow model where it has one, else by its twelve parameters.

    gcodectl calibrate suggest ... --learned materials.npz -o guess.json  -->  {"parameters": ..., "model": ...}
                                                                                                       |
    learning:   first_trial(Path("guess.json"), machine)(routine)  -->  u[n]  <-------- inverted, where it is there

Either is checked against the volume that the routine's roads hold before it is run (`calibrate.profile`).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from gcodectl.calibrate.profile import check_volume, first_signal
from gcodectl.calibrate.suggestion import load_guess
from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.errors import InputError
from gcodectl.flow.flow_model import FlowModel
from gcodectl.learn.model_guess import CONSERVING, at_flow, model_signal
from gcodectl.learn.reference import Routine


def first_trial(guess: Path, machine: Machine) -> Callable[[Routine], Floats]:
    """Return what makes trial 0's signal, u[n] in mm^3/s, for a routine on `machine`.

    Raises InputError where the file is no suggestion, or tells neither a model nor a road; the function it returns
    raises UnsafeError where that signal would flood or starve the routine's roads.
    """
    model = load_model(guess)
    if model is not None:

        def by_model(routine: Routine) -> Floats:
            there = at_flow(model, routine.flow)
            u = model_signal(there, routine.q_ref, routine.dt, machine.max_flow, machine.max_flow_slew)
            if there.structure in CONSERVING:  # a pressure's u is no volume, and a screw's leaks back
                check_volume(there.K * u, routine.q_ref, routine.dt)
            return u

        return by_model
    parameters, asked = load_guess(guess)

    def by_profile(routine: Routine) -> Floats:
        return first_signal(parameters, asked, routine.roads, routine.q_ref, routine.dt, routine.flow)

    return by_profile


def load_model(guess: Path) -> FlowModel | None:
    """Return the flow model of a suggestion's file; None where it has none. Raises InputError where it is none."""
    try:
        told = json.loads(guess.read_text(encoding="utf-8")).get("model")
        return None if told is None else FlowModel(**told)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", source=str(guess)) from error
    except (ValueError, TypeError, AttributeError, InputError) as error:
        raise InputError(f"is no suggestion of `calibrate suggest -o`: {error}", source=str(guess)) from error
