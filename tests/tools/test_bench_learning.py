"""The learning bench: the simulated operator sees grades only and gets there; its arithmetic on made-up cells."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcodectl.flow.flow_model import FlowModel
from gcodectl.learn.reference import training_routine, with_levels

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from learning_bench import fabathome, guesses, loop, photo_session, photographs, starts
from learning_bench.materials import KINDS, Material, Road, draw_materials, draw_road
from learning_bench.operator import MOST, Delay, Time, by_hand, calibrate, set_up

PASTE = Material("paste", "linear", {"tau": 1.0}, {"elasticity": "medium"})
ROAD = Road(0.84, 0.84, 0.6, 10.0)


def test_an_operator_finds_ok_at_both_ends_and_says_so_again():
    rng = np.random.default_rng(3)
    session = calibrate(PASTE, ROAD, by_hand(ROAD), rng)
    assert session.iterations <= MOST
    assert session.looks[-1].good
    assert session.calibration.attributes.start_error == "ok"
    again = [calibrate(PASTE, ROAD, session.calibration.parameters, rng).iterations for _ in range(5)]
    assert np.median(again) <= 2  # what is left is the noise of reading it off


@pytest.mark.parametrize(
    ("push", "pull", "start", "stop"),
    [
        ((0.0, 0.0), (0.0, 0.0), "very late", "very late"),
        ((2.0, 0.25), (0.12, 0.22), "very early", None),
        ((0.15, 0.28), (2.0, 0.22), None, "very early"),
    ],
)
def test_ends_are_graded_as_they_are(push, pull, start, stop):
    begin = set_up(ROAD.speed, ROAD.flow, push, pull)
    look = calibrate(PASTE, ROAD, begin, np.random.default_rng(0)).looks[0]
    assert start is None or look.start == start
    assert stop is None or look.stop == stop
    assert look.extrudes


def test_nothing_comes_out_of_a_plunger_that_stands_still():
    stiff = dataclasses.replace(PASTE, kind="syringe", parameters={"tau": 1.0, "primed": 0.0})
    look = calibrate(stiff, ROAD, set_up(ROAD.speed, 1e-3, (0.0, 0.0), (0.0, 0.0)), np.random.default_rng(0)).looks[0]
    assert not look.extrudes
    assert look.start == "very late"


def test_knobs_turn_and_then_bracket():
    knob = Time(0.4)
    assert knob.turned("very late") == 0.8
    assert knob.turned("early") == pytest.approx((0.4 * 0.8) ** 0.5)
    assert knob.turned("ok") == knob.value
    delay = Delay(0.1)
    assert delay.turned("early") == pytest.approx(0.0)
    assert delay.turned("very late") == pytest.approx(0.05)
    assert delay.turned("late") == pytest.approx(0.075)


def test_materials_are_of_all_kinds_and_the_same_for_a_seed():
    drawn = draw_materials(12, np.random.default_rng(5))
    assert drawn == draw_materials(12, np.random.default_rng(5))
    assert {one.kind for one in drawn} == set(KINDS)
    road = draw_road(np.random.default_rng(5))
    assert road.attributes(drawn[0]).path_width == road.width


def test_a_guess_is_measured_on_materials_it_has_not_seen():
    cells = guesses.measure(3, seed=2)
    rows = guesses.targets(cells)
    assert [cell["material"] for cell in cells] == ["material 0", "material 1", "material 2"]
    assert all(set(cell["starts"]) == set(guesses.STARTS) for cell in cells)
    assert rows[1]["value"] == np.median([cell["starts"]["suggested"]["prints"] for cell in cells])
    assert guesses.targets([]) == []


def made_up(learner: str, off: float) -> dict[str, Any]:
    return {"parameter": "pushouttime", "learner": learner, "files": "all", "samples": 9, "material_out": off,
            "interval": [1.0, 2.0], "over_materials": 1.9, "repeats": 1.1}  # fmt: skip


def test_targets_are_of_what_was_chosen_and_say_what_bounds_it():
    cells = [made_up("chosen", 1.6), made_up("mean", 1.55), made_up("ridge-1", 1.2), made_up("committee", 1.1)]
    cells += [{**one, "parameter": "inputspeed"} for one in cells]
    pushout, rate = fabathome.targets(cells)
    assert (pushout["value"], pushout["met"], pushout["mean"], pushout["best_in_hindsight"]) == (1.6, False, 1.55, 1.2)
    assert rate["target"] == "<= 1.12"


def test_photographs_are_scored_against_what_the_plant_laid():
    (cell,) = photographs.measure(1, seed=7, quick=True)
    assert not cell["refused"]
    assert 0.0 < cell["rms"] < 0.15
    assert cell["weight_taken"]
    assert cell["rms_weighed"] < 1.2 * cell["rms"]
    assert cell["seen"] > 0.9
    assert abs(cell["turned"]) < 0.1


def test_a_strip_is_the_plants_own():
    one = photographs.PRINTS[0]
    now, strip = photographs.printed(one, "paste-a", 0)
    long = np.linalg.norm(np.diff(strip.path, axis=0), axis=1).sum()
    assert strip.s[-1] == pytest.approx(long, rel=0.01)
    assert strip.path.tolist() == now.setup.printout.layout.path.tolist()
    assert strip.width.max() == pytest.approx(1.08 * strip.nominal, rel=0.3)  # paste-a's gain, and levels up to 1.3
    assert strip.width[0] < 0.2 * strip.nominal


def test_photographs_targets_count_what_was_refused():
    def seen(rms: float, refused: str = "") -> dict[str, Any]:
        weighed = {"rms_weighed": rms / 2, "relative_weighed": rms}
        return {"nozzle": 0.4, "rms": rms, "relative": 2 * rms, **weighed, "refused": refused}

    rms, relative, weighed, relative_weighed = photographs.targets(
        [seen(0.02), seen(0.04), seen(0.06), {"nozzle": 0.4, "refused": "no markers"}]
    )
    assert (rms["value"], rms["met"], rms["worst"], rms["refused"], rms["photographs"]) == (0.04, True, 0.06, 1, 4)
    assert (relative["value"], relative["met"]) == (0.08, False)
    assert (weighed["value"], relative_weighed["value"], relative_weighed["met"]) == (0.02, 0.04, True)
    nothing = photographs.targets([{"nozzle": 0.4, "refused": "no markers"}])
    assert not nothing[0]["met"]


def run_of(*rms: float) -> starts.Run:
    return starts.Run(rms, FlowModel("linear", K=1.0, flow=5.0, store=5.0))


def test_trials_to_an_error_are_counted_from_one():
    assert run_of(2.0, 0.5, 0.4).trials_to(0.45) == 3
    assert run_of(0.4).trials_to(0.45) == 1
    assert run_of(2.0, 0.5).trials_to(0.45) == starts.MOST + 1


def test_a_start_is_measured_against_the_flat_one_on_materials_it_has_not_seen():
    cells = starts.measure(2, seed=3)
    for cell in cells:
        assert set(cell["starts"]) == set(starts.STARTS)
        assert cell["starts"]["its own"]["rms"][0] < 0.5 * cell["starts"]["flat"]["rms"][0]
    rows = starts.targets(cells)
    assert [row["value"] for row in rows] == [
        np.median(starts.ratio(cells, start, "near")) for start in ("suggested", "model")
    ]  # fmt: skip
    low, high = rows[0]["beside"]["interval"]
    assert low <= rows[0]["value"] <= high
    assert starts.targets([]) == []


def test_the_beads_error_counts_what_lies_on_the_roads_and_nothing_else():
    routine = with_levels(training_routine(5.0))
    exact = routine.q_ref
    assert loop.bead_error(exact, routine, 1.0) == pytest.approx(0.0, abs=0.01)
    assert loop.bead_error(1.1 * exact, routine, 1.0) == pytest.approx(0.1, abs=0.01)
    beside = np.where(routine.v > 0, exact, 7.0)
    beside[round(routine.corner[0] / routine.dt) : round(routine.corner[1] / routine.dt)] = 0.0
    assert loop.bead_error(beside, routine, 1.0) < 0.15
    late = np.concatenate([np.zeros(50), exact[:-50]])
    assert loop.bead_error(late, routine, 1.0) > 0.2


def test_a_session_of_the_bench_learns_and_is_judged_by_what_really_flowed():
    (case,) = [one for one in loop.cases(("syringe-fast",), loop.CAP, None) if one.part == "fig9"]
    course = loop.run_session(case, 3, loop.with_noise(0.1, 3))
    assert len(course.true) == len(course.beads) <= 10
    assert course.beads[course.best] < 0.3 * course.beads[0]
    assert course.learned is not None
    assert course.learned.model is not None


def test_the_loops_targets_are_medians_over_seeds_by_plant():
    def cell(plant: str, ratio: float, rmse: float | None, least: float | None = None) -> dict[str, Any]:
        return {"plant": plant, "ratio": ratio, "bound": 0.1, "flow_ratio": 0.2, "rmse": rmse, "rmse_of_run": 0.02,
                "least": least}  # fmt: skip

    cells = [cell("a", 0.1, 0.02, 0.15), cell("a", 0.12, 0.024), cell("b", 0.3, None), cell("b", 0.14, 0.03)]
    reached, as_good = loop.targets(cells)
    assert (reached["value"], reached["met"]) == (1, False)
    assert reached["ratio"] == pytest.approx({"a": 0.11, "b": 0.22})
    assert reached["least_flow_over_time"] == {"a": 0.15}  # of one seed a plant, which is bounded
    assert as_good["by_plant"] == pytest.approx({"a": 1.1, "b": 1.5})
    assert (as_good["value"], as_good["met"], as_good["failed"]) == (pytest.approx(1.3), False, 1)
    assert loop.targets([]) == []


def test_sessions_by_photographs_are_judged_by_every_photograph():
    cells = [
        {"plant": "a", "seed": 0, "widths": [0.02, 0.06], "ratio": 0.2, "rmse": 0.04, "rmse_weighed": 0.01,
         "rmse_weighed_once": 0.03},
        {"plant": "b", "seed": 0, "widths": [0.03], "ratio": 0.1, "rmse": 0.04, "rmse_weighed": None,
         "rmse_weighed_once": 0.02},
    ]  # fmt: skip
    row, weighed = photo_session.targets(cells)
    assert (weighed["value"], weighed["met"], weighed["failed"]) == (0.25, True, 1)
    assert weighed["only_the_first_weighed"] == 0.75
    assert (row["value"], row["met"], row["worst"], row["photographs"]) == (0.03, True, 0.06, 3)
    assert not photo_session.targets([])[0]["met"]
