"""Inversion: the model inverted on itself gives the flow asked for where the plunger can follow, within its limits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flow_models import LINEAR, MODELS, PLUNGER, PRESSURE, SCREW
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import plain_python

from gcodectl.columns import Floats
from gcodectl.flow.course import ahead_kernel, between_kernel, price_kernel, rate_kernel, value_kernel
from gcodectl.flow.flow_model import STORED, FlowModel, stored_kernel
from gcodectl.flow.inversion import BLOCK, LEVELS, SLOW_DRIVE, Inversion
from gcodectl.flow.pursuit import advance_kernel, braked_kernel, follow_kernel, slewed_kernel, telling_kernel

DT = 0.01
CAP, SLEW = 25.0, 2000.0
EACH = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def road(*flows: float, ramp: float = 0.6, lasts: float = 3.0, rest: float = 2.0) -> Floats:
    """Roads at these flows, with ramps and rests of so many seconds."""
    parts = [np.zeros(round(rest / DT))]
    for flow in flows:
        up = np.linspace(0.0, flow, round(ramp / DT) + 2)[1:-1]
        parts += [up, np.full(round(lasts / DT), flow), up[::-1], np.zeros(round(rest / DT))]
    return np.concatenate(parts)


def stiff(model: FlowModel) -> Inversion:
    return Inversion(model, CAP, SLEW, DT)


def laid(model: FlowModel, told: Floats, slew: float = SLEW) -> Floats:
    """The flow that rates told give, through a plunger that gets to each at its slew."""
    mean = np.array(
        [slewed_kernel(now, last, slew * DT) for now, last in zip(told, np.append(0.0, told), strict=False)]
    )
    return model.predict(mean, DT)


def rms(x: Floats) -> float:
    return float(np.sqrt(np.mean(x**2)))


@EACH
def test_it_inverts_where_the_plunger_can_follow(model: FlowModel) -> None:
    wanted = road(5.0, 2.5, 6.0)
    u = stiff(model).along(wanted)
    q = laid(model, u, stiff(model).slew)
    plain = model.predict(wanted * model.steady_rate(5.0) / 5.0, DT)
    assert rms(q - wanted) < 0.03 * 5.0
    assert rms(q - wanted) < 0.15 * rms(plain - wanted)
    assert q[wanted == 0].sum() < 0.01 * wanted.sum()


@EACH
def test_a_sharp_road_is_done_as_well_as_the_cap_lets_it(model: FlowModel) -> None:
    wanted = road(5.0, 5.0, ramp=0.0)
    q = laid(model, stiff(model).along(wanted), stiff(model).slew)
    plain = model.predict(wanted * model.steady_rate(5.0) / 5.0, DT)
    assert rms(q - wanted) < 0.6 * rms(plain - wanted)
    assert q.sum() == pytest.approx(wanted.sum(), rel=0.05)


@settings(max_examples=12)
@given(st.sampled_from(sorted(MODELS)), st.floats(3.0, 25.0), st.floats(100.0, 3000.0), st.integers(0, 99))
def test_the_plunger_keeps_its_limits(structure: str, cap: float, slew: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    wanted = np.repeat(np.maximum(rng.uniform(-5.0, 10.0, 30), 0.0), 25)
    model = MODELS[structure]
    u = Inversion(model, cap, slew, DT).along(wanted)
    assert np.isfinite(u).all()
    assert len(u) == len(wanted)
    assert np.abs(u).max() <= cap * (1 + 1e-9)
    if model.swing == 0.0:
        assert np.abs(np.diff(u, prepend=0.0)).max() <= slew * DT * (1 + 1e-9)


def test_slew_of_a_drive_that_swings_is_what_is_simulated() -> None:
    # it is told more than its slew where that is what the swing takes; the state is advanced as the plunger goes
    inversion = stiff(SCREW)
    u = inversion.along(road(5.0))
    assert inversion.cap == pytest.approx(SLOW_DRIVE * CAP)
    assert np.abs(u).max() <= CAP


@EACH
def test_dead_time_is_a_shift(model: FlowModel) -> None:
    wanted = road(5.0)
    at_once, late = (stiff(dataclasses.replace(model, delay=d)).along(wanted) for d in (0.0, 0.3))
    # a threshold is pre-charged from the very begin; what comes for the road comes 30 samples sooner
    begins = [np.flatnonzero(u[100:] > u[100] + 1.0)[0] for u in (at_once, late)]
    assert begins[0] - begins[1] in (29, 30, 31)
    # blocks of decisions fall on other places of the road, so the same only to within their prices' ties
    q = [laid(dataclasses.replace(model, delay=d), u) for d, u in ((0.0, at_once), (0.3, late))]
    assert rms(q[0] - q[1]) < 0.02 * 5.0


def test_asking_takes_off_the_dead_time_by_parts_of_a_sample_too() -> None:
    inversion = stiff(dataclasses.replace(LINEAR, delay=0.025))
    wanted = np.arange(40.0)
    asked, reach = inversion.ask(wanted), inversion.reach
    assert asked == pytest.approx(wanted[reach : reach + len(asked)] + 2.5)
    assert len(asked) == 40 - 2 * reach - 3


def test_jumps_are_made_ramps_that_keep_their_volume_and_no_longer_than_the_plunger_takes() -> None:
    for slew in (100.0, 300.0, 2000.0):
        inversion = Inversion(dataclasses.replace(LINEAR, delay=0.0), CAP, slew, DT)
        wanted = np.concatenate([np.zeros(200), np.full(300, 5.0), np.zeros(200)])
        asked, reach = inversion.ask(wanted), inversion.reach
        assert reach * DT <= CAP / slew + DT
        assert asked.sum() == pytest.approx(wanted.sum())
        assert (asked >= 0.0).all()
        there = np.flatnonzero((asked > 1e-9) & (asked < 5.0 - 1e-9))
        assert len(there) == 4 * reach
    assert Inversion(LINEAR, CAP, 1e9, DT).reach == 0


def test_what_is_left_in_the_barrel_counts() -> None:
    inversion, wanted = stiff(PLUNGER), np.full(400, 5.0)
    full, empty = PLUNGER.at_rest, PLUNGER.at_rest
    full[STORED] = stored_kernel(5.0, PLUNGER.parameters)
    u_full, last = inversion.solve(wanted, 100, full, PLUNGER.steady_rate(5.0))
    u_empty, _ = inversion.solve(wanted, 100, empty, 0.0)
    assert u_full == pytest.approx(PLUNGER.steady_rate(5.0), abs=0.2)
    assert last == u_full[-1]
    assert u_empty[:20].max() > 20.0
    assert u_empty.sum() - u_full.sum() > 0.5 * stored_kernel(5.0, PLUNGER.parameters) / PLUNGER.K / DT


@pytest.mark.parametrize("gap", [0.0, 0.05, 0.1, 0.2, 0.5])
@pytest.mark.parametrize("slew", [300.0, 2000.0])
def test_between_roads_it_waits_just_below_the_threshold_and_is_still(gap: float, slew: float) -> None:
    model = dataclasses.replace(PLUNGER, gap=gap)
    inversion = Inversion(model, CAP, slew, DT)
    for stored in (0.0, stored_kernel(5.0, model.parameters)):
        state = model.at_rest
        state[STORED] = stored
        u, _ = inversion.solve(np.zeros(1000), 800, state, 0.0)
        assert inversion.rest - gap - 0.011 * model.store < state[STORED] <= model.threshold + 0.03 * model.store
        # it does not chatter across its backlash: nothing moves once it is there
        assert np.abs(u[200:]).sum() * DT < 0.05
    assert inversion.rest < model.threshold


@pytest.mark.parametrize("gap", [0.1, 0.3])
def test_a_steady_road_is_steady_across_a_backlash_and_a_slow_plunger(gap: float) -> None:
    model = dataclasses.replace(PLUNGER, gap=gap)
    inversion = Inversion(model, CAP, 300.0, DT)
    u = inversion.along(road(5.0, lasts=4.0))
    assert u[420:550].std() < 0.05
    assert u[420:550].mean() == pytest.approx(model.steady_rate(5.0), rel=0.02)


@given(st.floats(0.0, 5.0), st.floats(50.0, 5000.0))
def test_a_braked_rate_comes_to_rest_within_what_is_left(left: float, slew: float) -> None:
    rate = braked_kernel(left, slew, DT)
    assert braked_kernel.py_func(left, slew, DT) == pytest.approx(rate)
    # one sample at this rate, and then down by slew a sample
    steps = np.arange(rate, 0.0, -slew * DT)
    gone = sum(slewed_kernel(max(one - slew * DT, 0.0), one, slew * DT) for one in steps) * DT
    assert gone <= left + 0.13 * slew * DT**2


def test_a_block_at_a_time_is_good_enough_to_look_ahead_no_further() -> None:
    # twice the horizon does not change what is laid
    wanted = road(5.0, 3.0, lasts=4.0)
    assert len(wanted) > 2 * BLOCK
    near, far = stiff(PLUNGER), stiff(PLUNGER)
    far.__dict__["horizon"] = 2 * near.horizon
    assert rms(near.along(wanted) - far.along(wanted)) < 0.05 * 5.0


def test_filling_and_emptying_times_of_a_lag_by_hand() -> None:
    lag = FlowModel("linear", K=1.0, flow=5.0, store=5.0)
    rise, fall = Inversion(lag, 25.0, 1e9, DT).transit(5.0)
    below = 0.02  # the pre-charge is that much below 0
    assert rise == pytest.approx(np.log((25 + 5 * below) / 20), rel=0.05)
    assert fall == pytest.approx(np.log(30 / (25 - 5 * below)), rel=0.05)
    slow = Inversion(lag, 10.0, 1e9, DT).transit(5.0)
    assert slow[0] > rise
    assert Inversion(lag, 5.0, 1e9, DT).transit(6.0)[0] < np.inf  # out of reach, and yet a number
    one = Inversion(PLUNGER, CAP, SLEW, DT)
    assert one.lead == pytest.approx(one.transit(5.0)[0] + PLUNGER.delay)
    assert one.tail == one.transit(5.0)[1]


def test_without_a_cap_there_still_is_one() -> None:
    inversion = Inversion(LINEAR, np.inf, np.inf, DT)
    assert np.isfinite([inversion.cap, inversion.slew]).all()
    u = inversion.along(road(5.0, ramp=0.0))
    assert rms(laid(LINEAR, u, inversion.slew) - road(5.0, ramp=0.0)) < 0.05 * 5.0


def test_nothing_wanted_nothing_told() -> None:
    u = stiff(LINEAR).along(np.zeros(300))
    assert u.sum() * DT * LINEAR.K == pytest.approx(stiff(LINEAR).rest, rel=0.1)  # the pre-charge, no more
    assert not laid(LINEAR, u).any()


@given(st.floats(-25, 25), st.floats(-25, 25), st.floats(1, 60))
def test_a_slewed_sample_can_be_told(told: float, last: float, most: float) -> None:
    told = min(max(told, last - most), last + most)
    mean = slewed_kernel(told, last, most)
    assert min(told, last) - 1e-9 <= mean <= max(told, last) + 1e-9
    assert telling_kernel(mean, last, most) == pytest.approx(told, abs=1e-5)
    assert slewed_kernel.py_func(told, last, most) == mean
    assert telling_kernel.py_func(mean, last, most) == pytest.approx(telling_kernel(mean, last, most), abs=1e-9)


@given(st.sampled_from(sorted(MODELS)), st.floats(-1.0, 8.0), st.floats(-25, 25))
def test_a_step_ahead_is_inverted(structure: str, stored: float, rate: float) -> None:
    p = MODELS[structure].parameters
    there = ahead_kernel(stored, rate, DT, p)
    assert rate_kernel(stored, there, DT, p) == pytest.approx(rate, abs=1e-6)
    assert ahead_kernel.py_func(stored, rate, DT, p) == pytest.approx(there)


def test_prices() -> None:
    p = PLUNGER.parameters
    assert price_kernel(5.0, 6.0, 5.0, 0.0, p) == 0.0
    assert price_kernel(2.0, 6.0, 5.0, 0.0, p) > price_kernel(4.0, 6.0, 5.0, 0.0, p)
    assert price_kernel(1.0, 2.0, 0.0, 2.0, p) == pytest.approx(1.0 / 5.0)
    assert 0.0 < price_kernel(0.0, 1.0, 0.0, 2.0, p) < 1e-3
    row = np.array([0.0, 1.0, 4.0])
    assert [between_kernel(row, x, 0.0, 0.5) for x in (-1.0, 0.25, 0.75, 9.0)] == [0.0, 0.5, 2.5, 4.0]


@EACH
def test_the_same_with_the_jit_off(model: FlowModel) -> None:
    inversion = stiff(model)
    wanted = inversion.ask(road(5.0, lasts=0.1, rest=0.2, ramp=0.1))

    def run() -> tuple[Floats, Floats, float]:
        state = model.at_rest
        u, last = inversion.solve(wanted, len(wanted) - 10, state, 0.0)
        return u, state, last

    inversion.cap, inversion.rest  # noqa: B018  cached before
    expected = run()
    with plain_python("gcodectl.flow"):
        found = run()
    assert found[0] == pytest.approx(expected[0], abs=1e-6)
    assert found[1] == pytest.approx(expected[1], abs=1e-6)
    assert found[2] == pytest.approx(expected[2], abs=1e-6)


def test_values_are_prices_and_following_pays_them() -> None:
    inversion, p = stiff(LINEAR), LINEAR.parameters
    wanted = road(5.0, lasts=0.5, rest=0.5, ramp=0.3)
    value = np.empty((len(wanted) + 1, LEVELS))
    value_kernel(wanted, DT, p, inversion.cap, inversion.rest, 8.0, value)
    assert (value >= 0.0).all()
    assert (np.diff(value[0]) >= -1e-9).all()  # the road is not yet: the fuller, the worse
    state, u = LINEAR.at_rest, np.empty(len(wanted))
    last = follow_kernel(wanted, DT, p, CAP, SLEW, inversion.rest, 8.0, value, state, 0.0, u)
    again = LINEAR.at_rest
    assert advance_kernel(again, u, DT, SLEW, 0.0, p) == last
    assert again == pytest.approx(state)


def test_pressure_takes_what_its_flow_takes() -> None:
    wanted = road(5.0, lasts=4.0)
    u = stiff(PRESSURE).along(wanted)
    middle = slice(400, 500)
    assert u[middle] == pytest.approx(PRESSURE.steady_rate(5.0), rel=0.02)
