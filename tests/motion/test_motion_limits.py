import dataclasses
import math

import numpy as np
import pytest
from moves import BEAD, SYRINGE, Pen

from gcodectl.motion.limits import (
    Limit,
    acceleration,
    axis_limit,
    cruise,
    curve_limit,
    feed_limit,
    flow_limit,
    motion_limits,
    path_length,
    stops_at,
)
from gcodectl.records import Kind


def test_the_feed_rate_is_a_limit_where_it_is_known() -> None:
    moves = Pen().go(10, 0, feed=12).go(20, 0, feed=math.nan).moves()
    assert feed_limit(moves, SYRINGE).tolist() == [12.0, math.inf]
    speeds, why = cruise(moves, SYRINGE)
    assert speeds.tolist() == [12.0, 200.0]
    assert why.tolist() == [Limit.FEED, Limit.AXIS]


def test_each_axis_keeps_its_own_speed() -> None:
    moves = Pen().go(3, 0, 4).go(3, 0, 4.5).push(1).arc((0, 0), 1.0).arc((4, 0), 1.0, plane=1).moves()
    assert axis_limit(moves, SYRINGE) == pytest.approx([25.0, 20.0, math.inf, 200.0, 20.0])


def test_a_move_along_an_axis_by_next_to_nothing_is_no_warning() -> None:
    assert axis_limit(Pen().go(1e-310, 5).moves(), SYRINGE) == pytest.approx([200.0])


def test_the_plunger_keeps_max_flow_both_ways() -> None:
    slow = dataclasses.replace(SYRINGE, max_flow=2.0)
    moves = Pen().road(10, 0, bead=0.5).push(-1.0).go(20, 0).dwell(1).go(30, 0, e=-10 / SYRINGE.area).moves()
    assert flow_limit(moves, slow) == pytest.approx([4.0, 2.0 / SYRINGE.area, math.inf, math.inf, 2.0])
    assert cruise(moves, slow)[1].tolist() == [Limit.FLOW, Limit.FLOW, Limit.FEED, Limit.NONE, Limit.FLOW]


def test_arcs_keep_the_centripetal_acceleration() -> None:
    moves = Pen(at=(2, 0, 0)).arc((0, 0), math.pi, feed=500).go(0, 0, feed=500).arc((0, 3), 1.0, feed=500).moves()
    assert curve_limit(moves, SYRINGE) == pytest.approx([math.sqrt(1000), math.inf, math.sqrt(1500)])
    assert cruise(moves, SYRINGE)[1].tolist() == [Limit.CURVE, Limit.AXIS, Limit.CURVE]
    turned = Pen(at=(0, 0, 2)).arc((0, 0), 1.0, plane=1).moves()
    assert curve_limit(turned, SYRINGE) == pytest.approx([math.sqrt(acceleration(turned, SYRINGE)[0] * 2)])


def test_standing_and_unknown_rows_have_no_speed_and_no_distance() -> None:
    pen = Pen().dwell(1).barrier().tool(1).plain(Kind.RETRACT).plain(Kind.UNRETRACT).plain().lost(5, 5).go(5, 5)
    moves = pen.moves()
    limits = motion_limits(moves, SYRINGE)
    assert limits.distance.tolist() == [0.0] * 8
    assert limits.cruise.tolist() == [0.0] * 8
    assert limits.limited_by.tolist() == [Limit.NONE] * 8
    assert stops_at(moves).tolist() == [True] * 5 + [False, True, False]
    assert [limit.label for limit in Limit] == [
        "", "feed rate", "axis speed", "plunger", "arc's curvature", "plunger at starts", "plunger at stops",
    ]  # fmt: skip


def test_distance_is_the_path_or_else_what_e_moves() -> None:
    moves = Pen().go(3, 4, e=9).push(-0.8).arc((0, 4), -1.0).go(*Pen().at[:2], e=math.nan).push(math.nan).moves()
    assert path_length(moves)[:3] == pytest.approx([5.0, 0.8, 3.0])
    assert path_length(moves)[4] == 0.0
    assert np.isfinite(motion_limits(moves, SYRINGE).cruise).all()


def test_acceleration_is_the_files_or_the_machines_and_what_z_and_plunger_follow() -> None:
    pen = Pen().road(10, 0).road(20, 0, accel=90.0, travel_accel=70.0).go(30, 0, accel=90.0, travel_accel=70.0)
    pen.go(30, 0, 1.0).go(33, 0, 5.0).push(1).road(50, 0, bead=8.0)
    machine = dataclasses.replace(SYRINGE, travel_accel=450.0, e_accel=33.0)
    expected = [500, 90, 70, 100, 100 * 5 / 4, 33, 2000 / 8]
    assert acceleration(pen.moves(), machine) == pytest.approx(expected)


def test_a_file_sets_the_corner_speed() -> None:
    moves = Pen().road(10, 0).road(20, 0, corner_speed=1.5).moves()
    assert motion_limits(moves, SYRINGE).corner_speed.tolist() == [5.0, 1.5]


def test_no_rows_no_limits() -> None:
    assert len(motion_limits(Pen().road(1, 1).moves()[:0], SYRINGE).cruise) == 0


def test_a_bead_limits_speed_by_its_flow() -> None:
    moves = Pen().road(10, 0, feed=300, bead=BEAD).moves()
    assert cruise(moves, SYRINGE)[0] == pytest.approx([SYRINGE.max_flow / BEAD])
