"""The plunger's command: volume kept, pressure advance and its smoothing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paths import AREA, BEAD, MACHINE, make, road

from gcodectl.errors import InputError, UsageError
from gcodectl.records import Kind
from plant_models.firmware import edge_kernel, execute, smooth, standing, volume_kernel
from plant_models.gantry import chords_kernel


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-0.1, 0.1)), min_size=1, max_size=12),
    st.floats(0.001, 0.3),
)
def test_sampling_keeps_the_volume(places: list[tuple[float, float, float]], dt: float):
    x = execute([make([{"to": (a, b), "e": e} for a, b, e in places])], MACHINE)
    assert x.command(dt).values.sum() * dt == pytest.approx(sum(e for *_, e in places) * AREA, abs=1e-6)


def test_the_steady_rate_is_bead_times_speed():
    x = execute([make(road([(0, 0), (50, 0)], feed=10))], MACHINE)
    u = x.command(0.002).values[0]
    assert np.median(u) == pytest.approx(10 * BEAD)
    assert u.max() <= 10 * BEAD + 1e-6


def test_each_tool_has_its_channel():
    rows = [*road([(0, 0), (20, 0)]), {"kind": Kind.TOOL, "tool": 3}, {"to": (0, 0), "e": 0.02, "tool": 3}]
    u = execute([make(rows)], MACHINE).command(0.01)
    assert u.channels == (0, 3)
    np.testing.assert_allclose(u.values.sum(axis=1) * 0.01, [20 * BEAD, 0.02 * AREA])


def test_pressure_advance_adds_k_times_the_slope():
    moves = make(road([(-9, 0), (50, 0)], feed=10))
    machine = dataclasses.replace(MACHINE, accel=20.0)
    plain = execute([moves], machine).command(0.002).values[0]
    pushed = execute([moves], machine, pressure_advance=0.3).command(0.002, 0.1).values[0]
    rising = np.searchsorted(np.cumsum(plain), 0.1)
    expected = plain[rising + 100] + 0.3 * BEAD * 20.0
    assert pushed[rising + 100] == pytest.approx(expected, rel=1e-6)
    assert pushed.sum() == pytest.approx(plain.sum(), rel=1e-9)
    assert pushed.min() == pytest.approx(-0.3 * BEAD * 20.0, abs=0.3)


def test_pressure_advance_leaves_travels_and_e_alone_as_they_are():
    rows = [{"to": (20, 0)}, {"e": 0.05, "feed": 1}, {"to": (20, 0, 5), "e": 0.02}, {"to": (40, 0, 5), "e": -0.02}]
    plain = execute([make(rows)], MACHINE).command(0.002, 0.1).values
    pushed = execute([make(rows)], MACHINE, pressure_advance=2.0).command(0.002, 0.1).values
    np.testing.assert_allclose(pushed, smooth(plain, 0.002, 0.04))


def test_the_smoothing_window_is_a_triangle():
    pulse = np.zeros((1, 101))
    pulse[0, 50] = 1.0
    out = smooth(pulse, 0.002, 0.04)[0]
    assert out.sum() == pytest.approx(1)
    assert np.flatnonzero(out).tolist() == list(range(41, 60))
    assert out[50] == pytest.approx(0.002 / 0.02)
    np.testing.assert_array_equal(out, out[::-1])
    np.testing.assert_array_equal(smooth(pulse, 0.03, 0.04), pulse)


def test_rows_speeds_and_standing_time():
    x = execute([make([*road([(0, 0), (20, 0)]), {"kind": Kind.DWELL, "dwell": 2.0}])], MACHINE)
    assert standing(x) == pytest.approx(2.0)
    assert x.rows(np.array([0.5, x.duration - 1])).tolist() == [1, 2]
    assert x.speed(np.array([0.5, x.duration - 1])).tolist() == [10.0, 0.0]


def test_the_gain_multiplies_and_a_bad_step_is_refused():
    x = execute([make(road([(0, 0), (20, 0)]))], MACHINE)
    louder = dataclasses.replace(x, gain=1.1)
    np.testing.assert_allclose(louder.command(0.01).values, 1.1 * x.command(0.01).values)
    with pytest.raises(UsageError, match="sampling"):
        x.command(0.0)
    with pytest.raises(InputError, match="nothing moves"):
        execute([], MACHINE).position(np.zeros(1))


def test_kernels_give_the_same_as_plain_python():
    x = execute([make([*road([(0, 0), (5, 0), (5, 4)]), {"e": -0.01, "feed": 1}])], MACHINE)
    p = x.phases
    for kernel in (volume_kernel, edge_kernel):
        one, two = np.zeros((1, 200)), np.zeros((1, 200))
        arguments = (p.segment, p.t, p.duration, p.v, p.a, x.ratio, x.channel, 0.01)
        kernel(*arguments, one)
        kernel.py_func(*arguments, two)
        np.testing.assert_array_equal(one, two)
        assert one.any()


def test_the_cutting_kernel_gives_the_same_as_plain_python():
    kind, plane, pieces = np.array([1, 2], np.int8), np.array([0, 1], np.int8), np.array([1, 5])
    p0, p1 = np.array([[0, 0, 0], [0, 0, 4.0]]), np.array([[0, np.nan, 4.0], [4.0, 0, 0]])
    results = []
    for kernel in (chords_kernel, chords_kernel.py_func):
        out = (np.zeros(6, np.int64), np.zeros((6, 3)), np.zeros((6, 3)), np.zeros(6))
        assert kernel(kind, p0, p1, np.zeros((2, 2)), np.array([0, np.pi / 2]), plane, pieces, np.zeros(3), *out) == 6
        results.append(out)
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)
