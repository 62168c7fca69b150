"""The planner against closed forms, and its limits under anything."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paths import AREA, MACHINE, make, road

from gcodectl.errors import UsageError
from gcodectl.records import Kind
from plant_models.firmware import execute
from plant_models.gantry import PATH, Firmware
from plant_models.planner import Phases, junction_kernel, lookahead_kernel, trapezoid_kernel


def test_a_long_move_is_a_trapezoid():
    x = execute([make([{"to": (50, 0), "feed": 20}])], MACHINE)
    ramp = 20 / MACHINE.accel
    assert x.duration == pytest.approx(50 / 20 + ramp)
    np.testing.assert_allclose(x.phases.duration, [ramp, 50 / 20 - ramp, ramp])
    np.testing.assert_allclose(x.position(np.array([-1.0, ramp, 1e9]))[:, 0], [0, 20 * ramp / 2, 50])


def test_a_short_move_is_a_triangle():
    x = execute([make([{"to": (0.1, 0), "feed": 100}])], MACHINE)
    assert x.duration == pytest.approx(2 * math.sqrt(0.1 / MACHINE.accel))
    assert x.speed(np.array([x.duration / 2]))[0] == pytest.approx(math.sqrt(0.1 * MACHINE.accel))


def test_a_right_angle_is_taken_at_the_square_corner_velocity():
    moves = make([{"to": (50, 0), "feed": 20}, {"to": (50, 50)}])
    x = execute([moves], MACHINE)
    assert x.speed(x.begins()[1:])[0] == pytest.approx(MACHINE.corner_speed)
    ramp, dip = 20 / MACHINE.accel, (20 - MACHINE.corner_speed) ** 2 / (20 * MACHINE.accel)
    assert x.duration == pytest.approx(100 / 20 + ramp + dip)
    faster = execute([moves.replace(corner_speed=np.full(2, 8.0))], MACHINE)
    assert faster.speed(faster.begins()[1:])[0] == pytest.approx(8)


@pytest.mark.parametrize(("angle", "expected"), [(0.0, 20.0), (180.0, 0.0), (135.0, None)])
def test_other_angles(angle: float, expected: float | None):
    turn = math.radians(angle)
    x = execute([make([{"to": (50, 0), "feed": 20}, {"to": (50 + 50 * math.cos(turn), 50 * math.sin(turn))}])], MACHINE)
    if expected is None:
        sine = math.sin(math.radians(180 - angle) / 2)
        expected = MACHINE.corner_speed * math.sqrt((math.sqrt(2) - 1) * sine / (1 - sine))
    assert x.speed(x.begins()[1:])[0] == pytest.approx(expected, abs=1e-6)


def test_classic_jerk_limits_the_step_of_an_axis():
    moves = make([{"to": (50, 0), "feed": 20}, {"to": (50 + 40, 30)}])
    x = execute([moves], MACHINE, firmware=Firmware(junction="jerk"))
    assert x.speed(x.begins()[1:])[0] == pytest.approx(MACHINE.corner_speed / 0.6)


def test_a_step_in_e_slows_the_junction():
    moves = make([{"to": (50, 0), "feed": 20, "e": 5.0}, {"to": (100, 0), "e": 15.0}])
    klipper = dataclasses.replace(MACHINE, dialect="klipper", max_bead=1e3)
    for machine, firmware, allowed in (
        (klipper, None, 1.0),
        (MACHINE, Firmware(instant_e_speed=2.0), 2.0),
        (dataclasses.replace(MACHINE, e_corner_speed=3.0), None, 3.0),
    ):
        x = execute([moves], machine, firmware=firmware)
        assert x.speed(x.begins()[1:])[0] == pytest.approx(allowed / 0.2)


def test_e_has_its_own_speed_and_acceleration():
    """Marlin's M203 and M201 hold E on every move, Klipper's only where E moves alone or back."""
    rows: list[dict[str, Any]] = [{"to": (50, 0), "feed": 20, "e": 5.0}, {"to": (100, 0), "e": -5.0}]
    marlin = dataclasses.replace(MACHINE, e_max_speed=1.5, e_max_accel=10.0)
    klipper = dataclasses.replace(marlin, dialect="klipper", e_accel=4.0)
    run = execute([make(rows)], marlin).segments
    assert run.speed.tolist() == pytest.approx([15, 15])
    assert run.accel.tolist() == pytest.approx([100, 100])
    run = execute([make(rows)], klipper).segments
    assert run.speed.tolist() == pytest.approx([20, 15])
    assert run.accel.tolist() == pytest.approx([100, 40])
    for machine, hardest in ((marlin, 10.0), (klipper, 4.0)):
        alone = execute([make([{"e": 5.0, "feed": 20}])], machine)
        assert alone.phases.v.max() == pytest.approx(1.5)
        assert np.abs(alone.phases.a).max() == pytest.approx(hardest)


def test_e_alone_pauses_and_barriers_are_at_rest():
    rows: list[dict[str, Any]] = [
        {"to": (50, 0), "feed": 20},
        {"e": 1.0, "feed": 2},
        {"to": (100, 0), "feed": 20},
        {"kind": Kind.DWELL, "dwell": 1.5},
        {"to": (150, 0)},
        {"kind": Kind.BARRIER},
        {"to": (200, 0)},
        {"kind": Kind.TOOL, "tool": 1},
        {"to": (250, 0), "tool": 1},
    ]
    x = execute([make(rows)], MACHINE)
    each = 50 / 20 + 20 / MACHINE.accel
    assert x.duration == pytest.approx(5 * each + (1 / 2 + 2 / MACHINE.e_accel) + 1.5 + MACHINE.switch_dwell)
    assert x.tools == (0, 1)


def test_accelerations_of_travel_print_and_z():
    machine = dataclasses.replace(MACHINE, accel=100.0, travel_accel=400.0, z_accel=50.0)
    rows: list[dict[str, Any]] = [{"to": (50, 0), "feed": 10}, {"to": (100, 0), "e": 0.1}, {"to": (100, 0, 30)}]
    x = execute([make(rows)], machine)
    assert sorted(np.unique(np.abs(x.phases.a))) == pytest.approx([0, 50, 100, 400])
    own = make(rows).replace(accel=np.full(3, 30.0), travel_accel=np.full(3, 60.0))
    assert sorted(np.unique(np.abs(execute([own], machine).phases.a))) == pytest.approx([0, 30, 50, 60])


def test_the_plunger_slows_a_move_that_asks_too_much():
    machine = dataclasses.replace(MACHINE, max_flow=5.0)
    x = execute([make(road([(0, 0), (50, 0)], feed=20))], machine)
    assert x.phases.v.max() == pytest.approx(5.0 / 0.54)
    alone = execute([make([{"e": 1.0, "feed": 100}])], machine)
    assert alone.phases.v.max() == pytest.approx(5.0 / AREA)


def test_an_arc_runs_along_its_chords():
    turn = make(
        [
            {"to": (10, 0), "feed": 10},
            {
                "kind": Kind.ARC,
                "p1": (-10, 0, 2),
                "sweep": math.pi,
                "length": math.hypot(10 * math.pi, 2),
                "e": 1.0,
            },
        ]
    )
    x = execute([turn], MACHINE)
    path = x.position(np.linspace(1.5, x.duration, 400))
    np.testing.assert_allclose(np.hypot(path[:, 0], path[:, 1]), 10, atol=0.5**2 / 80 + 1e-9)
    assert (path[:, 1] > -1e-9).all()
    np.testing.assert_allclose(path[-1], [-10, 0, 2], atol=1e-12)
    assert x.segments.e.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(("plane", "axes"), [(1, (2, 0, 1)), (2, (1, 2, 0))])
def test_arcs_of_the_other_planes(plane: int, axes: tuple[int, int, int]):
    p0, p1 = np.zeros(3), np.zeros(3)
    p0[axes[0]], p1[axes[1]] = 10, 10
    arc = {"kind": Kind.ARC, "p0": p0, "p1": p1, "sweep": math.pi / 2, "length": 5 * math.pi, "plane": plane}
    x = execute([make([arc])], MACHINE)
    path = x.position(np.linspace(0, x.duration, 50))
    np.testing.assert_allclose(np.hypot(path[:, axes[0]], path[:, axes[1]]), 10, atol=0.01)
    np.testing.assert_allclose(path[:, axes[2]], 0)


def test_firmware_retraction_happens_once():
    rows = [{"kind": Kind.RETRACT}, {"kind": Kind.RETRACT}, {"to": (50, 0)}, {"kind": Kind.UNRETRACT}]
    x = execute([make(rows)], MACHINE)
    assert x.segments.volume.tolist() == pytest.approx([-2.4, 0, 2.4])


def test_unknown_positions_and_feeds_do_not_stop_it():
    nan = float("nan")
    rows = [
        {"p0": (nan, nan, nan), "p1": (nan, nan, 5), "feed": nan},
        {"p0": (nan, nan, 5), "p1": (10, nan, 5), "feed": 0.0},
        {"kind": Kind.ARC, "p0": (10, nan, 5), "p1": (20, 0, 5), "center": (nan, nan), "sweep": nan, "length": nan},
    ]
    x = execute([make(rows)], MACHINE)
    assert math.isfinite(x.duration)
    np.testing.assert_allclose(x.position(np.array([x.duration]))[0], [20, 0, 5])


def test_an_empty_file_takes_no_time():
    x = execute([], MACHINE)
    assert x.duration == 0
    assert x.command(0.01).values.tolist() == [[0.0]]


def test_bad_settings_are_refused():
    with pytest.raises(UsageError, match="junction"):
        Firmware(junction="round")
    with pytest.raises(UsageError, match="positive"):
        Firmware(chord=0.0)
    with pytest.raises(UsageError, match="negative"):
        execute([], MACHINE, pressure_advance=-1.0)


points = st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), min_size=2, max_size=25)


@settings(max_examples=60, deadline=None)
@given(points, st.lists(st.floats(0.5, 300), min_size=25, max_size=25), st.booleans())
def test_no_limit_is_ever_exceeded(places: list[tuple[float, float]], feeds: list[float], classic: bool):
    moves = make([{"to": p, "feed": f, "e": 0.01} for p, f in zip(places, feeds, strict=False)])
    machine = dataclasses.replace(MACHINE, max_flow=60.0)
    x = execute([moves], machine, firmware=Firmware(junction="jerk" if classic else "square"))
    p, run = x.phases, x.segments[x.phases.segment]
    after = p.v + p.a * p.duration
    assert (np.maximum(p.v, after) <= run.speed * (1 + 1e-9) + 1e-9).all()
    assert (np.abs(p.a) <= run.accel * (1 + 1e-12)).all()
    assert (after > -1e-6).all()
    np.testing.assert_allclose(p.t[1:], p.t[:-1] + p.duration[:-1], rtol=1e-12)
    same = (p.segment[1:] == p.segment[:-1]) | (run.kind[1:] == PATH) & (run.kind[:-1] == PATH)
    np.testing.assert_allclose(after[:-1][same], p.v[1:][same], atol=1e-5)
    covered = np.bincount(p.segment, p.v * p.duration + p.a * p.duration**2 / 2, minlength=len(x.segments))
    np.testing.assert_allclose(covered, x.segments.length, rtol=1e-6, atol=1e-6)


def test_kernels_give_the_same_as_plain_python():
    rng = np.random.default_rng(1)
    x = execute([make([{"to": rng.uniform(0, 30, 3), "e": 0.01} for _ in range(30)])], MACHINE)
    run = x.segments
    direction = (run.p1 - run.p0) / run.length[:, None]
    for classic in (False, True):
        arguments = (
            run.kind, direction, run.e / run.length, run.length, run.speed, run.accel, run.corner_speed, run.rest,
            np.ones(len(run)), classic,
        )  # fmt: skip
        limit = junction_kernel.py_func(*arguments)
        np.testing.assert_array_equal(limit, junction_kernel(*arguments))
    v2 = lookahead_kernel.py_func(limit, run.length, run.accel)
    np.testing.assert_array_equal(v2, lookahead_kernel(limit, run.length, run.accel))
    one, two = Phases.allocate(3 * len(run)), Phases.allocate(3 * len(run))
    assert trapezoid_kernel.py_func(run.length, run.speed, run.accel, run.pause, v2, **one) == trapezoid_kernel(
        run.length, run.speed, run.accel, run.pause, v2, **two
    )
    for name in one:
        np.testing.assert_array_equal(one[name], two[name])
