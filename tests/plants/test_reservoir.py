"""The yield-stress reservoir: conservation, steady state, lag, yield, void and thixotropy; and against scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from plant_models.plant import load_plant
from plant_models.reservoir import Reservoir, law_kernel, reservoir_kernel, slopes_kernel

FLOW = 5.0
PASTE = {"flow": FLOW, "tau": 1.0, "n": 0.45, "P_y": 120.0, "P_over": 180.0}
THIXO = {**PASTE, "rise": 0.5, "t_rebuild": 10.0, "t_break": 0.5}

lags = st.sampled_from((0.01, 0.3, 1.0, 5.0))
indices = st.sampled_from((0.3, 0.5, 1.0))
steps = st.sampled_from((0.001, 0.01, 0.1))
pushes = st.lists(st.floats(-5 * FLOW, 5 * FLOW), min_size=1, max_size=20).map(lambda u: np.repeat(u, 10))


@settings(deadline=None)
@given(lags, indices, steps, st.sampled_from((0.0, 120.0)), pushes)
def test_what_goes_in_is_stored_or_comes_out(tau: float, n: float, dt: float, P_y: float, u: np.ndarray) -> None:
    plant = Reservoir(flow=FLOW, tau=tau, n=n, P_y=P_y, P_over=180.0, rise=0.3)
    start = plant.initial()
    end, q = plant.run(start, u, dt)
    stored = plant.C * (end[0] - start[0]) - (end[1] - start[1])
    moved = np.abs(u).sum() * dt
    assert np.sum(u - q) * dt == pytest.approx(stored, abs=1e-9 * max(moved, plant.C * 300.0))
    assert (q >= 0).all()
    assert end[1] >= 0


@settings(deadline=None, max_examples=30)
@given(lags, indices, st.floats(0.05, 4.0))
def test_it_settles_at_u_and_rises_without_overshoot(tau: float, n: float, share: float) -> None:
    plant, dt = Reservoir(flow=FLOW, tau=tau, n=n, P_y=100.0, P_over=200.0), 0.01
    q = plant.run(plant.initial(), np.full(1, share * FLOW), 100.0 * tau + dt)[1]
    state, q = plant.run(plant.initial(), np.full(2000, share * FLOW), 0.05 * tau)
    assert (np.diff(q) >= -1e-9 * FLOW).all()
    assert q.max() <= share * FLOW * (1 + 1e-9)
    for _ in range(3):
        state, q = plant.run(state, np.full(2000, share * FLOW), 0.05 * tau)
    assert q[-1] == pytest.approx(share * FLOW, rel=1e-3)


@pytest.mark.parametrize("tau", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("lag", [1.0, 1.15])
def test_its_lag_at_the_nominal_flow_is_tau(tau: float, lag: float) -> None:
    plant, dt = Reservoir(**{**PASTE, "tau": tau}, lag=lag), 0.01
    state, _ = plant.run(plant.initial(), np.full(6000, FLOW), dt)
    state[0] = PASTE["P_y"] + PASTE["P_over"]  # exactly settled, so that only the small step is seen
    q = plant.run(state, np.full(3000, 1.001 * FLOW), dt)[1]
    reached = np.argmax(q > FLOW * (1 + 0.001 * (1 - np.exp(-1)))) * dt
    assert reached == pytest.approx(tau * lag, rel=0.03)


@pytest.mark.parametrize("name", ["syringe-fast", "syringe-mid", "syringe-slow"])
def test_nothing_flows_below_the_yield(name: str) -> None:
    plant = load_plant(name, primed=0.0)
    P_y, C = plant.constants[4], plant.C
    to_yield = P_y * C / FLOW
    samples = int(to_yield / 0.01) - 1
    state, q = plant.run(plant.initial(), np.full(samples, FLOW), 0.01)
    assert (q == 0).all()
    assert state[0] == pytest.approx(samples * 0.01 * FLOW / C)
    assert plant.run(state, np.full(50, FLOW), 0.01)[1][-1] > 0
    assert load_plant(name).run(load_plant(name).initial(), np.zeros(100), 0.01)[1].max() == 0


def test_at_rest_the_paste_keeps_its_yield_pressure() -> None:
    plant = Reservoir(**PASTE)
    state, _ = plant.run(plant.initial(), np.full(1000, FLOW), 0.01)
    state, q = plant.run(state, np.zeros(100_000), 0.05)
    assert (np.diff(q) <= 0).all()
    assert PASTE["P_y"] < state[0] < PASTE["P_y"] + 2.0


@pytest.mark.parametrize("P_y", [0.0, 20.0])
def test_what_was_sucked_back_must_be_filled_before_anything_flows(P_y: float) -> None:
    plant, dt = Reservoir(flow=FLOW, tau=0.3, n=0.5, P_y=P_y, P_over=100.0), 0.01
    state, q = plant.run(plant.initial(), np.full(200, -FLOW), dt)
    assert (q == 0).all()
    void = state[1]
    assert void == pytest.approx(2.0 * FLOW + plant.C * (state[0] - plant.rest_pressure))
    assert void > FLOW
    _, q = plant.run(state, np.full(1000, FLOW), dt)
    began = np.argmax(q > 0)
    pushed = began * dt * FLOW
    assert pushed > void + plant.C * (P_y - state[0])
    assert q[-1] == pytest.approx(FLOW, rel=1e-3)


def test_it_agrees_with_an_adaptive_solver() -> None:
    plant, dt = Reservoir(**THIXO), 0.01
    rng = np.random.default_rng(5)
    u = np.repeat(rng.uniform(0.0, 3.0 * FLOW, 12), 50)
    constants = plant.constants

    def slope(t: float, y: np.ndarray) -> list[float]:
        dP, ds, q = slopes_kernel.py_func(y[0], y[1], u[min(int(t / dt), len(u) - 1)], constants)
        return [dP, ds, q]

    y, volumes = np.array([plant.initial()[0], 1.0, 0.0]), [0.0]
    for begin in range(0, len(u), 50):
        t = np.arange(begin, begin + 51) * dt
        t[0] += 1e-12
        solved = solve_ivp(slope, (t[0], t[-1] - 1e-12), y, "Radau", rtol=1e-9, atol=1e-10)
        y = solved.y[:, -1]
        volumes.append(y[2])
    state, q = plant.run(plant.initial(), u, dt)
    np.testing.assert_allclose(q.reshape(12, 50).sum(axis=1) * dt, np.diff(volumes), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(state[[0, 2]], y[:2], rtol=1e-6)


@settings(deadline=None, max_examples=20)
@given(lags, indices, st.sampled_from((0.0, 0.5)))
def test_a_coarse_sample_gives_what_fine_ones_give(tau: float, n: float, rise: float) -> None:
    plant = Reservoir(flow=FLOW, tau=tau, n=n, P_y=100.0, P_over=150.0, rise=rise)
    u = np.repeat([FLOW, 5 * FLOW, 0.0, -FLOW, 2 * FLOW], 20)
    _, coarse = plant.run(plant.initial(), u, 0.02)
    _, fine = plant.run(plant.initial(), np.repeat(u, 20), 0.001)
    np.testing.assert_allclose(coarse, fine.reshape(-1, 20).mean(axis=1), rtol=1e-3, atol=2e-3 * FLOW)


def test_rest_stiffens_a_thixotropic_paste_and_flow_softens_it() -> None:
    plant, dt = Reservoir(**THIXO), 0.01
    s_flow = THIXO["t_break"] / (THIXO["t_break"] + THIXO["t_rebuild"])
    rested = plant.initial()
    state, _ = plant.run(rested, np.full(6000, FLOW), dt)
    assert state[2] == pytest.approx(s_flow, rel=1e-3)
    assert state[0] == pytest.approx(PASTE["P_y"] + PASTE["P_over"], rel=1e-3)
    assert rested[0] == pytest.approx(PASTE["P_y"] * (1 + 0.5 * (1 - s_flow)))
    state[0] = 0.0  # relieved: nothing oozes while it rests
    begins = []
    for rest in (1.0, 5.0, 30.0):
        rested, _ = plant.run(state, np.zeros(int(rest / dt)), dt)
        assert rested[2] == pytest.approx(1 - (1 - s_flow) * np.exp(-rest / THIXO["t_rebuild"]), rel=1e-9)
        begins.append(int(np.argmax(plant.run(rested, np.full(1000, FLOW), dt)[1] > 0)))
    assert begins[0] < begins[1] < begins[2]


def test_leak_is_a_share_of_the_nominal_flow() -> None:
    plant = Reservoir(flow=FLOW, tau=0.2, n=0.4, P_y=0.0, P_over=1000.0, leak=0.2)

    def settled(u: float) -> float:
        return float(plant.run(plant.initial(), np.full(4000, u), 0.01)[1][-1])

    assert settled(FLOW) == pytest.approx(FLOW, rel=1e-3)
    assert settled(0.3 * FLOW) < 0.29 * FLOW
    assert settled(2.0 * FLOW) > 2.02 * FLOW


def test_the_kernels_do_the_same_in_plain_python() -> None:
    plant = Reservoir(**THIXO)
    u = np.repeat([FLOW, 3 * FLOW, -4 * FLOW, FLOW, 0.0], 8)
    fast, slow = plant.initial(), plant.initial()
    q_fast, q_slow = np.empty(len(u)), np.empty(len(u))
    reservoir_kernel(fast, u, 0.05, plant.constants, q_fast)
    reservoir_kernel.py_func(slow, u, 0.05, plant.constants, q_slow)
    np.testing.assert_array_equal(q_slow, q_fast)
    np.testing.assert_array_equal(slow, fast)
    for P in (-300.0, -120.0, 0.0, 120.0, 120.5, 400.0):
        assert law_kernel.py_func(P, 120.0, 1e-4, 2.2) == law_kernel(P, 120.0, 1e-4, 2.2)
        assert slopes_kernel.py_func(P, 0.5, FLOW, plant.constants) == slopes_kernel(P, 0.5, FLOW, plant.constants)
