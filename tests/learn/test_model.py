from __future__ import annotations

import numpy as np
import pytest

from gcodectl.errors import InputError
from gcodectl.learn.model import Model, identify, identify_by_step
from gcodectl.learn.reference import training_routine


def test_the_model_predicts_what_a_first_order_plant_does(plant):
    u = training_routine(5.0).q_ref
    np.testing.assert_allclose(Model(1.08, 2.7, 0.2).predict(u, 0.01), plant(1.08, 2.7, 0.2)(u, 0.01), atol=1e-9)


@pytest.mark.parametrize(
    ("K", "tau", "delay"), [(1.08, 2.7, 0.0), (0.89, 4.5, 0.2), (1.0, 0.05, 0.03), (0.3, 12.0, 0.5)]
)
def test_a_downward_step_gives_gain_lag_and_dead_time(plant, K, tau, delay):
    model = identify_by_step(plant(K, tau, delay), 5.0, 0.01)
    assert pytest.approx(K, rel=0.01) == model.K
    assert model.tau == pytest.approx(tau, rel=0.01)
    assert model.delay == pytest.approx(delay, abs=0.011)


def test_noise_and_an_offset_a_trial_do_not_matter_much(plant):
    u = np.stack([training_routine(5.0).q_ref] * 3)
    offsets = np.array([[0.4], [-0.3], [0.1]])
    q = np.stack([plant(1.08, 2.7, 0.2, noise=0.2, seed=s)(u[0], 0.01) for s in range(3)]) + offsets
    model = identify(u, q, 0.01)
    assert pytest.approx(1.08, rel=0.05) == model.K
    assert model.tau == pytest.approx(2.7, rel=0.05)
    assert model.delay == pytest.approx(0.2, rel=0.2)


def test_a_flow_that_does_not_follow_is_an_input_error():
    u = training_routine(5.0).q_ref
    with pytest.raises(InputError, match="does not follow"):
        identify(u, np.zeros_like(u), 0.01)
    with pytest.raises(InputError, match="no numbers"):
        identify(u, np.full_like(u, np.nan), 0.01)
