"""What people are told of heat is what happened."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from heating import PROFILE, heated, rings

from gcodectl.cli.heat import heat_rows
from gcodectl.thermal.surface import Band, Head
from gcodectl.thermal.tally import Count, Tally


@pytest.mark.parametrize(
    ("cold", "by", "said"), [(1312, 61.0, "waited for"), (29037, 20.0, "waited for"), (29037, 61.0, "as the file has")]
)
def test_locations_that_the_plan_made_colder_are_not_told_to_run_as_sliced(cold: int, by: float, said: str) -> None:
    sliced, planned = Count(hot=149, cold=cold, cold_by=by), Count(cold=29037, cold_by=61.0)
    tally = Tally(Band(), 0.9, locations=32758, beneath=30555, sliced=sliced, planned=planned)
    (row,) = (row for row in heat_rows(tally) if "too cold (" in row)
    assert said in row
    assert ("as the file has" in row) == (said == "as the file has")


@pytest.mark.parametrize(
    ("stuck", "said", "unsaid"),
    [
        (9, ["the head may go no slower"], ["alpha", "of them"]),
        (0, ["they are within"], ["no place off"]),
        (4, ["for 4 of them the head", "5 of them are within"], []),
    ],
)
def test_what_stays_hot_is_told_with_its_own_reason(stuck: int, said: list[str], unsaid: list[str]) -> None:
    planned = Count(hot=9, hot_by=3.0)
    tally = Tally(Band(), 0.9, locations=200, beneath=100, planned=planned, waits=3, stuck=stuck, fastest=50.0)
    (row,) = (row for row in heat_rows(tally) if "stay too hot" in row)
    assert all(words in row for words in said)
    assert not any(words in row for words in unsaid)


@pytest.mark.parametrize(("slowest", "speed", "told"), [(100.0, 60.0, 1), (100.0, 200.0, 0), (0.0, 60.0, 0)])
def test_a_head_that_cannot_be_slowed_to_the_files_speeds_is_told_once(slowest: float, speed: float, told: int) -> None:
    head = Head(slowest, 400.0, 200.0) if slowest else None
    _, summary = heated(rings(3, speed=speed), dataclasses.replace(PROFILE, head=head))
    assert summary.heat is not None
    assert sum("nothing can be slowed" in row for row in heat_rows(summary.heat)) == told
    assert (summary.heat.slowed == 0) == bool(told)


def test_places_to_wait_at_are_counted_apart() -> None:
    hurried = dataclasses.replace(PROFILE, head=Head(190.0, 400.0, 200.0))
    assert heated(rings(3), hurried)[1].heat.stuck == 0  # type: ignore[union-attr]
    turns = ["G21", "G90", "M83", "G1 X0 Y0 Z5 F6000"]
    for k in range(12):
        x, y = [(900, 0), (900, 600), (0, 600), (0, 0)][k % 4]
        turns.append(f"G1 X{x} Y{y} Z{5 + 1.25 * (k + 1):g} E250 F12000")
    heat = heated("\n".join([*turns, ""]), hurried)[1].heat
    assert heat is not None
    assert heat.stuck == heat.planned.hot > 0
    assert heat.waits == 0


def test_rounding_is_not_counted_as_too_hot() -> None:
    count = Count()
    count.add(np.array([119.0, 119.98, 135.0, 150.01, 151.0]), Band())
    assert (count.hot, count.cold) == (1, 1)
