import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import SYRINGE, Pen, chunked, pens, plain_python, same

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.motion.junction import junction_kernel
from gcodectl.motion.limits import motion_limits
from gcodectl.motion.lookahead import IDLE, plan
from gcodectl.motion.ramp import ramp_distance_kernel
from gcodectl.path import tangents
from gcodectl.records import Moves, SpeedPlan

SMOOTH = dataclasses.replace(SYRINGE, jerk=2_000.0)


def planned(moves: Moves, size: int = 10_000, machine: Machine = SYRINGE) -> tuple[Moves, SpeedPlan]:
    pieces = list(plan(chunked(moves, size), machine))
    return Moves.concat([piece[0] for piece in pieces]), SpeedPlan.concat([piece[1] for piece in pieces])


def junction(degrees: float, length: float = 1e9, accel: float = 500.0, corner: float = 5.0) -> float:
    return float(junction_kernel(math.cos(math.radians(degrees)), accel, accel, corner, corner, length, length))


def test_a_right_angle_is_taken_at_the_square_corner_velocity() -> None:
    for accel in (100.0, 500.0, 3000.0):
        assert junction(90, accel=accel) == pytest.approx(math.sqrt(25.0), rel=1e-12)
    assert junction(90, corner=8.0) == pytest.approx(8.0)


def test_other_angles_by_hand() -> None:
    # 60 degrees of turn leave 120 between the moves: s = sin 60; r = deviation s / (1 - s); v^2 = a r
    s = math.sin(math.radians(60))
    assert junction(60) == pytest.approx(math.sqrt(25 * (math.sqrt(2) - 1) * s / (1 - s)))
    assert junction(150) == pytest.approx(
        math.sqrt(25 * (math.sqrt(2) - 1) * math.sin(math.radians(15)) / (1 - math.sin(math.radians(15))))
    )
    assert junction(0) == math.inf
    assert junction(180) == 0.0


def test_short_moves_make_a_corner_slower() -> None:
    # the arc may not be longer than the moves: v^2 <= a d tan(60) / 2 for a turn of 60 degrees
    assert junction(60, length=0.01) == pytest.approx(math.sqrt(500 * 0.01 * math.sqrt(3) / 2))


def test_the_slower_of_two_moves_decides_a_corner() -> None:
    cosine = math.cos(math.radians(90))
    assert junction_kernel(cosine, 500, 500, 5, 2, 1e9, 1e9) == pytest.approx(2.0)
    assert junction_kernel(cosine, 500, 100, 5, 5, 1e9, 1e9) == pytest.approx(5.0)
    assert junction_kernel.py_func(cosine, 500, 100, 5, 5, 1e9, 0.1) == pytest.approx(
        junction_kernel(cosine, 500, 100, 5, 5, 1e9, 0.1)
    )


def test_a_corner_between_two_lines() -> None:
    _, speeds = planned(Pen().go(20, 0).go(20, 20).moves())
    assert speeds.entry.tolist() == [0.0, pytest.approx(5.0)]
    assert speeds.exit.tolist() == [pytest.approx(5.0), 0.0]
    assert speeds.cruise.tolist() == [10.0, 10.0]
    assert speeds.run.tolist() == [0, 1]


def test_short_moves_in_line_are_one_run() -> None:
    pen = Pen()
    for k in range(1, 11):
        pen.go(0.03 * k, 0)  # no longer than RUN_RAMPS ramps together
    _, speeds = planned(pen.moves())
    assert set(speeds.run.tolist()) == {0}
    assert not speeds.entry.any()
    assert not speeds.exit.any()


def test_an_arc_runs_on_smoothly_from_a_line() -> None:
    pen = Pen().go(10, 0).arc((10, 3), math.pi / 2, feed=10).go(13, 10)
    _, speeds = planned(pen.moves())
    assert speeds.entry[1:] == pytest.approx([10.0, 10.0])
    _, sharp = planned(Pen().go(10, 0).arc((13, 0), math.pi / 2, feed=10).moves())
    assert sharp.exit[0] == pytest.approx(5.0)


def promises(moves: Moves, speeds: SpeedPlan, machine: Machine) -> None:
    """Every limit is kept, every run can stop in its length, every corner is taken at its speed."""
    limits = motion_limits(moves, machine)
    assert np.array_equal(speeds.distance, limits.distance)
    assert np.array_equal(speeds.rests, limits.rests)
    moving = np.flatnonzero(speeds.distance > 0)
    assert (speeds.entry <= speeds.cruise).all()
    assert (speeds.exit <= speeds.cruise).all()
    assert (speeds.cruise <= limits.cruise).all()
    assert (speeds.run[1:] >= speeds.run[:-1]).all()
    start, end = tangents(moves)
    before = -1
    for k in moving.tolist():
        rested = before < 0 or speeds.rests[before:k].any()
        if not rested and speeds.run[before] == speeds.run[k]:
            assert speeds.cruise[before] == speeds.cruise[k]
        elif rested or not (moves.length[k] > 0 and moves.length[before] > 0):
            assert speeds.entry[k] == 0.0
            assert before < 0 or speeds.exit[before] == 0.0
        else:
            assert speeds.exit[before] == speeds.entry[k]
        if not rested and moves.length[k] > 0 and moves.length[before] > 0:
            most = junction_kernel(
                float(end[before] @ start[k]), limits.accel[before], limits.accel[k], limits.corner_speed[before],
                limits.corner_speed[k], limits.distance[before], limits.distance[k],
            )  # fmt: skip
            reached = speeds.cruise[k] if speeds.run[before] == speeds.run[k] else speeds.entry[k]
            assert reached <= most * (1 + 1e-9)
        before = k
    if len(moving):
        assert speeds.exit[moving[-1]] == 0.0
    for run in np.unique(speeds.run[moving]):
        rows = moving[speeds.run[moving] == run]
        one = rows[0]
        assert len({speeds.accel[row] for row in rows}) == 1
        need = ramp_distance_kernel(speeds.entry[one], speeds.exit[one], speeds.accel[one], machine.jerk)
        assert need <= speeds.distance[rows].sum() * (1 + 1e-9)


@given(pens(most=40), st.sampled_from([SYRINGE, SMOOTH]))
def test_limits_are_kept_and_the_machine_can_always_stop(pen: Pen, machine: Machine) -> None:
    moves, speeds = planned(pen.moves(), machine=machine)
    promises(moves, speeds, machine)


@given(pens(most=60), st.sampled_from([1, 2, 7, 37]), st.sampled_from([SYRINGE, SMOOTH]))
def test_any_chunking_gives_the_same_plan(pen: Pen, size: int, machine: Machine) -> None:
    moves = pen.moves()
    whole, speeds = planned(moves, machine=machine)
    same(whole, moves)
    rows, pieces = planned(moves, size, machine)
    same(rows, moves)
    same(pieces, speeds)


def test_a_long_road_leaves_before_it_ends() -> None:
    pen = Pen()
    for k in range(4000):
        pen.road(0.05 * (k + 1), 0)
    held = [0]
    given_in = 0

    def watched() -> Floats:  # type: ignore[misc]
        nonlocal given_in
        for chunk in chunked(pen.moves(), 50):
            given_in += len(chunk)
            yield chunk

    out = 0
    for moves, _ in plan(watched(), SYRINGE):  # type: ignore[arg-type]
        out += len(moves)
        held.append(given_in - out)
    assert out == 4000
    assert max(held) < 300


@settings(max_examples=3)
@given(pens(most=30))
def test_the_same_with_the_jit_off(pen: Pen) -> None:
    moves = pen.moves()
    _, expected = planned(moves)
    with plain_python("gcodectl.motion", "gcodectl.path"), np.errstate(all="ignore"):
        _, plain = planned(moves)
    for name in ("run", "entry", "exit", "cruise"):
        assert np.allclose(getattr(plain, name), getattr(expected, name), rtol=1e-9, atol=1e-9)


def test_nothing_in_nothing_out() -> None:
    assert list(plan(iter([]), SYRINGE)) == []
    assert list(plan(iter([Moves.empty()]), SYRINGE)) == []
    for pen in (Pen().plain(), Pen().plain().plain().dwell(1), Pen().barrier(), Pen().lost(1, 1).plain()):
        for size in (1, 9):
            rows, speeds = planned(pen.moves(), size)
            assert len(rows) == len(speeds) == len(pen.rows)
            assert not speeds.cruise.any()


def standing_between(rows: int) -> Moves:
    pen = Pen().go(30, 0)
    for _ in range(rows):
        pen.plain()
    return pen.go(60, 0).barrier().plain().go(90, 0).moves()


def test_rows_without_motion_leave_before_the_next_move_comes() -> None:
    assert planned(standing_between(IDLE - 1))[1].exit[0] > 0.0
    moves = standing_between(IDLE + 2_000)
    whole, plans = planned(moves, size=len(moves))
    same(whole, moves)
    assert plans.exit[0] == 0.0, "no firmware goes on while it reads so many lines"
    for size in (700, IDLE - 1, IDLE + 1):
        pieces = list(plan(chunked(moves, size), SYRINGE))
        same(SpeedPlan.concat([speeds for _, speeds in pieces]), plans)
        assert len(pieces[0][0]) <= IDLE + size
