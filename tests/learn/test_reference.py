from __future__ import annotations

import numpy as np
import pytest

from gcodectl.errors import UsageError
from gcodectl.learn.reference import training_routine


def test_a_pulse_with_a_pause_in_it():
    r = training_routine(5.0, speed=10.0, accel=100.0, pause=0.2)
    q, t = r.q_ref, r.t + r.dt / 2
    assert len(q) == len(t) == round(r.duration / r.dt)
    np.testing.assert_allclose(q[(t < r.start) | (t > r.stop)], 0.0, atol=1e-9)
    assert q.max() == pytest.approx(5.0)
    paused = (t > r.corner[0] + 0.1 + 1e-9) & (t < r.corner[1] - 0.1 - 1e-9)
    np.testing.assert_allclose(q[paused], 0.0, atol=1e-9)
    np.testing.assert_allclose(q, 5.0 * r.v / 10.0)
    assert q[:700].sum() * r.dt == pytest.approx(5.0 * (3.0 - 0.05)), "half a ramp is lost at the start"


def test_dip_is_the_flow_that_the_corner_leaves_out():
    r = training_routine(5.0, speed=10.0, accel=40.0, pause=0.3)
    middle = (r.t > r.start + 1) & (r.t < r.stop - 1)
    missing = np.sum(5.0 - r.q_ref[middle]) * r.dt / 5.0
    assert r.dip == pytest.approx(missing, abs=1e-9)
    assert r.dip == pytest.approx(0.3 + 10.0 / 40.0)
    assert r.corner_middle == pytest.approx(sum(r.corner) / 2)


def test_acceleration_is_the_gantrys():
    r = training_routine(5.0, speed=10.0, accel=50.0)
    assert np.abs(np.diff(r.v)).max() == pytest.approx(50.0 * r.dt)


def test_a_slow_material_gets_a_longer_routine():
    quick, slow = training_routine(5.0, lag=0.05), training_routine(5.0, lag=9.0)
    assert quick.start == pytest.approx(4.0)
    assert quick.corner[0] - quick.start == pytest.approx(6.0)
    assert slow.duration > 2.5 * quick.duration


@pytest.mark.parametrize(
    "wrong",
    [{"flow": 0}, {"flow": 5, "accel": -1}, {"flow": 5, "pause": -0.1}, {"flow": 5, "lengths": (1, 0.01, 1, 1)}],
)
def test_an_impossible_routine_is_refused(wrong):
    with pytest.raises(UsageError, match="training routine"):
        training_routine(**wrong)
