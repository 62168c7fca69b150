"""The nominal plant against its closed form."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_models.linear import Linear, first_order, first_order_kernel
from plant_models.plant import load_plant


@pytest.mark.parametrize(("name", "K", "tau"), [("paste-a", 1.08, 2.7), ("paste-b", 0.89, 4.5)])
def test_the_papers_pastes_answer_a_step_as_table_1_says(name: str, K: float, tau: float) -> None:
    plant, dt = load_plant(name), 0.01
    q = plant.run(plant.initial(), np.full(6000, 5.0), dt)[1]
    edges = np.arange(6001) * dt
    volume = 5.0 * K * (edges + tau * np.exp(-edges / tau))  # integral of the step response
    np.testing.assert_allclose(q, np.diff(volume) / dt, rtol=1e-8, atol=1e-9)
    assert q[-1] == pytest.approx(5.0 * K, rel=1e-5)


def test_it_is_the_transfer_function_of_control() -> None:
    dt, u = 0.02, np.random.default_rng(1).normal(size=300)
    state, _ = Linear(1.3, 0.7).run(np.zeros(1), u, dt)
    _, y = control.forced_response(control.sample_system(control.tf([1.3], [0.7, 1.0]), dt), U=np.append(u, 0.0))
    assert state[0] == pytest.approx(y[-1], rel=1e-9)


@settings(deadline=None)
@given(st.floats(0.001, 1.0), st.floats(0.001, 10.0), st.integers(1, 20))
def test_a_finer_sample_gives_the_same_volume(dt: float, tau: float, parts: int) -> None:
    u = np.array([1.0, -2.0, 3.0, 0.0])
    x, q = first_order(0.5, u, dt, 1.2, tau)
    x_fine, q_fine = first_order(0.5, np.repeat(u, parts), dt / parts, 1.2, tau)
    np.testing.assert_allclose(q_fine.reshape(len(u), parts).mean(axis=1), q, rtol=1e-6, atol=1e-9)
    assert x_fine == pytest.approx(x, rel=1e-6, abs=1e-9)


def test_no_lag_is_a_gain() -> None:
    x, q = first_order(5.0, np.array([1.0, 2.0]), 0.1, 3.0, 0.0)
    np.testing.assert_array_equal(q, [3.0, 6.0])
    assert x == 6.0


def test_it_may_draw_back_what_a_paste_would_not() -> None:
    assert Linear().run(np.zeros(1), np.full(10, -1.0), 0.1)[1][-1] < -0.5


def test_the_kernel_does_the_same_in_plain_python() -> None:
    u, fast, slow = np.random.default_rng(2).normal(size=50), np.empty(50), np.empty(50)
    assert first_order_kernel(0.3, u, 1.1, 0.9, 0.95, fast) == first_order_kernel.py_func(0.3, u, 1.1, 0.9, 0.95, slow)
    np.testing.assert_array_equal(fast, slow)
