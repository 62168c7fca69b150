"""Learners, their evaluation, and suggestions, on calibrations whose rule is known."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from known import by_rule

from gcodectl.calibrate.calibration import PARAMETERS, Attributes, Calibration, Parameters
from gcodectl.calibrate.evaluation import CHOSEN, choose, evaluate, known_of, material_out
from gcodectl.calibrate.learners import COMMITTEE, NAMES, SINGLE, guesses
from gcodectl.calibrate.suggestion import load_guess, suggest
from gcodectl.errors import InputError, UsageError

NEW = Attributes("new", elasticity="high", nozzle_diameter=1.0, path_width=1.0, path_height=0.7)


def test_every_learner_but_the_flat_ones_sees_a_slope():
    rng = np.random.default_rng(0)
    X = rng.uniform(size=(40, 2))
    y = X[:, 0] + 0.01 * rng.normal(size=40)
    Z = np.array([[0.1, 0.5], [0.9, 0.5]])
    found = guesses(X, y, Z)
    assert set(found) == set(NAMES)
    for name, (low, high) in found.items():
        assert (high - low > 0.02) == (name not in ("mean", "median")), name
    assert found["ridge-1"] == pytest.approx([0.1, 0.9], abs=0.05)
    assert found["inverse-1"][0] == pytest.approx(
        y[np.argmin(np.hypot(*(X / np.ptp(X, axis=0) - Z[0] / np.ptp(X, axis=0)).T))]
    )
    assert found[COMMITTEE] == pytest.approx(np.median([found[name] for name in SINGLE], axis=0))


def test_learners_take_a_single_row_and_no_columns():
    for X in (np.zeros((1, 0)), np.ones((1, 2))):
        for name, values in guesses(X, np.array([2.0]), np.zeros((1, X.shape[1]))).items():
            assert values == pytest.approx([2.0]), name


def test_exponential_weights_fall_as_the_paper_says():
    X, y = np.array([[0.0], [1.0]]), np.array([0.0, 1.0])
    pull = np.exp(-0.75 / 0.3) / (np.exp(-0.75 / 0.3) + np.exp(-0.25 / 0.3))
    assert SINGLE["exponential-0.3"](X, y, np.array([[0.25]]))[0] == pytest.approx(pull)
    assert SINGLE["inverse-5"](X, y, np.array([[0.25]]))[0] == pytest.approx(0.25)


def test_what_is_left_out_is_not_seen():
    known = by_rule(6, 2)
    wild = [
        dataclasses.replace(one, parameters=dataclasses.replace(one.parameters, pushouttime=50.0))
        if one.material == "stuff 0" else one for one in known
    ]  # fmt: skip
    tame, seen = (material_out(known_of(one)["pushouttime"]) for one in (known, wild))
    first = known_of(known)["pushouttime"].y[:2]
    for name in NAMES:
        guess = {first[0] - tame[name][0], first[0] + tame[name][0]}
        again = {np.log(50.01) - seen[name][0], np.log(50.01) + seen[name][0]}
        assert min(abs(a - b) for a in guess for b in again) < 1e-9, name


def test_what_is_not_better_than_the_mean_by_more_than_it_scatters_is_not_taken():
    materials = [f"m{k}" for k in range(10)]
    even = np.linspace(0.3, 0.5, 10)
    same = dict.fromkeys(NAMES, even)
    up_and_down = np.tile([1.0, -1.0], 5)  # the mean difference's standard error is a third of this
    some, luck = even - 0.05 + 0.1 * up_and_down, even - 0.05 + 0.2 * up_and_down
    assert choose(same, materials) == "mean"
    assert choose({**same, COMMITTEE: luck}, materials) == "mean"
    assert choose({**same, COMMITTEE: some}, materials) == COMMITTEE
    assert choose({**same, "ridge-1": some}, materials) == "mean"  # one of a dozen must show more
    assert choose({**same, "ridge-1": even - 0.1}, materials) == "ridge-1"
    assert choose({**same, COMMITTEE: some, "ridge-1": some - 0.01}, materials) == "ridge-1"
    assert choose({**same, COMMITTEE: some, "ridge-1": even - 0.06}, materials) == COMMITTEE
    assert choose({**same, "ridge-1": even - 0.1}, materials[:2] * 5) == "mean"  # two materials tell nothing


def test_an_evaluation_finds_the_rule_and_shows_what_leaks():
    found = {(one.parameter, one.learner): one for one in evaluate(by_rule(6, 2, noise=0.02))}
    pushout = {name: found["pushouttime", name] for name in ("mean", CHOSEN)}
    assert pushout[CHOSEN].median(pushout[CHOSEN].material_out) < 1.15
    assert pushout["mean"].median(pushout["mean"].material_out) > 1.5
    assert ("pushoutspeed", "mean") not in found  # the same everywhere
    # each material its own number, unlike any other's: nothing but its own samples can tell
    own = []
    for k, one in enumerate(by_rule(4, 3)):
        number = k // 3
        told = dataclasses.replace(one.attributes, elasticity=None, nozzle_diameter=1.0 + number, path_width=1.0)
        own.append(Calibration(told, Parameters(pushouttime=0.1 * (1 + 7 * number % 5))))
    near = next(one for one in evaluate(own) if one.learner == "inverse-1")
    assert near.median(near.one_out) == pytest.approx(1.0)
    assert near.median(near.material_out) > 1.3


def test_a_suggestion_has_ranges_neighbours_and_a_road(tmp_path):
    found = suggest(by_rule(9, 2), NEW)
    assert found.parameters.pushouttime == pytest.approx(0.4, rel=0.2)
    assert found.parameters.inputspeed == pytest.approx(1.2 * 10.0 * 0.7, rel=0.1)
    assert found.parameters.acceldelay == pytest.approx(0.5 * found.parameters.pushouttime, rel=0.1)
    for name in ("pushouttime", "inputspeed", "pullbacktime"):
        low, middle, high = (getattr(one, name) for one in (found.low, found.parameters, found.high))
        assert low < middle < high
    assert [name for name, _ in found.nearest[:2]]
    assert found.nearest[0][1] <= found.nearest[1][1]
    assert any("inputaccel" in note for note in found.notes)
    assert any("the pushout is" in note and "mm of the road" in note for note in found.notes)
    assert found.high.acceldelay == pytest.approx(0.5 * found.high.pushouttime, rel=0.2)  # as unsure as its pushout
    path = tmp_path / "guess.json"
    path.write_text(json.dumps({"attributes": {"material": "new", "path_width": 1.0, "path_height": 0.7},
                                "parameters": dataclasses.asdict(found.parameters)}))  # fmt: skip
    parameters, asked = load_guess(path)
    assert parameters == found.parameters
    assert asked == pytest.approx(7.0)


def test_one_material_only_has_no_range_and_none_is_an_error():
    found = suggest(by_rule(1, 3), NEW)
    assert found.low.pushouttime is None
    assert found.parameters.pushouttime == pytest.approx(0.1, rel=0.2)
    assert any("only known material" in note for note in found.notes)
    with pytest.raises(UsageError, match="store is empty"):
        suggest([], NEW)
    with pytest.raises(UsageError, match="at least two materials"):
        evaluate(by_rule(1, 3))


def test_what_ended_very_late_is_not_learned_from():
    bad = Calibration(Attributes("bad", start_error="very late"), Parameters(pushouttime=99.0))
    assert suggest([*by_rule(4, 2), bad], NEW).parameters == suggest(by_rule(4, 2), NEW).parameters
    with pytest.raises(UsageError, match="very early or late"):
        suggest([bad], NEW)


@pytest.mark.parametrize("text", ["{", "[]", '{"attributes": {"material": "x"}, "parameters": {"u": 1}}',
    '{"attributes": {"material": 3}, "parameters": {}}',
    '{"attributes": {"material": "x", "path_width": "1"}, "parameters": {"pushouttime": "0.3"}}'])  # fmt: skip
def test_what_is_no_suggestion_is_refused(tmp_path, text):
    path = tmp_path / "guess.json"
    path.write_text(text)
    with pytest.raises(InputError, match="no suggestion"):
        load_guess(path)
    path.write_text('{"attributes": {"material": "x"}, "parameters": {}}')
    with pytest.raises(InputError, match="give path_width"):
        load_guess(path)


def test_guesses_stay_within_what_was_ever_used():
    far = dataclasses.replace(NEW, nozzle_diameter=90.0, path_width=90.0)
    found = suggest(by_rule(6, 2), far).parameters
    times = [one.parameters.pushouttime for one in by_rule(6, 2)]
    assert min(times) <= found.pushouttime <= max(times)
    assert set(PARAMETERS) > {"pushouttime"}


def test_a_known_materials_own_calibrations_move_the_guess():
    known = by_rule(9, 3)
    odd = [
        dataclasses.replace(
            one, attributes=dataclasses.replace(one.attributes, material="odd one"),
            parameters=dataclasses.replace(one.parameters, pushouttime=4.0 * one.parameters.pushouttime),
        ) for one in known[6:9]
    ]  # fmt: skip
    shifted = [
        dataclasses.replace(
            one, parameters=dataclasses.replace(one.parameters, pushouttime=factor * one.parameters.pushouttime)
        ) for one, factor in zip(known, np.repeat([1.0, 1.3, 0.8, 0.7, 1.4, 1.1, 0.9, 1.2, 0.75], 3), strict=True)
    ]  # fmt: skip
    new = suggest([*shifted, *odd], NEW)
    own = suggest([*shifted, *odd], dataclasses.replace(NEW, material="Odd one"))
    right = 4.0 * 0.1 * 2**2
    off = [abs(np.log(one.parameters.pushouttime / right)) for one in (new, own)]
    assert off[1] < 0.6 * off[0]
    assert own.learners["pushouttime"].endswith(", own")
    assert own.high.pushouttime / own.low.pushouttime < new.high.pushouttime / new.low.pushouttime
    assert any("its own calibrations move the guess" in note for note in own.notes)
