"""Inversion: the model inverted on itself gives the flow asked for where the plunger can follow, within its limits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flow_models import LINEAR, MODELS, PLUNGER, PRESSURE, SCREW
from hypothesis import given, settings
from hypothesis import strategies as st
from inverting import asked_of, solve
from moves import plain_python

from gcodectl.columns import Floats
from gcodectl.flow.flow_model import STORED, FlowModel, stored_kernel
from gcodectl.flow.inversion import AHEAD, SLOW_DRIVE, Inversion
from gcodectl.flow.plungers import BLOCK
from gcodectl.flow.slewing import slewed_kernel

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


def test_what_is_left_in_the_barrel_counts() -> None:
    inversion, wanted = stiff(PLUNGER), np.full(400, 5.0)
    full, empty = PLUNGER.at_rest, PLUNGER.at_rest
    full[STORED] = stored_kernel(5.0, PLUNGER.parameters)
    u_full, last = solve(inversion, wanted, 100, full, PLUNGER.steady_rate(5.0))
    u_empty, _ = solve(inversion, wanted, 100, empty, 0.0)
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
        u, _ = solve(inversion, np.zeros(1000), 800, state, 0.0)
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


def test_a_plunger_that_cannot_jump_takes_its_trapezoid_or_triangle_less_what_lies_beside_the_road() -> None:
    at_cap = Inversion(PLUNGER, CAP, 1e9, DT).transit(5.0)
    for slew in (20.0, 2000.0):
        ramp = CAP / slew
        for jumps, slews in zip(at_cap, Inversion(PLUNGER, CAP, slew, DT).transit(5.0), strict=True):
            whole = jumps + ramp if jumps > ramp else 2.0 * np.sqrt(jumps * ramp)
            assert slews == pytest.approx(jumps + (1.0 - AHEAD) * (whole - jumps), rel=5e-3)


def test_no_more_is_asked_than_lines_carry_but_what_is_smoothed_is_the_same() -> None:
    whole, lines = (Inversion(PLUNGER, CAP, SLEW, DT, carried) for carried in (np.inf, 0.5 * CAP))
    assert lines.cap == pytest.approx(0.5 * whole.cap)
    assert lines.reach == whole.reach
    assert lines.transit(5.0)[0] > whole.transit(5.0)[0]
    assert lines.along(road(5.0)).max() <= 0.5 * CAP * (1 + 1e-9)
    least = Inversion(PLUNGER, CAP, SLEW, DT, 1e-3).cap  # and yet a road can be laid
    assert least >= 2.0 * PLUNGER.steady_rate(PLUNGER.flow)


def test_without_a_cap_there_still_is_one() -> None:
    inversion = Inversion(LINEAR, np.inf, np.inf, DT)
    assert np.isfinite([inversion.cap, inversion.slew]).all()
    u = inversion.along(road(5.0, ramp=0.0))
    # but for the samples in which it jumps
    assert rms(laid(LINEAR, u, inversion.slew) - road(5.0, ramp=0.0)) < 0.06 * 5.0


def test_nothing_wanted_nothing_told() -> None:
    u = stiff(LINEAR).along(np.zeros(300))
    # the pre-charge, no more, to what counts as near enough
    assert u.sum() * DT * LINEAR.K == pytest.approx(stiff(LINEAR).rest, abs=0.01 * LINEAR.store)
    assert not laid(LINEAR, u).any()


@EACH
def test_the_same_with_the_jit_off(model: FlowModel) -> None:
    inversion = stiff(model)
    wanted = asked_of(inversion, road(5.0, lasts=0.1, rest=0.2, ramp=0.1))

    def run() -> tuple[Floats, Floats, float]:
        state = model.at_rest
        u, last = solve(inversion, wanted, len(wanted) - inversion.smooth - 1, state, 0.0)
        return u, state, last

    inversion.row, inversion.table  # noqa: B018  cached before
    expected = run()
    with plain_python("gcodectl.flow"):
        found = run()
    assert found[0] == pytest.approx(expected[0], abs=1e-6)
    assert found[1] == pytest.approx(expected[1], abs=1e-6)
    assert found[2] == pytest.approx(expected[2], abs=1e-6)


def test_pressure_takes_what_its_flow_takes() -> None:
    wanted = road(5.0, lasts=4.0)
    u = stiff(PRESSURE).along(wanted)
    middle = slice(400, 500)
    assert u[middle] == pytest.approx(PRESSURE.steady_rate(5.0), rel=0.02)
