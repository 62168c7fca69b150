"""Pneumatic, melt and pellet: what sets each apart."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_models.melt import melt
from plant_models.pellet import pellet
from plant_models.plant import Plant, load_plant
from plant_models.pneumatic import Pneumatic, pneumatic_kernel

DT = 0.01


def settled(plant: Plant, u: float, seconds: float = 40.0) -> float:
    return float(plant.run(plant.initial(), np.full(int(seconds / DT), u), DT)[1][-1])


@settings(deadline=None, max_examples=30)
@given(st.floats(0.0, 3.0), st.floats(0.3, 1.0), st.floats(0.0, 200.0))
def test_pneumatic_steady_flow_is_a_yield_stress_curve_of_u(share: float, n: float, P_y: float) -> None:
    plant = Pneumatic(flow=5.0, n=n, P_y=P_y, P_over=200.0)
    over = (P_y + 200.0) * share - P_y
    expected = 5.0 * (over / 200.0) ** (1 / n) if over > 0 else 0.0
    assert settled(plant, 5.0 * share, 10.0) == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_pneumatic_flow_is_no_multiple_of_u() -> None:
    plant = load_plant("pneumatic")
    assert settled(plant, 5.0) == pytest.approx(5.0)
    assert settled(plant, 10.0) > 20.0
    assert settled(plant, 5.0 * 100.0 / 300.0) == 0.0


def test_pneumatic_pressure_follows_the_regulators_lag_and_stops_at_its_vacuum() -> None:
    plant = Pneumatic(flow=5.0, tau=0.2, vacuum=20.0, lag=1.5)
    state, _ = plant.run(plant.initial(), np.full(30, 5.0), DT)
    assert state[0] == pytest.approx(300.0 * (1 - np.exp(-1)))
    state, q = plant.run(state, np.full(2000, -5.0), DT)
    assert state[0] == pytest.approx(-20.0)
    assert (q >= 0).all()


def test_pneumatic_does_not_care_for_the_sample() -> None:
    plant, u = Pneumatic(flow=5.0, tau=0.05), np.repeat([5.0, 8.0, 0.0], 5)
    coarse = plant.run(plant.initial(), u, 0.1)[1]
    fine = plant.run(plant.initial(), np.repeat(u, 100), 0.001)[1]
    np.testing.assert_allclose(coarse, fine.reshape(-1, 100).mean(axis=1), rtol=2e-3, atol=5e-3)


def test_the_pneumatic_kernel_does_the_same_in_plain_python() -> None:
    p_set, fast, slow = np.array([300.0, 500.0, 0.0, -20.0]), np.empty(4), np.empty(4)
    arguments = (50.0, p_set, 0.3, 2, 100.0, 1e-4, 2.0)
    assert pneumatic_kernel(*arguments, fast) == pneumatic_kernel.py_func(*arguments, slow)
    np.testing.assert_array_equal(slow, fast)


def test_melt_obeys_in_steady_state_and_lags_by_tau_and_delay() -> None:
    plant = melt(flow=8.0, tau=0.1, n=1.0, dead=0.05)  # Newtonian: a plain first-order lag
    q = plant.run(plant.initial(), np.full(200, 8.0), 0.005)[1]
    assert (q[:10] == 0).all()
    assert q[9 + 20 : 11 + 20].mean() == pytest.approx(8.0 * (1 - np.exp(-1)), rel=0.05)
    assert q[-1] == pytest.approx(8.0, rel=1e-3)


def test_shear_thinning_makes_the_melt_quicker_the_faster_it_flows() -> None:
    plant = melt(flow=8.0, tau=0.1, n=0.4, dead=0.0)

    def rise(low: float, high: float) -> int:
        state, _ = plant.run(plant.initial(), np.full(6000, low), 0.001)
        q = plant.run(state, np.full(3000, high), 0.001)[1]
        return int(np.argmax(q > low + 0.632 * (high - low)))

    assert rise(24.0, 26.4) < rise(8.0, 8.8) < rise(2.0, 2.2)
    assert rise(8.0, 8.8) == pytest.approx(100, rel=0.1)


def test_melt_that_is_not_retracted_oozes() -> None:
    plant = melt(flow=8.0, tau=0.4)
    state, _ = plant.run(plant.initial(), np.full(400, 8.0), DT)
    _, oozed = plant.run(state, np.zeros(100), DT)
    state, retracted = plant.run(state, np.concatenate([np.full(20, -40.0), np.zeros(80)]), DT)
    assert oozed.sum() * DT > 1.0
    assert retracted[25:].sum() == 0.0
    again = plant.run(state, np.concatenate([np.full(20, 40.0), np.full(100, 8.0)]), DT)[1]
    assert again[-1] == pytest.approx(8.0, rel=0.15)


def test_pellet_net_flow_is_drag_minus_pressure_flow() -> None:
    plant = pellet(flow=1500.0, leak=0.2, n=0.5, dead=0.0)
    for share in (0.4, 1.0, 1.5):
        q = settled(plant, 1500.0 * share)
        pressure_share = (q / 1500.0) ** 0.5
        assert q / 1500.0 == pytest.approx(1.2 * share - 0.2 * pressure_share, rel=1e-4)


def test_pellet_waits_and_overshoots() -> None:
    plant = pellet(flow=1500.0, dead=0.25)
    q = plant.run(plant.initial(), np.full(3000, 1500.0), DT)[1]
    assert (q[:25] == 0).all()
    assert q[26] > 0
    assert 1.01 < q.max() / 1500.0 < 1.2
    tame = pellet(flow=1500.0, speed_loop=0.0, dead=0.0)
    assert tame.run(tame.initial(), np.full(3000, 1500.0), DT)[1].max() < 1500.0 * 1.0001


def test_pellet_drifts_slowly() -> None:
    plant = load_plant("pellet", seed=4)
    q = plant.run(plant.initial(), np.full(12000, 1500.0), 0.1)[1][500:]
    assert 0.02 < (q.max() - q.min()) / 1500.0 < 0.09
    assert np.abs(np.diff(q)).max() < 1.0
