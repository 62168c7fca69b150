from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gcodectl.learn.convergence import convergence
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import Model

A = Law(Model(1.08, 2.7), 0.01)


def test_the_nominal_law_converges_and_is_worst_where_nothing_is_learned_fast():
    check = convergence(A)
    assert check.converges
    assert check.worst == pytest.approx(0.75, abs=1e-6)
    assert check.worst_frequency == 0.0
    assert "converges" in check.sentence()


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.2, 0.4])
@pytest.mark.parametrize("causal", [False, True])
def test_the_curve_is_what_the_formula_says(delay, causal):
    law = dataclasses.replace(A, causal=causal)
    check = convergence(law, Model(1.3, 2.0, delay))
    z = np.exp(2j * np.pi * check.frequency * 0.01)
    p, n = np.exp(-0.01 / 2.0), np.exp(-0.01 / 2.7)
    P = 1.3 * (1 - p) * z / (z - p) * z ** -round(delay / 0.01)
    L = 0.25 * (z - n) / (1.08 * (1 - n) * z)
    b, a = law.butterworth()
    B = np.polyval(b, z) / np.polyval(a, z)
    Q = B if causal else abs(B) ** 2
    np.testing.assert_allclose(check.shrink, abs(Q * (1 - L * P)), atol=1e-9)
    np.testing.assert_allclose(check.remains, abs((1 - Q) / (1 - Q * (1 - L * P))), atol=1e-7)


@pytest.mark.parametrize("frequency", [0.5, 1.67, 2.5])
def test_a_sine_of_error_shrinks_or_grows_as_the_curve_says(plant, frequency):
    """Brute force: one trial with an error of one frequency, measured far from the ends."""
    extruder = plant(1.08, 2.7, 0.2)
    t = np.arange(8000) * 0.01
    error = np.sin(2 * np.pi * frequency * t)
    after = A.smooth(error - extruder(A.learn(error), 0.01))
    wave = np.exp(2j * np.pi * frequency * t)[3000:6000]
    ratio = abs(np.vdot(wave, after[3000:6000])) / abs(np.vdot(wave, error[3000:6000]))
    check = convergence(A, Model(1.08, 2.7, 0.2))
    assert ratio == pytest.approx(np.interp(frequency, check.frequency, check.shrink), rel=0.01)


def test_a_dead_time_of_a_fifth_of_a_second_diverges_until_it_is_in_the_model():
    late = Model(1.08, 2.7, 0.2)
    check = convergence(A, late)
    assert not check.converges
    assert 1.03 < check.worst < 1.06
    assert 1.4 < check.worst_frequency < 2.0
    assert "would diverge" in check.sentence()
    assert convergence(A.with_delay(0.2), late).worst == pytest.approx(0.75, abs=1e-6)


def test_a_causal_q_converges_but_leaves_much_more():
    causal = convergence(dataclasses.replace(A, causal=True))
    assert causal.converges
    at_a_third = [np.interp(1 / 3, c.frequency, c.remains) for c in (causal, convergence(A))]
    assert at_a_third[0] > 0.3
    assert at_a_third[1] < 0.01
