import dataclasses
import math

import numpy as np
import pytest
from moves import BEAD, SYRINGE, Pen, plain_python

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.motion.limits import Limit, motion_limits
from gcodectl.records import Kind, Moves

OPEN = dataclasses.replace(SYRINGE, max_speed=(1e12, 1e12, 1e12), max_flow=1e12)
"""No limit but the file's and the centripetal acceleration."""


def cruise(moves: Moves, machine: Machine = SYRINGE) -> Floats:
    return motion_limits(moves, machine).cruise


def why(moves: Moves, machine: Machine = SYRINGE) -> list[int]:
    return motion_limits(moves, machine).limited_by.tolist()


def unfed(moves: Moves) -> Moves:
    """The same without feed rates."""
    return moves.replace(feed=np.full(len(moves), np.nan))


def test_the_feed_rate_is_a_limit_where_it_is_known() -> None:
    moves = Pen().go(10, 0, feed=12).go(20, 0, feed=math.nan).moves()
    assert cruise(moves).tolist() == [12.0, 200.0]
    assert why(moves) == [Limit.FEED, Limit.AXIS]


def test_each_axis_keeps_its_own_speed() -> None:
    moves = Pen().go(3, 0, 4).go(3, 0, 4.5).push(1).arc((0, 0), 1.0).arc((4, 0), 1.0, plane=1).moves()
    fast = dataclasses.replace(SYRINGE, max_flow=1e12, accel=1e12, travel_accel=1e12, z_accel=1e12)
    assert cruise(unfed(moves), fast)[[0, 1, 3, 4]] == pytest.approx([25.0, 20.0, 200.0, 20.0])
    assert cruise(unfed(moves), fast)[2] > 1e9


def test_a_move_along_an_axis_by_next_to_nothing_is_no_warning() -> None:
    assert cruise(unfed(Pen().go(1e-310, 5).moves())) == pytest.approx([200.0])


def test_the_plunger_keeps_max_flow_both_ways() -> None:
    slow = dataclasses.replace(SYRINGE, max_flow=2.0)
    moves = Pen().road(10, 0, bead=0.5).push(-1.0).go(20, 0).dwell(1).go(30, 0, e=-10 / SYRINGE.area).moves()
    assert cruise(moves, slow) == pytest.approx([4.0, 2.0 / SYRINGE.area, moves.feed[2], 0.0, 2.0])
    assert why(moves, slow) == [Limit.FLOW, Limit.FLOW, Limit.FEED, Limit.NONE, Limit.FLOW]


def test_arcs_keep_the_centripetal_acceleration() -> None:
    moves = Pen(at=(2, 0, 0)).arc((0, 0), math.pi, feed=500).go(0, 0, feed=500).arc((0, 3), 1.0, feed=500).moves()
    assert cruise(moves)[[0, 2]] == pytest.approx([math.sqrt(1000), math.sqrt(1500)])
    assert why(moves) == [Limit.CURVE, Limit.AXIS, Limit.CURVE]
    turned = Pen(at=(0, 0, 2)).arc((0, 0), 1.0, plane=1).moves()
    accel = motion_limits(turned, OPEN).accel[0]
    assert cruise(unfed(turned), OPEN) == pytest.approx([math.sqrt(accel * 2)])


def test_standing_and_unknown_rows_have_no_speed_and_no_distance() -> None:
    pen = Pen().dwell(1).barrier().tool(1).plain(Kind.RETRACT).plain(Kind.UNRETRACT).plain().lost(5, 5).go(5, 5)
    moves = pen.moves()
    limits = motion_limits(moves, SYRINGE)
    assert limits.distance.tolist() == [0.0] * 8
    assert limits.cruise.tolist() == [0.0] * 8
    assert limits.limited_by.tolist() == [Limit.NONE] * 8
    assert limits.rests.tolist() == [True] * 5 + [False, True, False]
    assert [limit.label for limit in Limit] == [
        "", "feed rate", "axis speed", "plunger", "arc's curvature", "plunger at starts", "plunger at stops",
        "heat beneath",
    ]  # fmt: skip


def test_distance_is_the_path_or_else_what_e_moves() -> None:
    moves = Pen().go(3, 4, e=9).push(-0.8).arc((0, 4), -1.0).go(*Pen().at[:2], e=math.nan).push(math.nan).moves()
    assert motion_limits(moves, SYRINGE).distance[:3] == pytest.approx([5.0, 0.8, 3.0])
    assert motion_limits(moves, SYRINGE).distance[4] == 0.0
    assert np.isfinite(motion_limits(moves, SYRINGE).cruise).all()


def test_acceleration_is_the_files_or_the_machines_and_what_z_and_plunger_follow() -> None:
    pen = Pen().road(10, 0).road(20, 0, accel=90.0, travel_accel=70.0).go(30, 0, accel=90.0, travel_accel=70.0)
    pen.go(30, 0, 1.0).go(33, 0, 5.0).push(1).road(50, 0, bead=8.0)
    machine = dataclasses.replace(SYRINGE, travel_accel=450.0, e_accel=33.0)
    expected = [500, 90, 70, 100, 100 * 5 / 4, 33, 2000 / 8]
    assert motion_limits(pen.moves(), machine).accel == pytest.approx(expected)


def test_a_file_sets_the_corner_speed() -> None:
    moves = Pen().road(10, 0).road(20, 0, corner_speed=1.5).moves()
    assert motion_limits(moves, SYRINGE).corner_speed.tolist() == [5.0, 1.5]


def test_no_rows_no_limits() -> None:
    assert len(motion_limits(Pen().road(1, 1).moves()[:0], SYRINGE).cruise) == 0


def test_a_bead_limits_speed_by_its_flow() -> None:
    moves = Pen().road(10, 0, feed=300, bead=BEAD).moves()
    assert cruise(moves) == pytest.approx([SYRINGE.max_flow / BEAD])


def test_the_same_with_the_jit_off() -> None:
    pen = Pen(at=(2, 0, 0)).arc((0, 0), math.pi, feed=500).road(10, 0).push(-1.0).go(5, 5, 2).dwell(1).lost(5, 5)
    moves = pen.go(5, 5).moves()
    one = motion_limits(moves, SYRINGE)
    with plain_python("gcodectl.motion"), np.errstate(all="ignore"):
        other = motion_limits(moves, SYRINGE)
    assert np.array_equal(one.table, other.table)
    assert np.array_equal(one.limited_by, other.limited_by)
    assert np.array_equal(one.rests, other.rests)
