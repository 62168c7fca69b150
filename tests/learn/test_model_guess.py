"""A flow model guessed from those of other materials, and the first trial that it gives."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters
from gcodectl.config import load_machine
from gcodectl.errors import InputError, UnsafeError, UsageError
from gcodectl.flow.flow_model import FlowModel
from gcodectl.learn.first_trial import first_trial, load_model
from gcodectl.learn.model_guess import at_flow, guess_model, model_signal
from gcodectl.learn.reference import training_routine, with_levels
from plant_models.plant import load_plant
from plant_models.trial import as_trial

LEVELS = ("low", "medium", "high")


def learned(materials=9, tool="syringe pump"):
    """Lags of 0.5, 1 and 2 s by elasticity, at 4 mm^3/s; nothing else differs but the structures' names."""
    made = []
    for number in range(materials):
        lag = 0.5 * 2 ** (number % 3)
        attributes = Attributes(f"stuff {number}", tool=tool, elasticity=LEVELS[number % 3], path_width=0.84)
        structure = ("linear", "plunger", "backlash")[number // 3 % 3]
        model = FlowModel(structure, K=0.9, flow=4.0, store=4.0 * lag, gap=0.05 if structure == "backlash" else 0.0)
        made.append((attributes, model))
    return made


NEW = Attributes("new", tool="10cc syringe", elasticity="high", path_width=0.84)


def test_a_model_is_guessed_from_attributes_and_brought_to_the_flow():
    found = guess_model(learned(), NEW, 5.0)
    assert found.model.structure == "plunger"
    assert found.model.gap == 0.0
    assert pytest.approx(0.9) == found.model.K
    assert found.model.quickness == pytest.approx(2.0, rel=0.15)
    assert found.model.flow == 5.0
    assert len(found.materials) == 9
    low = guess_model(learned(), dataclasses.replace(NEW, elasticity="low"), 5.0).model
    assert low.quickness == pytest.approx(0.5, rel=0.15)


def test_another_nominal_flow_is_the_same_model():
    model = FlowModel("plunger", K=1.0, flow=5.0, store=8.0, power=2.0, threshold=1.0, delay=0.1)
    u = np.concatenate([np.zeros(50), np.full(300, 6.0), np.full(100, -2.0)])
    assert at_flow(model, 2.0).predict(u, 0.01) == pytest.approx(model.predict(u, 0.01))


def test_only_the_same_kind_of_drive_is_learned_from():
    with pytest.raises(UnsafeError, match="nothing is known of air pressure tools"):
        guess_model(learned(), dataclasses.replace(NEW, tool="air pressure"), 5.0)
    air = FlowModel("pressure", K=1.6, flow=4.0, store=1.0, power=2.0, threshold=1.0, lag=0.2, pull=1.0)
    screw = FlowModel("screw", K=1.1, flow=4.0, store=2.0, leak=0.1, swing=0.2, damping=0.6)
    others = [(Attributes("ink", tool="air pressure"), air), (Attributes("pla", tool="pellet screw"), screw)]
    for attributes, model in others:
        asked = dataclasses.replace(NEW, tool=attributes.tool)
        found = guess_model([*learned(), *others], asked, 4.0).model
        for field in dataclasses.fields(FlowModel):
            told = getattr(model, field.name)
            assert getattr(found, field.name) == (told if isinstance(told, str) else pytest.approx(told)), field.name
    with pytest.raises(UsageError, match="no learned material"):
        guess_model([], NEW, 5.0)


def error(u, routine, plant):
    q = as_trial(plant)(u, routine.dt)
    return float(np.sqrt(np.mean((q - routine.q_ref) ** 2)))


def test_the_first_trial_of_a_guessed_model_is_far_better_than_the_flat_one(tmp_path):
    machine = load_machine("syringe")
    routine = with_levels(training_routine(5.0, lag=2.0, speed=10.0))
    plant = load_plant("linear", flow=5.0, K=0.9, tau=2.0)
    model = guess_model(learned(), NEW, 4.0).model
    path = tmp_path / "guess.json"
    path.write_text(json.dumps({"model": model.table()}))
    u = first_trial(path, machine)(routine)
    assert u == pytest.approx(model_signal(at_flow(model, 5.0), routine.q_ref, routine.dt, 25.0, 2000.0), abs=1e-6)
    assert error(u, routine, plant) < 0.5 * error(routine.q_ref, routine, plant)


def test_a_file_without_a_model_gives_the_twelve_parameters_and_what_is_none_is_refused(tmp_path):
    machine = load_machine("syringe")
    routine = with_levels(training_routine(5.0, lag=1.0, speed=10.0))
    told = {"acceldelay": 0.1, "pushoutspeed": 20.0, "pushouttime": 0.2, "inputspeed": 5.0, "outputspeed": 10.0,
            "deceldelay": 0.1, "pullbackspeed": 20.0, "pullbacktime": 0.2}  # fmt: skip
    path = tmp_path / "guess.json"
    path.write_text(json.dumps({"attributes": {"material": "x", "path_width": 1.0, "path_height": 0.5},
                                "parameters": told}))  # fmt: skip
    assert load_model(path) is None
    assert first_trial(path, machine)(routine).max() == pytest.approx(20.0)
    for text in ("{", "[]", '{"model": {"structure": "plunger"}}', '{"model": {"K": "x"}}', '{"model": 3}'):
        path.write_text(text)
        with pytest.raises(InputError, match="no suggestion"):
            first_trial(path, machine)
    with pytest.raises(InputError, match="cannot be read"):
        load_model(tmp_path / "none.json")


def test_a_model_that_would_flood_the_roads_is_refused(tmp_path):
    routine = with_levels(training_routine(5.0, lag=1.0, speed=10.0))
    vast = FlowModel("plunger", K=1.0, flow=5.0, store=400.0, power=1.0)
    path = tmp_path / "guess.json"
    path.write_text(json.dumps({"model": vast.table()}))
    with pytest.raises(UnsafeError, match="would push"):
        first_trial(path, dataclasses.replace(load_machine("syringe"), max_flow=500.0))(routine)


def test_what_the_slowest_clay_needs_is_not_refused(tmp_path):
    from gcodectl.flow.library import open_library

    model = next(one.model for one in open_library().sets if one.material == "clay-slow")
    routine = with_levels(training_routine(5.0, lag=model.quickness, speed=10.0))
    path = tmp_path / "guess.json"
    path.write_text(json.dumps({"model": model.table()}))
    u = first_trial(path, load_machine("syringe"))(routine)
    assert np.maximum(u, 0.0).sum() > 2.0 * routine.q_ref.sum()


def test_models_go_by_the_names_of_what_the_store_describes():
    from gcodectl.flow.library import Library, open_library
    from gcodectl.learn.model_guess import learned_models

    sets = open_library().sets
    clay = next(one for one in sets if one.material == "clay")
    known = [Calibration(Attributes("Clay", elasticity="high"), Parameters(pushouttime=0.3))]
    found = learned_models(Library(sets), known)
    assert [one.elasticity for one, _ in found] == ["high"]
    assert found[0][1] is clay.model
    assert math.isfinite(found[0][1].quickness)
