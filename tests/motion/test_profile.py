import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import SYRINGE, Pen, chunked, pens, plain_python, same
from ruckig import InputParameter, Ruckig, Trajectory

from gcodectl.config import Machine
from gcodectl.motion import profile as stage
from gcodectl.motion.lookahead import plan
from gcodectl.motion.profile import MOST, PHASE, profile, run_kernel
from gcodectl.motion.ramp import ramp_distance_kernel, ramp_time_kernel
from gcodectl.path import point_at
from gcodectl.records import Kind, Moves, Profile, SpeedPlan

Timed = tuple[Moves, SpeedPlan, Profile]
SMOOTH = dataclasses.replace(SYRINGE, jerk=2_000.0)


def timed(
    moves: Moves, size: int = 10_000, machine: Machine = SYRINGE, settle: float = 0.0, lead: float = 0.0
) -> Timed:
    pieces = list(profile(plan(chunked(moves, size), machine), machine, settle, lead))
    return (
        Moves.concat([piece[0] for piece in pieces]),
        SpeedPlan.concat([piece[1] for piece in pieces]),
        Profile.concat([piece[2] for piece in pieces]),
    )


def ends(p: Profile) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    """Place, speed and acceleration at the end of each phase."""
    d = p.duration
    return p.s + d * (p.v + d * (p.a / 2 + d * p.j / 6)), p.v + d * (p.a + d * p.j / 2), p.a + d * p.j


def promises(moves: Moves, speeds: SpeedPlan, p: Profile, machine: Machine) -> None:
    """The motion is continuous, keeps its limits and arrives exactly."""
    if not len(p):
        assert not speeds.distance.any()
        return
    s1, v1, a1 = ends(p)
    assert p.t[0] == 0.0
    assert np.allclose(p.t[1:], (p.t + p.duration)[:-1], rtol=1e-12, atol=1e-12)
    assert p.t[-1] + p.duration[-1] == pytest.approx(p.duration.sum(), rel=1e-9)
    assert (p.duration > 0).all()
    assert (np.diff(p.row) >= 0).all()
    assert np.abs(v1[:-1] - p.v[1:]).max(initial=0.0) < 1e-5 + 1e-6 * p.v.max()
    assert v1[-1] == pytest.approx(0.0, abs=1e-5)
    new = np.diff(p.row, prepend=-1) > 0
    assert not p.s[new].any()
    assert np.allclose(p.s[1:][~new[1:]], s1[:-1][~new[1:]], rtol=1e-9, atol=1e-9)
    last = np.append(np.flatnonzero(new[1:]), len(p) - 1)
    distance = speeds.distance[p.row[last] - moves.row[0]]
    assert np.abs(s1[last] - distance).max() < 1e-6
    index = p.row - moves.row[0]
    moving = speeds.distance[index] > 0
    cap = speeds.accel[index] * (1 + 1e-6) + 1e-6
    assert (np.abs(p.a)[moving] <= cap[moving]).all()
    assert (np.abs(a1)[moving] <= cap[moving]).all()
    assert (np.abs(p.j) <= machine.jerk * (1 + 1e-9)).all()
    top = speeds.cruise[index] * (1 + 1e-6) + 1e-6
    assert (p.v <= top)[moving].all()
    assert (v1 <= top)[moving].all()
    assert (p.v >= -1e-6).all()
    assert (v1 >= -1e-5).all()


@given(pens(most=40), st.sampled_from([SYRINGE, SMOOTH]))
def test_motion_is_continuous_within_limits_and_arrives(pen: Pen, machine: Machine) -> None:
    moves, speeds, phases = timed(pen.moves(), machine=machine)
    promises(moves, speeds, phases, machine)
    path = [row for row in range(len(moves)) if speeds.distance[row] > 1e-3]
    assert set(path) <= set(phases.row.tolist())


@given(pens(most=60), st.sampled_from([1, 2, 37]), st.sampled_from([0.0, 0.7]))
def test_any_chunking_gives_the_same_motion(pen: Pen, size: int, wait: float) -> None:
    moves = pen.moves()
    whole = timed(moves, settle=wait, lead=wait)
    pieces = timed(moves, size, settle=wait, lead=wait)
    for a, b in zip(whole, pieces, strict=True):
        same(a, b)


@given(pens(most=12))
def test_the_commanded_path_stays_on_the_path(pen: Pen) -> None:
    moves, speeds, phases = timed(pen.moves())
    for k in range(len(phases)):
        row = int(phases.row[k])
        if moves.length[row] <= 0 or speeds.distance[row] <= 0:
            continue
        for part in (0.0, 0.5, 1.0):
            d = part * phases.duration[k]
            s = phases.s[k] + d * (phases.v[k] + d * (phases.a[k] / 2 + d * phases.j[k] / 6))
            assert -1e-9 <= s <= moves.length[row] + 1e-6
            at = point_at(moves, row, s / moves.length[row])
            share = s / moves.length[row]
            if moves.kind[row] == Kind.ARC:
                axes = [(0, 1), (2, 0), (1, 2)][moves.plane[row]]
                radius = math.dist(at[list(axes)], moves.center[row])
                first = math.dist(moves.p0[row][list(axes)], moves.center[row])
                assert radius == pytest.approx(first, abs=0.01)
            else:
                wanted = moves.p0[row] + share * (moves.p1[row] - moves.p0[row])
                assert at == pytest.approx(wanted, abs=0.01)


runs = st.tuples(
    st.floats(1e-3, 100), st.floats(0, 60), st.floats(0, 60), st.floats(0, 60),
    st.sampled_from([50.0, 500.0, 3000.0]), st.sampled_from([2e3, 2e4, 1e6]),
)  # fmt: skip


Phases = list[list[float]]


def phases_of(length: float, entry: float, leave: float, cruise: float, accel: float, jerk: float) -> Phases:
    """Our phases of a run: duration, s, v, a, j each."""
    room = np.empty((MOST, PHASE))
    return room[: run_kernel(room, length, entry, leave, cruise, accel, jerk)].tolist()


def optimal(length: float, entry: float, leave: float, cruise: float, accel: float, jerk: float) -> float:
    """Seconds that Ruckig's time-optimal motion takes."""
    problem, trajectory = InputParameter(1), Trajectory(1)
    problem.current_position, problem.target_position = [0.0], [length]
    problem.current_velocity, problem.target_velocity = [entry], [leave]
    problem.max_velocity, problem.max_acceleration, problem.max_jerk = [cruise], [accel], [jerk]
    Ruckig(1).calculate(problem, trajectory)
    return float(trajectory.duration)


@settings(max_examples=300)
@given(runs)
def test_no_motion_is_faster(numbers: tuple[float, ...]) -> None:
    spare, entry, leave, faster, accel, jerk = numbers
    cruise = max(entry, leave, 0.1) + faster
    length = float(ramp_distance_kernel(entry, leave, accel, jerk)) + spare
    phases = phases_of(length, entry, leave, cruise, accel, jerk)
    assert sum(phase[0] for phase in phases) == pytest.approx(optimal(length, entry, leave, cruise, accel, jerk), 1e-6)
    duration, s, v, a, j = phases[-1]
    assert s + duration * (v + duration * (a / 2 + duration * j / 6)) == pytest.approx(length, rel=1e-9, abs=1e-9)
    assert v + duration * (a + duration * j / 2) == pytest.approx(leave, abs=1e-9)


def test_a_run_that_is_just_its_ramp_has_only_its_phases() -> None:
    length = float(ramp_distance_kernel(3.0, 30.0, 500.0, 20_000.0))
    phases = phases_of(length, 3.0, 30.0, 40.0, 500.0, 20_000.0)
    assert sum(phase[0] > 1e-9 for phase in phases) == 3
    assert sum(phase[0] for phase in phases) == pytest.approx(ramp_time_kernel(3.0, 30.0, 500.0, 20_000.0))


def test_without_a_limit_of_jerk_there_are_trapezoids() -> None:
    phases = phases_of(10.0, 0.0, 0.0, 10.0, 100.0, math.inf)
    assert [phase[0] for phase in phases] == pytest.approx([0.1, 0.9, 0.1])
    assert [phase[4] for phase in phases] == [0.0, 0.0, 0.0]
    assert len(phases_of(0.5, 0.0, 0.0, 10.0, 100.0, math.inf)) == 2


def test_a_run_of_no_length_to_speak_of_takes_no_time() -> None:
    assert sum(phase[0] for phase in phases_of(3.5e-41, 9e-20, 9e-20, 1.2, 500.0, 20_000.0)) < 1e-12


def waits(moves: Moves, settle: float = 0.0, lead: float = 0.0) -> list[tuple[int, float]]:
    """Where the machine stands, and how long."""
    _, _, p = timed(moves, settle=settle, lead=lead)
    still = (p.v == 0) & (p.a == 0) & (p.j == 0)
    return [(int(row), pytest.approx(float(d))) for row, d in zip(p.row[still], p.duration[still], strict=True)]


def test_dwells_and_tool_changes_take_their_time() -> None:
    assert waits(Pen().go(1, 0).dwell(0.25).dwell(0.0).tool(1).barrier().moves()) == [(1, 0.25), (3, 1.0)]


def test_a_barrier_waits_for_the_last_deposition_to_run_out() -> None:
    assert waits(Pen().road(5, 0).barrier().moves(), settle=0.8) == [(1, 0.8)]
    assert waits(Pen().road(5, 0).dwell(0.5).barrier().barrier().moves(), settle=0.8) == [(1, 0.5), (2, 0.3)]
    assert waits(Pen().road(5, 0).dwell(2).barrier().moves(), settle=0.8) == [(1, 2.0)]
    assert waits(Pen().go(5, 0).barrier().moves(), settle=0.8) == []
    assert waits(Pen().road(5, 0).tool(1).moves(), settle=0.8) == [(1, 1.8)]


def hold(pen: Pen) -> Moves:
    """The moves with the dwell that the pen made last as a hold: without a line."""
    moves = pen.moves()
    row = next(k for k in range(len(moves)) if moves.kind[k] == Kind.DWELL)
    return moves.replace(end=np.where(np.arange(len(moves)) == row, moves.start, moves.end))


def test_a_hold_waits_until_the_passage_is_a_lead_old() -> None:
    assert waits(hold(Pen().barrier().dwell(0).road(5, 0)), lead=0.6) == [(1, 0.6)]
    travel = timed(Pen().go(5, 0).moves())[2].duration.sum()
    assert waits(hold(Pen().barrier().go(5, 0).dwell(0).road(9, 0)), lead=0.9) == [(2, 0.9 - travel)]
    assert waits(hold(Pen().barrier().go(50, 0).dwell(0).road(9, 0)), lead=0.6) == []
    assert waits(Pen().barrier().dwell(0).road(5, 0).moves(), lead=0.6) == []


def test_the_path_of_a_passage_without_known_start_ends_nothing() -> None:
    moves, speeds, p = timed(Pen().lost(5, 5).road(9, 5).moves())
    promises(moves, speeds, p, SYRINGE)
    assert set(p.row.tolist()) == {1}


@settings(max_examples=2)
@given(pens(most=20))
def test_the_same_with_the_jit_off(pen: Pen) -> None:
    expected = timed(pen.moves(), settle=0.5)[2]
    with plain_python("gcodectl.motion", "gcodectl.path"), np.errstate(all="ignore"):
        plain = timed(pen.moves(), settle=0.5)[2]
    assert plain.row.tolist() == expected.row.tolist()
    assert np.allclose(plain.t, expected.t)
    assert np.allclose(plain.v, expected.v, atol=1e-6)


def test_time_within_a_phase_is_found() -> None:
    for kernel in (stage.time_at_kernel, stage.time_at_kernel.py_func):
        for t in (0.0, 0.01, 0.2, 0.3):
            ds = t * (1.0 + t * (40.0 / 2 - t * 100.0 / 6))
            assert kernel(ds, 1.0, 40.0, -100.0, 0.3) == pytest.approx(t, abs=1e-12)
            assert kernel(t * t * t * 50 / 6, 0.0, 0.0, 50.0, 0.3) == pytest.approx(t, abs=1e-6)


def test_huge_parts_keep_their_numbers() -> None:
    moves, speeds, p = timed(Pen(at=(1e7, -1e7, 0)).go(1e7 + 1e4, -1e7, feed=200).go(1e7, -1e7, feed=200).moves())
    promises(moves, speeds, p, SYRINGE)
    assert p.t[-1] > 99


def test_a_run_that_is_only_just_long_enough_for_its_ramp() -> None:
    """Found in a filtered file."""
    phases = phases_of(0.2156965461012287, 15.77, 5.000000000000002, 15.77, 1000.0, 100000.0)
    duration, s, v, a, j = phases[-1]
    assert s + duration * (v + duration * (a / 2 + duration * j / 6)) == pytest.approx(0.2156965461012287, rel=1e-6)
    assert v + duration * (a + duration * j / 2) == pytest.approx(5.0)
