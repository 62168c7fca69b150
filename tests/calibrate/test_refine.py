"""Graded prints lead to the setting that is ok, on a road whose response is known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gcodectl.calibrate.calibration import GRADES, Attributes, Calibration, Parameters
from gcodectl.calibrate.refine import (
    Wanted,
    grade_chances,
    is_graded,
    lateness,
    refined,
    same_road,
    setting,
    wanted_before,
    worse_of,
)
from gcodectl.calibrate.suggestion import own_prints, suggest

ROAD = Attributes("new", nozzle_diameter=0.84, path_width=0.84, path_height=0.6)
TOLD = Parameters(
    acceldelay=0.1, pushoutspeed=20.0, pushouttime=0.3, inputspeed=5.0, outputspeed=10.0,
    deceldelay=0.15, pullbackspeed=20.0, pullbacktime=0.25,
)  # fmt: skip


def printed(parameters=TOLD, start="ok", stop="ok"):
    return Calibration(dataclasses.replace(ROAD, start_error=start, stop_error=stop), parameters)


def graded(wanted, parameters):
    """Return the print with the grades that the rule gives it."""
    late = lateness(np.array(wanted), printed(parameters))
    grades = []
    for pair in (late[:2], late[2:]):
        worst = pair[np.argmax(np.abs(pair))]
        level = int(np.digitize(worst, [-3.0, -1.0, 1.0, 3.0]))
        grades.append(GRADES[level])
    return printed(parameters, *grades)


def before():
    rng = np.random.default_rng(0)
    misses = rng.normal(scale=[[0.5], [0.15], [0.5], [0.15]], size=(4, 20))
    materials = [f"m{k // 2}" for k in range(20)]
    return wanted_before([np.log(0.31), 0.33, np.log(0.26), 0.6], misses, materials, ROAD)


def test_what_the_knobs_do_is_kinematics():
    one = printed()
    assert lateness(setting(one), one) == pytest.approx(np.zeros(4))
    later = setting(one) + np.array([0.0, 0.1, 0.0, 0.05])
    assert lateness(later, one) == pytest.approx(np.array([1.0, 1.0, 0.5, 0.5]) / 0.84)
    longer = setting(one) + np.array([0.02, 0.0, 0.03, 0.0])
    bead = 0.84 * 0.84 * 0.6
    assert lateness(longer, one) == pytest.approx([0.0, 15.0 * 0.02 / bead, 0.0, 20.0 * 0.03 / bead])


def test_the_worse_of_place_and_amount_is_the_grade():
    each = grade_chances(np.array([[0.0, 0.0, 0.0, 9.0], [0.0, -2.0, 2.0, 0.0]]))
    start, stop = worse_of(each[:, 0], each[:, 1]), worse_of(each[:, 2], each[:, 3])
    assert start.sum(axis=1) == pytest.approx([1.0, 1.0])
    assert [GRADES[k] for k in start.argmax(axis=1)] == ["ok", "early"]
    assert [GRADES[k] for k in stop.argmax(axis=1)] == ["very late", "late"]


def test_place_and_amount_told_apart_say_more():
    apart = dataclasses.replace(ROAD, start_place="ok", start_amount="very late", stop_place="ok")
    assert apart.grades == ("very late", "ok")
    worse = before().after(printed(start="very late"))
    finer = before().after(Calibration(apart, TOLD))
    chances = [one.weight @ np.abs(one.knobs[:, 1] - TOLD.acceldelay) for one in (worse, finer)]
    assert chances[1] < 0.8 * chances[0]  # the place was ok: so was the delay


def test_grades_move_the_next_setting_the_right_way():
    late, _ = refined(before(), [printed(start="very late", stop="very early")])
    assert late.pushouttime + late.acceldelay > TOLD.pushouttime + TOLD.acceldelay
    assert late.pullbacktime + late.deceldelay < TOLD.pullbacktime + TOLD.deceldelay
    assert (late.inputspeed, late.outputspeed, late.pushoutspeed) == (5.0, 10.0, 20.0)
    good, _ = refined(before(), [printed(start="late"), printed(TOLD), printed(start="early")])
    assert good == TOLD  # was ok at both ends


def test_prints_lead_to_ok_in_a_few_steps_and_faster_than_turning_one_step_at_a_time():
    rng = np.random.default_rng(4)
    steps = []
    for _ in range(8):
        wanted = before().knobs[4 * rng.integers(1500) + 1]  # none of the odd ones
        prints = [graded(wanted, TOLD)]
        while (prints[-1].attributes.start_error, prints[-1].attributes.stop_error) != ("ok", "ok"):
            prints.append(graded(wanted, refined(before(), prints)[0]))
            assert len(prints) < 20
        steps.append(len(prints))
    assert np.median(steps) <= 4


def test_what_is_left_narrows_and_its_weights_sum_to_one():
    wide = before()
    _, narrow = refined(wide, [printed(start="late", stop="ok")])
    assert narrow.weight.sum() == pytest.approx(1.0)
    (low, high), (was_low, was_high) = narrow.within(0.8), wide.within(0.8)
    assert high[2] - low[2] < was_high[2] - was_low[2]
    assert np.all(low < high)
    two = Wanted(np.array([[1.0, 0, 0, 0], [3.0, 0, 0, 0]]), np.log([0.25, 0.75]))
    assert two.within(0.5)[0][0] == 1.0
    assert two.within(0.4)[0][0] == 3.0


def test_only_whole_graded_prints_of_the_same_road_count():
    assert is_graded(printed())
    assert not is_graded(Calibration(ROAD, TOLD))
    assert not is_graded(printed(dataclasses.replace(TOLD, inputspeed=None)))
    assert same_road(printed(), dataclasses.replace(ROAD, path_width=0.845))
    assert not same_road(printed(), dataclasses.replace(ROAD, path_width=0.9))
    assert not same_road(printed(), dataclasses.replace(ROAD, nozzle_diameter=None))
    other = Calibration(dataclasses.replace(ROAD, material="other", start_error="ok"), TOLD)
    assert own_prints([printed(), other], dataclasses.replace(ROAD, material="New")) == [printed()]


def known():
    rng = np.random.default_rng(1)
    made = []
    for number in range(12):
        push, pull = 0.3 * np.exp(0.5 * rng.normal(size=2))
        parameters = dataclasses.replace(
            TOLD, pushouttime=float(push), acceldelay=float(push / 3 + 0.05 * rng.normal()),
            pullbacktime=float(pull), deceldelay=float(pull / 2 + 0.05 * rng.normal()),
        )  # fmt: skip
        made.append(Calibration(dataclasses.replace(ROAD, material=f"stuff {number}"), parameters))
    return made


def test_a_suggestion_goes_on_from_the_materials_own_prints():
    first = suggest(known(), ROAD)
    bad = printed(first.parameters, "very late", "very late")
    after = suggest([*known(), bad], ROAD)
    assert after.learners["pushouttime"] == "own prints"
    assert after.parameters.pushouttime > first.parameters.pushouttime
    assert after.low.pushouttime <= after.parameters.pushouttime <= after.high.pushouttime
    assert after.low.pushouttime < after.high.pushouttime
    assert any("after 1 graded print of it on this road" in note for note in after.notes)
    elsewhere = suggest([*known(), bad], dataclasses.replace(ROAD, path_width=0.5))
    assert elsewhere.learners["pushouttime"] != "own prints"


def test_prints_with_nothing_else_known_are_no_reason_to_stop():
    found = suggest([printed(start="late")], ROAD)
    assert found.parameters.pushouttime == pytest.approx(TOLD.pushouttime)
    assert any("only known material" in note for note in found.notes)
