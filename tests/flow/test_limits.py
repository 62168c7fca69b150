from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcodectl.flow.limits import conserve_kernel, slew_kernel, within_limits

signals = arrays(np.float64, st.integers(1, 60), elements=st.floats(-40, 40, width=32))


@settings(deadline=None, max_examples=60)  # the first call compiles
@given(signals)
def test_limits_hold_and_a_second_pass_changes_nothing(u):
    out = within_limits(u, 5.0, 300.0, 0.01)
    assert np.abs(out).max() <= 5.0
    assert np.abs(np.diff(out)).max(initial=0.0) <= 3.0 + 1e-9
    np.testing.assert_allclose(within_limits(out, 5.0, 300.0, 0.01), out, atol=1e-9)


@settings(deadline=None, max_examples=60)  # the first call compiles
@given(signals)
def test_down_is_treated_as_up(u):
    np.testing.assert_array_equal(within_limits(-u, 5.0, 300.0, 0.01), -within_limits(u, 5.0, 300.0, 0.01))


@settings(deadline=None, max_examples=60)  # the first call compiles
@given(signals)
def test_volume_is_kept_wherever_there_is_room_for_it(u):
    padded = np.concatenate([np.zeros(600), u, np.zeros(600)])
    assert within_limits(padded, 5.0, np.inf, 0.01).sum() == pytest.approx(padded.sum(), abs=1e-6)


@settings(deadline=None, max_examples=60)  # the first call compiles
@given(signals)
def test_a_signal_within_the_limits_comes_back_as_it_is(u):
    out = within_limits(u, 41.0, np.inf, 0.01)
    np.testing.assert_array_equal(out, u)
    assert out is not u


@settings(deadline=None, max_examples=60)  # the first call compiles
@given(signals)
def test_kernels_give_the_same_as_plain_python(u):
    np.testing.assert_allclose(conserve_kernel(u, 5.0), conserve_kernel.py_func(u, 5.0), rtol=0, atol=1e-12)
    np.testing.assert_allclose(slew_kernel(u, 3.0), slew_kernel.py_func(u, 3.0), rtol=0, atol=1e-12)


def test_a_lump_goes_half_before_and_half_after():
    u = np.zeros(21)
    u[10] = 50.0
    out = within_limits(u, 10.0, np.inf, 0.01)
    np.testing.assert_allclose(out[8:13], 10.0)
    assert out.sum() == pytest.approx(50.0)


def test_what_finds_no_room_before_goes_after():
    u = np.zeros(20)
    u[0] = 50.0
    np.testing.assert_allclose(within_limits(u, 10.0, np.inf, 0.01), [10.0] * 5 + [0.0] * 15)


def test_what_finds_no_room_after_goes_before():
    u = np.zeros(20)
    u[-1] = 50.0
    np.testing.assert_allclose(within_limits(u, 10.0, np.inf, 0.01), [0.0] * 15 + [10.0] * 5)


def test_only_what_has_no_room_at_all_is_lost():
    np.testing.assert_allclose(within_limits(np.full(20, 11.0), 10.0, np.inf, 0.01), 10.0)


def test_a_step_keeps_its_volume_at_the_slew_limit():
    u = np.concatenate([np.zeros(50), np.full(50, 8.0), np.zeros(50)])
    out = within_limits(u, 10.0, 100.0, 0.01)
    assert np.abs(np.diff(out)).max() <= 1.0 + 1e-12
    assert out.sum() == pytest.approx(u.sum())
    assert out[49] > 0
    assert out[50] < 8
