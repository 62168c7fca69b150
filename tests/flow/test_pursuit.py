"""Pursuit: what to tell a plunger that cannot jump, and a course followed."""

from __future__ import annotations

import numpy as np
import pytest
from flow_models import MODELS
from hypothesis import given
from hypothesis import strategies as st

from gcodectl.flow.flow_model import STORED
from gcodectl.flow.inversion import Inversion
from gcodectl.flow.pursuit import (
    braked_kernel,
    easing_kernel,
    leaving_kernel,
    slewed_kernel,
    stand_kernel,
    telling_kernel,
)

DT = 0.01


@given(st.floats(0.0, 5.0), st.floats(50.0, 5000.0))
def test_a_braked_rate_comes_to_rest_within_what_is_left(left: float, slew: float) -> None:
    rate = braked_kernel(left, slew, DT)
    assert braked_kernel.py_func(left, slew, DT) == pytest.approx(rate)
    # one sample at this rate, and then down by slew a sample
    steps = np.arange(rate, 0.0, -slew * DT)
    gone = sum(slewed_kernel(max(one - slew * DT, 0.0), one, slew * DT) for one in steps) * DT
    assert gone <= left + 0.13 * slew * DT**2


@given(st.floats(-25, 25), st.floats(-25, 25), st.floats(1, 60))
def test_a_slewed_sample_can_be_told(told: float, last: float, most: float) -> None:
    told = min(max(told, last - most), last + most)
    mean = slewed_kernel(told, last, most)
    assert min(told, last) - 1e-9 <= mean <= max(told, last) + 1e-9
    assert telling_kernel(mean, last, most) == pytest.approx(told, abs=1e-5)
    assert slewed_kernel.py_func(told, last, most) == mean
    assert telling_kernel.py_func(mean, last, most) == pytest.approx(telling_kernel(mean, last, most), abs=1e-9)


@given(st.sampled_from(sorted(MODELS)), st.floats(-1.0, 8.0), st.floats(-25, 25))
def test_a_step_is_the_models_own(structure: str, stored: float, rate: float) -> None:
    model = MODELS[structure]
    p = Inversion(model, 25.0, 1e9, DT).row
    state = model.at_rest
    state[STORED] = stored
    change = stand_kernel.py_func(state, rate, rate, p)
    assert state[STORED] == pytest.approx(stored + change)
    flow, slope, lost = (one[0] for one in model.outflow(np.array([stored])))
    assert leaving_kernel(stored, flow, p) == leaving_kernel.py_func(stored, flow, p) == pytest.approx(lost)
    eased = easing_kernel(stored, flow, p)
    assert eased == easing_kernel.py_func(stored, flow, p) == pytest.approx(1.0 + 0.5 * DT * slope)
    if model.swing == 0.0 and rate > 0.0:
        assert change == pytest.approx(DT * (model.K * rate - lost) / eased, abs=1e-9)
