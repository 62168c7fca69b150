"""What drives do wrong, each alone around the plant that obeys."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_models.actuator import Actuator, Direct, join, split
from plant_models.delay import DeadTime
from plant_models.drift import Drift, drift_kernel
from plant_models.drive import DriveLag, SpeedLoop, second_order_kernel
from plant_models.linear import Linear
from plant_models.plunger import Backlash, Plunger, backlash_kernel, limit_kernel

DT = 0.01
rates = st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=60).map(np.array)


def run(plant: Actuator, u: np.ndarray, dt: float = DT) -> np.ndarray:
    return plant.run(plant.initial(), u, dt)[1]


@settings(deadline=None)
@given(rates, st.floats(0.0, 30.0), st.floats(1.0, 5000.0))
def test_the_plunger_keeps_its_cap_and_its_slew(u: np.ndarray, max_flow: float, slew: float) -> None:
    moved = run(Plunger(Direct(), max_flow, slew), u)
    assert np.abs(moved).max() <= max_flow
    assert np.abs(np.diff(moved, prepend=0.0)).max() <= slew * DT * (1 + 1e-9)
    np.testing.assert_array_equal(run(Plunger(Direct(), math.inf), u), u)


def test_the_plunger_ramps_both_ways() -> None:
    moved = run(Plunger(Direct(), 5.0, 100.0), np.repeat([20.0, -20.0], 10))
    np.testing.assert_allclose(moved[:6], [1, 2, 3, 4, 5, 5])
    np.testing.assert_allclose(moved[10:], [4, 3, 2, 1, 0, -1, -2, -3, -4, -5])


@settings(deadline=None)
@given(rates, st.floats(0.01, 2.0))
def test_backlash_loses_its_gap_at_a_reversal_and_nothing_else(u: np.ndarray, gap: float) -> None:
    there = np.abs(u)
    np.testing.assert_allclose(run(Backlash(Direct(), gap), there), there, rtol=1e-9, atol=1e-12 / DT)
    back = run(Backlash(Direct(), gap), -there)
    assert back.sum() * DT == pytest.approx(min(gap - there.sum() * DT, 0.0), abs=1e-9)
    whole = run(Backlash(Direct(), gap), u)
    assert -1e-9 <= whole.sum() * DT - u.sum() * DT <= gap + 1e-9


def test_backlash_is_crossed_in_the_middle_of_a_sample() -> None:
    np.testing.assert_allclose(
        run(Backlash(Direct(), 0.15), np.array([-10.0, -10.0, 10.0, 10.0, 10.0])), [0, -5, 0, 5, 10]
    )


@pytest.mark.parametrize(("dead", "expected"), [(0.0, [1, 2, 3, 4]), (0.02, [0, 0, 1, 2]), (0.015, [0, 0.5, 1.5, 2.5])])
def test_a_dead_time_shifts(dead: float, expected: list[float]) -> None:
    np.testing.assert_allclose(run(DeadTime(Direct(), dead), np.array([1.0, 2.0, 3.0, 4.0])), expected, atol=1e-12)


@settings(deadline=None)
@given(rates, st.floats(0.0, 0.5), st.floats(0.002, 0.05))
def test_a_dead_time_loses_no_volume(u: np.ndarray, dead: float, dt: float) -> None:
    padded = np.concatenate([u, np.zeros(int(dead / dt) + 2)])
    assert run(DeadTime(Direct(), dead), padded, dt).sum() == pytest.approx(u.sum(), abs=1e-9 * np.abs(u).sum())


def test_a_dead_time_outlives_a_change_of_the_sample() -> None:
    plant = DeadTime(Direct(), 0.2)
    state, first = plant.run(plant.initial(), np.full(20, 3.0), 0.01)
    state, second = plant.run(state, np.zeros(100), 0.005)
    np.testing.assert_allclose(first, 0.0)
    np.testing.assert_allclose(second[:40], 3.0)
    np.testing.assert_allclose(second[40:], 0.0, atol=1e-12)
    _, third = plant.run(plant.run(plant.initial(), np.full(40, 3.0), 0.005)[0], np.zeros(30), 0.02)
    np.testing.assert_allclose(third[:10], 3.0)
    np.testing.assert_allclose(third[10:], 0.0, atol=1e-12)


def test_a_drive_lag_is_a_linear_plant_of_gain_one() -> None:
    u = np.random.default_rng(3).normal(size=80)
    np.testing.assert_array_equal(run(DriveLag(Direct(), 0.05), u), run(Linear(1.0, 0.05), u))
    np.testing.assert_array_equal(run(DriveLag(Direct(), 0.0), u), u)


@pytest.mark.parametrize("zeta", [0.4, 0.7, 1.0, 2.0])
def test_a_speed_loop_overshoots_by_the_textbook(zeta: float) -> None:
    moved = run(SpeedLoop(Direct(), 0.2, zeta), np.full(4000, 2.0), 0.002)
    expected = math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)) if zeta < 1 else 0.0
    assert moved.max() / 2.0 - 1.0 == pytest.approx(expected, abs=1e-3)
    assert moved[-1] == pytest.approx(2.0, rel=1e-3)
    assert np.sum(2.0 - moved) * 0.002 == pytest.approx(2.0 * 2 * zeta * 0.2, rel=1e-2)  # the area of a 2 zeta / w lag


def test_a_speed_loop_does_not_care_for_the_sample() -> None:
    u = np.repeat([1.0, -1.0, 3.0], 20)
    coarse = run(SpeedLoop(Direct(), 0.1, 0.5), u, 0.01)
    fine = run(SpeedLoop(Direct(), 0.1, 0.5), np.repeat(u, 10), 0.001)
    np.testing.assert_allclose(fine.reshape(-1, 10).mean(axis=1), coarse, rtol=1e-8, atol=1e-9)


@settings(deadline=None)
@given(st.integers(0, 10**6), st.floats(0.001, 0.2))
def test_drift_stays_within_its_amplitude(seed: int, amplitude: float) -> None:
    factor = run(Drift(Direct(), amplitude, 100.0, seed=seed), np.ones(400), 1.0)
    assert np.abs(factor - 1).max() <= amplitude + 1e-12
    assert np.abs(factor - 1).max() >= 0.5 * amplitude
    assert np.abs(np.diff(factor)).max() <= 0.2 * amplitude  # slow: period 100 s, sampled each second


def test_actuators_nest() -> None:
    plant = Plunger(DeadTime(Backlash(Linear(2.0, 0.1), 0.1), 0.05), 10.0, 100.0)
    q = run(plant, np.full(300, 4.0))
    assert (q[:5] == 0).all()
    assert q[-1] == pytest.approx(8.0)
    own, inner = split(join(np.array([1.0, 2.0]), np.array([3.0])))
    np.testing.assert_array_equal(own, [1.0, 2.0])
    np.testing.assert_array_equal(inner, [3.0])


def test_an_actuator_must_say_what_it_does() -> None:
    with pytest.raises(TypeError, match="abstract"):
        Actuator(Direct())  # type: ignore[abstract]


def test_the_kernels_do_the_same_in_plain_python() -> None:
    u = np.random.default_rng(4).normal(0.0, 5.0, 40)
    step = SpeedLoop(Direct(), 0.1, 0.5)._step(DT)
    waves = (np.array([0.1, 0.05]), np.array([0.3, 0.7]), np.array([1.0, 2.0]))
    for kernel, before, after in (
        (limit_kernel, (0.0, u, 4.0, 1.0), ()),
        (backlash_kernel, (0.1, u, DT, 0.2), ()),
        (second_order_kernel, (0.1, 0.2, u, step, DT), ()),
        (drift_kernel, (1.0, u, DT, *waves), ()),
    ):
        fast, slow = np.empty(40), np.empty(40)
        assert kernel(*before, fast, *after) == kernel.py_func(*before, slow, *after)
        np.testing.assert_array_equal(slow, fast)
