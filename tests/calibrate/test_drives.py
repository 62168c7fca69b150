"""What one kind of drive needs says nothing of another's."""

from __future__ import annotations

import dataclasses

import pytest
from known import by_rule

from gcodectl.calibrate.calibration import Attributes
from gcodectl.calibrate.drives import by_drive, drive_of, same_drive
from gcodectl.calibrate.evaluation import evaluate
from gcodectl.calibrate.suggestion import suggest
from gcodectl.errors import UnsafeError, UsageError

NEW = Attributes("new", elasticity="high", nozzle_diameter=1.0, path_width=1.0, path_height=0.7)


def with_tool(calibrations, tool):
    return [
        dataclasses.replace(one, attributes=dataclasses.replace(one.attributes, tool=tool)) for one in calibrations
    ]  # fmt: skip


def longer(calibrations, factor):
    return [
        dataclasses.replace(
            one, parameters=dataclasses.replace(one.parameters, pushouttime=factor * one.parameters.pushouttime)
        ) for one in calibrations
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("tool", "kind"),
    [
        (None, None), (" ", None), ("10cc syringe", "syringe pump"), ("syringe pump", "syringe pump"),
        ("Air pressure", "air pressure"), ("pneumatic syringe", "air pressure"), ("air-fed auger", "screw"),
        ("lead screw syringe", "syringe pump"), ("extruder screw", "screw"), ("Bowden, 1.75", "filament"),
        ("My  Robot", "my robot"),
    ],
)  # fmt: skip
def test_a_tools_name_tells_its_kind(tool, kind):
    assert drive_of(tool) == kind


def test_a_guess_for_another_kind_of_drive_is_refused():
    known = with_tool(by_rule(6, 2), "10cc syringe")
    with pytest.raises(UnsafeError, match=r"nothing is known of air pressure tools, only of syringe pump \(12\)"):
        suggest(known, dataclasses.replace(NEW, tool="air pressure"))
    assert suggest(known, dataclasses.replace(NEW, tool="syringe pump")).parameters.pushouttime


def test_a_guess_is_of_the_same_kind_of_drive_alone():
    pumps = with_tool(by_rule(6, 2), "syringe pump")
    air = with_tool(longer(by_rule(6, 2), 50.0), "air pressure")
    alone = suggest(pumps, dataclasses.replace(NEW, tool="syringe pump"))
    both = suggest([*pumps, *air], dataclasses.replace(NEW, tool="syringe"))
    assert both.parameters.pushouttime == pytest.approx(alone.parameters.pushouttime)
    assert any("12 calibrations of other tools are left out" in note for note in both.notes)
    with pytest.raises(UsageError, match=r"for which tool\? the known ones are air pressure, syringe pump"):
        suggest([*pumps, *air], NEW)


def test_what_is_not_told_is_said():
    known = with_tool(by_rule(3, 2), "syringe pump")
    assert same_drive(known, NEW)[1] == ["no tool is told: taken for syringe pump, as the known ones are"]
    kept, notes = same_drive(by_rule(3, 2), dataclasses.replace(NEW, tool="auger"))
    assert len(kept) == 6
    assert notes == ["no known calibration tells its tool: whether they hold for screw is not known"]
    assert same_drive(by_rule(3, 2), NEW)[1] == []


def test_an_evaluation_guesses_each_kind_of_drive_by_itself():
    pumps = with_tool(by_rule(6, 2), "syringe pump")
    air = [
        dataclasses.replace(one, attributes=dataclasses.replace(one.attributes, material=f"{one.material} of air"))
        for one in with_tool(longer(by_rule(4, 2), 50.0), "air pressure")
    ]  # fmt: skip
    found = {(one.parameter, one.learner): one for one in evaluate([*pumps, *air])}
    pushout = found["pushouttime", "mean"]
    assert len(pushout.one_out) == len(pumps) + len(air)
    assert pushout.median(pushout.material_out) < 5.0  # one mean for both would be off by a factor of seven at least
    assert set(by_drive([*pumps, *air])) == {"syringe pump", "air pressure"}
    with pytest.raises(UsageError, match="at least two materials"):
        evaluate([*with_tool(by_rule(1, 2), "syringe"), *with_tool(by_rule(1, 2), "air")])
