"""Speed limits by partition on rows, and where to wait."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gcodectl.config import load_machine
from gcodectl.motion.limits import Limit, motion_limits
from gcodectl.pipeline import Options, read_moves, time_moves
from gcodectl.records import Flag, Kind, Moves
from gcodectl.thermal.course import Course
from gcodectl.thermal.limiting import Segments, limit_speeds, merged, put_wait, waiting_place

MACHINE = dataclasses.replace(load_machine("syringe"), max_flow=1e6, max_flow_slew=1e9)
HEAD = "G21\nG90\nM83\nG1 X0 Y0 Z1 F600\n"
ROAD = HEAD + "G1 X100 E5\nG1 X100 Y50\nG1 X0 Y50 E5\n"

FREE = np.zeros(7)


def moves_of(text: str) -> Moves:
    return Moves.concat(list(read_moves([text.encode()], Options(MACHINE))))


def course_of(moves: Moves) -> Course:
    return Course.of(time_moves([moves], MACHINE))


def test_a_course_knows_what_deposits_and_what_does_not() -> None:
    course = course_of(moves_of(ROAD))
    dep, other = course.at(np.array([0.0, 50.0, 99.999, 100.001, 200.0]))
    assert dep == pytest.approx([0.0, 5.0, 10.0, 10.0, 20.0], abs=0.3)
    assert other[3] - other[2] == pytest.approx(5.0, abs=0.3)
    assert course.when(np.array([200.0]))[0] == pytest.approx(course.lasts)
    assert course.where(np.array([5.0, 15.0])) == pytest.approx([50.0, 150.0], abs=2.0)


def test_limits_make_partitions_last_as_long_as_asked() -> None:
    moves = moves_of(ROAD)
    course = course_of(moves)
    bounds = np.array([0.0, 60.0, 130.0])
    segments = Segments(course, bounds, moves, np.full(len(moves), 1.0))
    free = segments.seconds(np.full(3, np.inf))
    assert free.sum() == pytest.approx(course.duration.sum())
    limits = segments.limits(free * [1.0, 2.0, 3.0])
    assert segments.seconds(limits) == pytest.approx(free * [1.0, 2.0, 3.0], rel=1e-6)
    assert limits[1:] == pytest.approx([5.0, 10.0 / 3.0], rel=0.03)
    least = Segments(course, bounds, moves, np.full(len(moves), 4.0))
    assert least.limits(free * 100.0) == pytest.approx(4.0)
    assert merged(limits, np.array([1.0, 2.0, 3.0]))[0] == np.inf
    assert merged(np.array([5.0, 5.01, 4.0]), np.full(3, 2.0)).tolist() == [5.0, 5.0, 4.0]


def test_no_row_is_slowed_below_its_least() -> None:
    moves = moves_of(HEAD + "G1 X40 E2\nG1 X80 E2 F300\nG1 X80 Y1 E0.1 F3000\n")
    least = 0.5 * moves.feed
    course, bounds = course_of(moves), np.zeros(1)
    segments = Segments(course, bounds, moves, least)
    assert segments.seconds(np.zeros(1))[0] == pytest.approx(40.0 / 5.0 + 40.0 / 2.5 + 0.1, abs=0.4)
    longest = segments.limits(np.array([1e6]))
    out = limit_speeds(moves, bounds, longest, least, 2.0, np.nan)
    assert out.heat[out.deposits] == pytest.approx([5.0, 2.5, 25.0]), (
        "the last row is a ramp, and slower than that already"
    )
    assert course_of(out).duration.sum() == pytest.approx(segments.seconds(longest)[0], rel=0.03)


def test_rows_are_cut_where_limits_change_and_only_what_deposits_is_limited() -> None:
    moves = moves_of(ROAD)
    bounds, limits = np.array([0.0, 60.0, 130.0]), np.array([np.inf, 4.0, 6.0])
    out = limit_speeds(moves, bounds, limits, FREE, 2.0, np.nan)
    lays = out.deposits
    assert out.length[lays] == pytest.approx([60.0, 40.0, 30.0, 70.0])
    assert out.heat[lays].tolist() == [0.0, 4.0, 4.0, 6.0]
    assert not out.heat[~lays].any()
    assert out.e[lays].sum() == pytest.approx(10.0)
    assert np.array_equal(out.row, np.arange(len(out)))
    found = motion_limits(out, MACHINE)
    assert found.limited_by[lays].tolist() == [Limit.FEED, Limit.HEAT, Limit.HEAT, Limit.HEAT]
    assert found.cruise[lays].tolist() == [10.0, 4.0, 4.0, 6.0]


def test_a_boundary_near_a_rows_end_cuts_nothing() -> None:
    out = limit_speeds(moves_of(ROAD), np.array([0.0, 98.0]), np.array([np.inf, 4.0]), FREE, 2.0, np.nan)
    assert out.heat[out.deposits].tolist() == [0.0, 4.0]


def test_what_is_slow_already_stays_as_it_is() -> None:
    out = limit_speeds(moves_of(ROAD), np.array([0.0]), np.array([12.0]), FREE, 2.0, np.nan)
    assert not out.heat.any()
    assert not (out.flags & int(Flag.PART)).any()


PLACES = {
    "behind the retract, at the lift": ("G1 E-1\nG1 Z9\nG1 X0 Y0\nG1 Z2\nG1 E1\n", "G1 Z2\n"),
    "firmware's own retract": ("G10\nG1 X5\nG11\n", "G11\n"),
    "no retract: behind the travel": ("G1 Z2\nG92 E0\nG1 X0 Y0\n", "G1 X50 E5\n"),
    "a retract, and a wipe behind it": ("G1 E-1\nG1 X80 E-1\nG1 Z9\nG1 X0 Y0\nG1 E2\n", "G1 E2\n"),
    "what pushes first ends the stretch": ("G1 E-1\nG1 Z9\nG1 E1\nG1 Z30\nG1 X0\n", "G1 E1\n"),
}


@pytest.mark.parametrize("name", PLACES)
def test_the_wait_stands_off_the_road(name: str) -> None:
    between, before = PLACES[name]
    moves = moves_of(HEAD + "G1 X100 E5\n" + between + "G1 X50 E5\n")[5:]
    place = waiting_place(moves)
    assert place is not None
    assert moves.raw(place) == before.encode()


def test_without_anything_between_two_roads_there_is_no_place() -> None:
    moves = moves_of(HEAD + "G1 X100 E5\n;mark\nM106 S9\nG1 X50 E5\n")[5:]
    assert waiting_place(moves) is None


def test_a_wait_is_a_row_of_its_own_that_rests() -> None:
    moves = moves_of(ROAD)
    out = put_wait(moves, 5, 12.5)
    assert len(out) == len(moves) + 1
    assert (out.kind[5], out.dwell[5], out.raw(5)) == (Kind.DWELL, 12.5, b"")
    assert np.array_equal(out.p0[5], moves.p0[5])
    assert np.array_equal(out.e_end[5], out.e_end[4], equal_nan=True)
    numbered = out.replace(row=np.arange(len(out)))
    assert course_of(numbered).lasts == pytest.approx(course_of(moves).lasts + 12.5, abs=3.0)
