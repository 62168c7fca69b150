from __future__ import annotations

import itertools

import numpy as np
import pytest

from gcodectl.errors import UsageError
from gcodectl.learn.reference import LEVELS, training_routine, with_levels


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


def test_further_roads_follow_at_their_levels_and_after_their_pauses():
    plain = training_routine(5.0, speed=10.0, accel=100.0)
    r = with_levels(plain)
    assert len(r.more) == len(LEVELS)
    assert r.more[0][0] == plain.duration
    assert r.duration == pytest.approx(plain.duration + sum(lasts + pause for _, lasts, pause in LEVELS))
    q, t = r.q_ref, r.t + r.dt / 2
    np.testing.assert_allclose(q[: len(plain.t)], plain.q_ref, atol=1e-9)
    for (begin, end, level), (wanted, lasts, _) in zip(r.more, LEVELS, strict=True):
        assert level == wanted
        assert end - begin == pytest.approx(lasts)
        inside = (t > begin) & (t < end)
        assert q[inside].max() == pytest.approx(5.0 * level)
        # a ramp's loss at either end is half a ramp's time
        assert q[inside].sum() * r.dt == pytest.approx(5.0 * level * (lasts - level * 10.0 / 100.0), rel=1e-3)
    for (_, end, _), (begin, _, _) in itertools.pairwise(r.more):
        assert np.abs(q[(t > end + r.dt) & (t < begin - r.dt)]).max() < 1e-9
    assert abs(q[-1]) < 1e-9
    assert (np.abs(np.diff(r.v)) <= 100.0 * r.dt * (1 + 1e-6)).all()


def test_the_first_part_of_a_routine_with_further_roads_is_the_routine():
    plain = training_routine(5.0, lag=4.0)
    assert plain.first is plain
    first = with_levels(plain).first
    assert first == plain
    np.testing.assert_array_equal(first.q_ref, plain.q_ref)
