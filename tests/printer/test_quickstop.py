"""Stopping dead: what was done stays, the rest is forgotten."""

from __future__ import annotations

import numpy as np
import pytest
from feeding import JOBS, SETTLED, drain, feed, make_live
from hypothesis import given, settings
from hypothesis import strategies as st


@settings(max_examples=40, deadline=None)
@given(JOBS, st.floats(0, 3))
def test_a_quick_stop_keeps_what_was_done(job: list[bytes], when: float):
    live, now = make_live(), 0.0
    for line in job:
        while not live.ready() and live.deadline() <= when:
            now = live.deadline()
            live.advance(now)
        if not live.ready():
            break
        live.take(line, now)
    live.quickstop(max(now, when))
    assert live.idle
    assert live.ready()
    execution = live.execution()
    if len(execution.phases):
        assert execution.duration <= max(now, when) - live.begun + 1e-9
        np.testing.assert_allclose(execution.position(np.array([1e9]))[0], live.position()[:3], atol=1e-6)
        u = execution.command(0.01)
        assert u.values.sum() * u.dt == pytest.approx(execution.segments.volume.sum(), abs=1e-6)
    feed(live, [b"G90", b"G1 X9 Y9 F600"], 50.0)
    drain(live)
    assert live.position()[:2] == (9.0, 9.0)
    assert not [when for when, _ in live.starved if when > 40]


def test_a_quick_stop_in_mid_move():
    live = make_live()
    feed(live, [*SETTLED, b"G1 X100 E1 F600", b"G1 X200", b"G1 X300"])
    live.quickstop(5.0)
    x, _, _, e = live.position()
    assert x == pytest.approx(50.0, abs=0.2)
    assert e == pytest.approx(x / 100)
    segments = live.execution().segments
    assert segments.length.tolist() == [pytest.approx(x)]
    assert segments.e.tolist() == [pytest.approx(e)]


def test_a_quick_stop_ends_a_dwell():
    live = make_live()
    feed(live, [b"G1 X10 F600", b"G4 S5"])
    live.advance(3.0)
    live.quickstop(3.0)
    assert live.idle
    assert live.execution().duration == pytest.approx(3.0)
    assert live.execution().segments.pause[-1] == pytest.approx(3.0 - 1.02)
    assert live.position()[0] == 10.0
