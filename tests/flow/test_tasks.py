import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import BEAD, SYRINGE, Pen, chunked, pens, plain_python, same, three_lines

from gcodectl.flow import tasks as stage
from gcodectl.flow.sequencer import TRANSITIONS
from gcodectl.flow.tasks import segment
from gcodectl.motion.lookahead import plan
from gcodectl.motion.profile import profile
from gcodectl.records import Kind, Moves, Profile, TaskKind, Tasks

START, STOP, CORNER = TaskKind.START, TaskKind.STOP, TaskKind.CORNER
STEADY, NO_FLOW = TaskKind.STEADY, TaskKind.NO_FLOW
ONE_ROAD = [NO_FLOW, START, STEADY, STOP, NO_FLOW]


def found(moves: Moves, size: int = 10_000, settle: float = 0.0) -> tuple[Tasks, Profile]:
    pieces = list(segment(profile(plan(chunked(moves, size), SYRINGE), SYRINGE, settle)))
    return Tasks.concat([piece[3] for piece in pieces]), Profile.concat([piece[2] for piece in pieces])


def kinds(pen: Pen) -> list[TaskKind]:
    return [TaskKind(kind) for kind in found(pen.moves())[0].kind]


def test_three_lines_with_two_corners_are_the_papers_sequence() -> None:
    tasks, phases = found(three_lines().moves())
    labels = ["No-Flow", "Start", "Steady-State", "Corner", "Steady-State", "Corner", "Steady-State", "Stop", "No-Flow"]
    assert [TaskKind(kind).label for kind in tasks.kind] == labels
    assert tasks.first.tolist() == [0, 1, 1, 1, 2, 2, 3, 3, 4]
    assert tasks.last.tolist() == [0, 1, 1, 2, 2, 3, 3, 3, 4]
    assert tasks.first_line.tolist() == [row + 1 for row in tasks.first]
    assert tasks.last_line.tolist() == [row + 1 for row in tasks.last]
    assert tasks.road.tolist() == [0] * 8 + [1]
    corners = tasks[tasks.kind == CORNER]
    assert np.column_stack([corners.x, corners.y]).tolist() == [[30, 0], [30, 20]]
    assert tasks.flow[tasks.kind == STEADY] == pytest.approx([10 * BEAD] * 3)
    assert not tasks.dip[tasks.kind != CORNER].any()
    assert tasks.t1[-1] == pytest.approx(phases.duration.sum())


@pytest.mark.parametrize("degrees", [90, 120, 170])
def test_a_dip_is_the_flow_that_the_corner_leaves_out(degrees: float) -> None:
    turn = math.radians(degrees)
    pen = Pen().go(5, 0).road(20, 0).road(20 + 15 * math.cos(turn), 15 * math.sin(turn)).go(0, 0)
    tasks, phases = found(pen.moves())
    corner = tasks[tasks.kind == CORNER]
    assert len(corner) == 1
    times = np.linspace(corner.t0[0], corner.t1[0], 20_001)
    index = np.clip(np.searchsorted(phases.t, times, side="right") - 1, 0, len(phases) - 1)
    late = times - phases.t[index]
    speed = phases.v[index] + late * (phases.a[index] + late * phases.j[index] / 2)
    assert corner.dip[0] == pytest.approx(np.trapezoid(1 - speed / 10.0, times), abs=1e-4)
    assert [*corner.flow, *corner.flow_after] == pytest.approx([10 * BEAD] * 2)


def test_what_belongs_to_no_flow() -> None:
    pen = Pen().go(5, 0).road(20, 0)
    pen.go(18, 0, e=-0.01).push(-0.5).go(18, 0, 0.6).go(40, 0, 0.6, feed=100).go(40, 0, 0.0).push(0.5)
    pen.plain(Kind.RETRACT).plain(Kind.UNRETRACT).dwell(0.2).barrier().plain().go(40, 1)
    assert kinds(pen.road(60, 1).go(61, 1)) == [*ONE_ROAD[:-1], *ONE_ROAD]
    tasks, _ = found(pen.moves())
    assert (tasks.first[4], tasks.last[4]) == (2, len(pen.rows) - 3)


@pytest.mark.parametrize("end", ["barrier", "tool", "dwell", "lost", "travel", "push", "retract", "file"])
def test_what_ends_a_road(end: str) -> None:
    pen = Pen().go(5, 0).road(20, 0)
    after = {
        "barrier": pen.barrier, "tool": lambda: pen.tool(1), "dwell": lambda: pen.dwell(0.1),
        "lost": lambda: pen.lost(30, 0), "travel": lambda: pen.go(30, 0), "push": lambda: pen.push(0.1),
        "retract": lambda: pen.plain(Kind.RETRACT), "file": lambda: pen,
    }  # fmt: skip
    after[end]()
    assert kinds(pen) == ONE_ROAD


@pytest.mark.parametrize("row", ["comment", "still"])
def test_rows_that_do_nothing_end_no_road(row: str) -> None:
    pen = Pen().go(5, 0).road(20, 0)
    pen = pen.plain() if row == "comment" else pen.go(20, 0)
    assert kinds(pen.road(40, 0)) == ONE_ROAD


def test_a_lasting_change_of_speed_or_bead_is_another_steady_state() -> None:
    for pen in (
        Pen().go(5, 0).road(20, 0).road(40, 0, feed=20).go(41, 0),
        Pen().go(5, 0).road(20, 0, feed=20).road(40, 0, feed=10).go(41, 0),
        Pen().go(5, 0).road(20, 0).road(40, 0, bead=2 * BEAD).go(41, 0),
    ):
        tasks, _ = found(pen.moves())
        steady = tasks[tasks.kind == STEADY]
        assert [TaskKind(kind) for kind in tasks.kind] == [NO_FLOW, START, STEADY, STEADY, STOP, NO_FLOW]
        assert steady.flow_after[0] == steady.flow[1] != steady.flow[0]
        assert steady.flow_after[1] == steady.flow[1] == tasks.flow[-2]
    assert kinds(Pen().go(5, 0).road(20, 0).road(40, 0, bead=1.01 * BEAD).go(41, 0)) == ONE_ROAD


def test_a_shallow_ripple_is_no_corner() -> None:
    pen = Pen().go(5, 0).road(20, 0)
    ripple = math.radians(55)  # taken at 9.2 mm/s
    pen.road(20 + 20 * math.cos(ripple), 20 * math.sin(ripple)).go(0, 0)
    assert kinds(pen) == ONE_ROAD


def test_short_roads_start_and_stop_at_once() -> None:
    assert kinds(Pen().go(5, 0).road(5, 0.1).go(4, 0.1)) == [NO_FLOW, START, STOP, NO_FLOW]
    zigzag = Pen().go(5, 0).road(5, 0.3, feed=50).road(5.3, 0.3, feed=50).go(5.3, 9)
    assert kinds(zigzag) == [NO_FLOW, START, CORNER, STOP, NO_FLOW]


def test_peaks_of_speed_too_short_to_cruise_have_corners_between_them() -> None:
    pen = Pen().go(0, 5)
    for k in range(4):
        pen.road(0.3 * (k + 1), 5 + 0.3 * ((k + 1) % 2), feed=50)
    tasks, phases = found(pen.go(5, -50).moves())
    assert [TaskKind(kind) for kind in tasks.kind] == [NO_FLOW, START, *[CORNER] * 3, STOP, NO_FLOW]
    corners = tasks[tasks.kind == CORNER]
    index = np.searchsorted(phases.t, corners.t0, side="right") - 1
    late = corners.t0 - phases.t[index]
    assert np.abs(phases.a[index] + late * phases.j[index]).max() < 1e-6


def test_a_start_is_of_the_layer_and_tool_of_its_road() -> None:
    pen = Pen().tool(2).go(5, 0).road(20, 0, layer=4).go(30, 0)
    tasks, _ = found(pen.moves())
    assert tasks.tool[1:4].tolist() == [2] * 3
    assert tasks.layer[1:4].tolist() == [4] * 3


def test_a_sliver_of_a_phase_does_not_end_a_start() -> None:
    carry = np.zeros(stage.CARRY)
    carry[stage.MODE], carry[stage.LAST_BEAD] = stage.STARTING, BEAD
    out = np.zeros((9, stage.WIDTH))
    for kernel in (stage.phase_kernel, stage.phase_kernel.py_func):
        assert kernel(out, 0, carry, 0.0, 0.01, 0.0, 500.0, 0.0, 1, 1) == 0
        assert kernel(out, 0, carry, 0.01, 1e-15, 5.0, 500.0, 0.0, 1, 1) == 0
        assert kernel(out, 0, carry, 0.01, 0.01, 5.0, 500.0, 0.0, 2, 2) == 0
        assert carry[stage.MODE] == stage.STARTING


def promises(tasks: Tasks, phases: Profile, moves: Moves) -> None:
    """Tasks tile the time, follow the table and name rows in order."""
    assert tasks.t0[0] == 0.0
    assert np.array_equal(tasks.t1[:-1], tasks.t0[1:])
    assert (tasks.t1 >= tasks.t0).all()
    assert tasks.t1[-1] == (phases.t[-1] + phases.duration[-1] if len(phases) else 0.0)
    kinds = tasks.kind.astype(int)
    assert kinds[0] == kinds[-1] == NO_FLOW
    assert TRANSITIONS[kinds[:-1], kinds[1:]].all()
    assert (tasks.last >= tasks.first).all()
    assert (np.diff(tasks.road) >= 0).all()
    assert (np.diff(tasks.road) <= 1).all()
    assert np.isfinite(tasks.flow).all()
    assert np.isfinite(tasks.dip).all()
    assert (tasks.dip >= 0).all()
    roads = tasks[(tasks.kind != NO_FLOW) & (tasks.t1 > tasks.t0)]
    for row in np.flatnonzero(moves.deposits):
        mine = phases[phases.row == row]
        if len(mine) and mine.duration.sum() > 1e-6:
            middle = mine.t[0] + mine.duration.sum() / 2
            holder = np.searchsorted(roads.t0, middle, side="right") - 1
            assert roads.t0[holder] <= middle <= roads.t1[holder]
            assert roads.first[holder] <= row <= roads.last[holder]


@given(pens(most=40))
def test_tasks_tile_time_and_follow_the_table(pen: Pen) -> None:
    moves = pen.moves()
    tasks, phases = found(moves, settle=0.3)
    promises(tasks, phases, moves)


@given(pens(most=60), st.sampled_from([1, 37]))
def test_any_chunking_gives_the_same_tasks(pen: Pen, size: int) -> None:
    moves = pen.moves()
    same(found(moves)[0], found(moves, size)[0])


@given(pens(most=30))
def test_no_signal_is_wanted_before_what_is_known(pen: Pen) -> None:
    known = 0.0
    for *_, tasks, until in segment(profile(plan(chunked(pen.moves(), 1), SYRINGE), SYRINGE)):
        begun = tasks[(tasks.kind != NO_FLOW) & (tasks.kind != STEADY)]
        assert (np.where(begun.kind == STOP, begun.t1, begun.t0) >= known).all()
        changes = tasks[tasks.flow_after != tasks.flow]
        assert (changes.t1 >= known).all()
        assert until >= known
        known = until
    assert known == math.inf


@settings(max_examples=3)
@given(pens(most=30))
def test_the_same_with_the_jit_off(pen: Pen) -> None:
    moves = pen.moves()
    timed = list(profile(plan(chunked(moves, 99), SYRINGE), SYRINGE))
    expected = Tasks.concat([piece[3] for piece in segment(iter(timed))])
    with plain_python("gcodectl.flow.tasks"):
        plain = Tasks.concat([piece[3] for piece in segment(iter(timed))])
    same(plain, expected)


@pytest.mark.parametrize("pen", [Pen(), Pen().plain(), Pen().dwell(0.5).dwell(0.5), Pen().lost(1, 1), Pen().go(5, 5)])
def test_a_file_without_a_road_is_one_no_flow(pen: Pen) -> None:
    assert kinds(pen) == [NO_FLOW]
