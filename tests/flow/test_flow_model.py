"""The flow model: what each structure does, against closed forms and finer steps, and what it refuses to be."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from flow_models import LINEAR, MODELS, PLUNGER, PRESSURE, SCREW
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import plain_python

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.flow.flow_model import (
    PARAMETERS,
    STATE,
    STORED,
    STRUCTURES,
    FlowModel,
    delayed,
    flow_kernel,
    predict_kernel,
    slope_kernel,
    stored_kernel,
)

DT = 0.01
EACH = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def pulse(rate: float = 6.0, before: int = 50, on: int = 400, after: int = 400) -> Floats:
    return np.concatenate([np.zeros(before), np.full(on, rate), np.zeros(after)])


def rough(seed: int, n: int = 600, least: float = -10.0) -> Floats:
    """Steps of random height and length."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(least, 15.0, n // 20 + 1), 20)[:n]


@EACH
def test_the_steady_rate_holds_the_flow(model: FlowModel) -> None:
    for flow in (1.0, 5.0, 9.0):
        u = np.full(4000, model.steady_rate(flow))
        assert model.predict(u, DT)[-1] == pytest.approx(flow, rel=1e-3)


@EACH
def test_nothing_in_nothing_out_and_never_a_flow_back(model: FlowModel) -> None:
    assert not model.predict(np.zeros(100), DT).any()
    assert (model.predict(rough(3), DT) >= 0).all()


def test_a_linear_model_is_a_lag() -> None:
    model = dataclasses.replace(LINEAR, delay=0.0)
    tau = model.store / model.flow
    edges = np.arange(1001) * DT
    wanted = np.diff(model.K * 6.0 * (edges + tau * np.exp(-edges / tau))) / DT  # means over the samples
    assert model.predict(np.full(1000, 6.0), DT) == pytest.approx(wanted, abs=2e-3)


@pytest.mark.parametrize("model", [LINEAR, PLUNGER], ids=["linear", "plunger"])
@settings(max_examples=20)
@given(seed=st.integers(0, 1000))
def test_a_plunger_conserves_volume(model: FlowModel, seed: int) -> None:
    model = dataclasses.replace(model, delay=0.0)
    u, state = rough(seed, least=0.0), model.at_rest
    q = np.empty(len(u))
    predict_kernel(state, u, DT, model.parameters, q)
    put_in = model.K * u.sum() * DT  # at rest the gap is closed, and u never turns back
    assert q.sum() * DT + state[STORED] == pytest.approx(put_in, rel=1e-4)


def test_a_screw_loses_what_leaks_and_a_pressure_is_no_store_of_volume() -> None:
    still, leaks = (dataclasses.replace(SCREW, leak=leak) for leak in (0.0, 0.2))
    out, less = (model.predict(pulse(after=2000), DT).sum() for model in (still, leaks))
    assert out * DT == pytest.approx(6.0 * 4.0, rel=0.01)
    assert less < 0.97 * out
    twice = [PRESSURE.predict(np.full(1000, u), DT)[-1] for u in (PRESSURE.steady_rate(5), 2 * PRESSURE.steady_rate(5))]
    assert twice[1] > 3.0 * twice[0]  # no multiple of u


def test_below_the_threshold_nothing_flows_and_above_it_a_power_does() -> None:
    p = PLUNGER.parameters
    assert flow_kernel(PLUNGER.threshold, p) == slope_kernel(PLUNGER.threshold - 1, p) == 0.0
    assert flow_kernel(PLUNGER.threshold + PLUNGER.store, p) == pytest.approx(PLUNGER.flow)
    assert flow_kernel(PLUNGER.threshold + PLUNGER.store / 2, p) == pytest.approx(PLUNGER.flow / 4)


@given(st.sampled_from(sorted(MODELS)), st.floats(0.01, 20.0))
def test_f_is_inverted_and_its_slope_is_its_slope(structure: str, flow: float) -> None:
    p = MODELS[structure].parameters
    stored = stored_kernel(flow, p)
    assert flow_kernel(stored, p) == pytest.approx(flow, rel=1e-9)
    h = 1e-6
    slope = (flow_kernel(stored + h, p) - flow_kernel(stored - h, p)) / (2 * h)
    assert slope_kernel(stored, p) == pytest.approx(slope, rel=1e-4)


@EACH
def test_the_step_is_fine_enough(model: FlowModel) -> None:
    # four times finer samples, averaged: the same flow to 2 % of the nominal one; a drive that swings is coarser
    model = dataclasses.replace(model, delay=0.0)
    u = rough(7, least=0.0)
    coarse, fine = model.predict(u, DT), model.predict(np.repeat(u, 4), DT / 4)
    assert np.abs(coarse - fine.reshape(-1, 4).mean(axis=1)).max() < (0.05 if model.swing else 0.02) * model.flow


def test_a_stiff_store_is_stable() -> None:
    model = FlowModel("linear", K=1.0, flow=5.0, store=0.01)  # a lag of 2 ms
    q = model.predict(pulse(5.0, on=100), DT)
    assert q.max() < 5.0 * 1.01
    assert q[120] == pytest.approx(5.0, rel=1e-3)
    assert q[200:].max() < 1e-3


def test_backlash_is_lost_and_found() -> None:
    stiff = FlowModel("plunger", K=1.0, flow=5.0, store=0.05, gap=0.5)
    back = np.concatenate([pulse(5.0, 0, 200, 20), np.full(10, -5.0), np.full(200, 5.0)])
    q = stiff.predict(back, DT)
    assert q[5] > 4.0  # the gap is closed at first
    assert q[231] < 0.1  # 0.5 mm^3 back, and as much forth again, before anything flows
    assert q[229 + 10 : 229 + 12].max() > 1.0
    assert q[-1] == pytest.approx(5.0, rel=1e-3)


def test_a_vacuum_pulls_no_more_than_its_limit() -> None:
    back = np.concatenate([np.full(200, PRESSURE.steady_rate(5.0)), np.full(40, -25.0)])
    limited = np.where(back < -PRESSURE.pull, -PRESSURE.pull, back)
    assert np.array_equal(PRESSURE.predict(back, DT), PRESSURE.predict(limited, DT))
    assert not np.array_equal(PRESSURE.predict(back, DT), dataclasses.replace(PRESSURE, pull=25.0).predict(back, DT))


def test_a_drive_that_swings_overshoots_by_its_damping() -> None:
    drive = FlowModel("screw", K=1.0, flow=5.0, store=0.02, swing=0.2, damping=0.4)
    q = drive.predict(np.full(1000, 5.0), DT)
    overshoot = math.exp(-math.pi * 0.4 / math.sqrt(1 - 0.4**2))
    assert q.max() / 5.0 - 1.0 == pytest.approx(overshoot, rel=0.1)
    assert q[-1] == pytest.approx(5.0, rel=1e-3)


@EACH
def test_dead_time_shifts(model: FlowModel) -> None:
    u = rough(5)
    now, later = (dataclasses.replace(model, delay=d).predict(u, DT) for d in (0.0, 0.25))
    assert later[25:] == pytest.approx(now[:-25], abs=1e-12)
    assert not later[:25].any()


@given(st.floats(0, 30), st.integers(0, 100))
def test_a_delay_of_any_number_of_samples_keeps_volume(samples: float, seed: int) -> None:
    u = np.concatenate([np.random.default_rng(seed).normal(size=20), np.zeros(32)])
    late = delayed(u, samples)
    assert len(late) == len(u)
    assert late.sum() == pytest.approx(u.sum(), abs=1e-9)
    centre = np.arange(len(u)) @ np.abs(u) / np.abs(u).sum()
    if samples == int(samples):
        assert np.arange(len(u)) @ np.abs(late) / np.abs(late).sum() == pytest.approx(centre + samples)
        assert np.array_equal(late[int(samples) :], u[: len(u) - int(samples)])


@EACH
def test_where_it_is_cut_makes_no_difference(model: FlowModel) -> None:
    u = rough(11)
    whole, state = np.empty(len(u)), model.at_rest
    predict_kernel(state, u, DT, model.parameters, whole)
    again, parts = model.at_rest, np.empty(len(u))
    for k in range(0, len(u), 7):
        predict_kernel(again, u[k : k + 7], DT, model.parameters, parts[k : k + 7])
    assert np.array_equal(whole, parts)
    assert np.array_equal(state, again)


@EACH
def test_the_same_with_the_jit_off(model: FlowModel) -> None:
    u = rough(13, 120)
    wanted, steady = model.predict(u, DT), model.steady_rate(5.0)
    with plain_python("gcodectl.flow"):
        assert model.predict(u, DT) == pytest.approx(wanted, abs=1e-12)
        assert model.steady_rate(5.0) == pytest.approx(steady)


@EACH
def test_the_table_has_every_parameter(model: FlowModel) -> None:
    again = FlowModel(**model.table())
    assert again == model
    assert len(model.parameters) == PARAMETERS
    assert len(model.at_rest) == STATE


@pytest.mark.parametrize(
    "wrong",
    [
        {"structure": "magic"}, {"K": 0.0}, {"K": math.nan}, {"store": -1.0}, {"flow": math.inf}, {"power": 0.0},
        {"delay": -0.1}, {"gap": -1.0}, {"leak": -1.0}, {"swing": -1.0}, {"lag": 0.0}, {"threshold": math.nan},
    ],
)  # fmt: skip
def test_what_cannot_be_is_an_input_error(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError, match="flow model"):
        dataclasses.replace(LINEAR, **wrong)  # type: ignore[arg-type]


def test_a_threshold_may_lie_below_rest() -> None:
    oozes = dataclasses.replace(PLUNGER, threshold=-1.0)
    assert oozes.predict(np.zeros(10), DT)[0] > 0.0
    assert set(MODELS) == set(STRUCTURES)


def test_a_model_says_what_sets_it_apart() -> None:
    plain = FlowModel("linear", K=1.0, flow=5.0, store=5.0)
    assert plain.sentence() == "linear, K 1.000, 5 mm^3 stored at 5 mm^3/s, lag 1 s there, power 1.00"
    worn = FlowModel("backlash", K=1.0, flow=5.0, store=5.0, gap=0.5, delay=0.2, threshold=1.0)
    assert worn.sentence().endswith("yield 1 mm^3, dead time 0.200 s, backlash 0.5 mm^3")
    assert "swings at 4 rad/s" in FlowModel("screw", K=1.0, flow=5.0, store=5.0, swing=0.25).sentence()
