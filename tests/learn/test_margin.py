"""The margin: ramps are moved off the road just as far as the sum of both errors gains by it."""

import dataclasses

import numpy as np
import pytest

from gcodectl.learn.margin import find_margin, with_margin
from gcodectl.learn.reference import training_routine
from gcodectl.learn.segmentation import basis_set
from gcodectl.records import TaskKind


def ramped(routine, seconds):
    """The flow of an extruder that ramps linearly over `seconds`, centred on every edge of the reference."""
    width = max(1, round(seconds / routine.dt))
    return np.convolve(np.pad(routine.q_ref, width, mode="edge"), np.ones(width) / width, mode="same")[width:-width]


@pytest.fixture(scope="module")
def routine():
    return training_routine(5.0, lag=1.0, speed=10.0, accel=500.0, pause=0.2, dt=0.01)


def test_a_flow_that_obeys_at_once_needs_no_margin(routine):
    margin = find_margin(routine.q_ref, routine, 0.84)
    assert margin.start <= 0.02
    assert margin.stop <= 0.02


def test_margins_grow_with_the_ramp_and_stay_within_half_of_it(routine):
    found = [find_margin(ramped(routine, seconds), routine, 0.84) for seconds in (0.2, 0.4, 0.8)]
    for seconds, margin in zip((0.2, 0.4, 0.8), found, strict=True):
        assert 0 < margin.start < seconds / 2
        assert 0 < margin.stop < seconds / 2
    assert found[0].start < found[1].start < found[2].start


def test_a_symmetric_ramp_gives_equal_margins(routine):
    margin = find_margin(ramped(routine, 0.5), routine, 0.84)
    assert margin.start == pytest.approx(margin.stop, abs=0.02)


def test_the_margin_is_the_least_of_what_it_claims_to_make_least(routine):
    """Against the closed form for linear ramps: rms = sqrt(2T/3R) (1/2 - x)^1.5, off = T/R (1/2 + x)^2."""
    length, ramp = 21.0 / 10.0, 0.5
    x = np.linspace(0, 0.5, 2001)
    best = x[np.argmin(np.sqrt(2 * ramp / (3 * length)) * (0.5 - x) ** 1.5 + ramp / length * (0.5 + x) ** 2)] * ramp
    margin = find_margin(ramped(routine, ramp), routine, 0.84)
    assert margin.start == pytest.approx(best, abs=0.04)


def test_signals_are_moved_and_the_record_says_so(routine):
    one = basis_set(routine.q_ref, routine, material="m", nozzle=0.84, training={"seed": 1})
    margin = dataclasses.replace(find_margin(routine.q_ref, routine, 0.84), start=0.1, stop=0.07)
    moved = with_margin(one, margin)
    assert moved.signals[TaskKind.START].lead == pytest.approx(one.signals[TaskKind.START].lead + 0.1)
    assert moved.signals[TaskKind.STOP].lead == pytest.approx(one.signals[TaskKind.STOP].lead - 0.07)
    assert moved.signals[TaskKind.CORNER] == one.signals[TaskKind.CORNER]
    assert moved.training == {"seed": 1, "margin": {"start": 0.1, "stop": 0.07}}
