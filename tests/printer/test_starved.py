"""When the live planner runs dry, and when it only seems so."""

from __future__ import annotations

import math

import pytest
from feeding import drain, feed, make_live

from plant_models.gantry import PAUSE
from plant_models.printer.live import Live


def slowly(pause: float, between: bytes | None = None) -> Live:
    """Two runs of moves with a silence between them."""
    live = make_live()
    now = feed(live, [b"G1 X10 F600", b"G1 X20", b"G1 X30", b"G1 X40"])
    while live.deadline() < math.inf:
        now = live.deadline()
        live.advance(now)
    if between:
        live.take(between, now + pause / 2)
    feed(live, [b"G1 X50", b"G1 X60", b"G1 X70"], now + pause)
    return drain(live)


def test_a_planner_that_runs_dry_says_so():
    live = slowly(3.0)
    (when, how_long), = live.starved  # fmt: skip
    assert how_long == pytest.approx(3.0)
    execution = live.execution()
    pauses = execution.segments[execution.segments.kind == PAUSE]
    assert pauses.pause.tolist() == [pytest.approx(3.0)]
    assert execution.begins()[execution.segments.kind == PAUSE] == pytest.approx([when])
    assert live.least_buffered == 0.0
    assert execution.duration == pytest.approx(live.begun + 3.0 + 7.1, abs=0.2)


@pytest.mark.parametrize("between", [b"M400", b"M109 S200", b"G28 Z"])
def test_what_is_waited_for_ends_the_starving(between: bytes):
    (_, how_long), = slowly(3.0, between).starved  # fmt: skip
    assert how_long == pytest.approx(1.5)


@pytest.mark.parametrize("wait", [b"M400", b"M109 S200", b"G4 S1", b"M84"])
def test_a_ring_that_is_to_run_dry_starves_nobody(wait: bytes):
    live = make_live()
    now = feed(live, [b"G1 X10 F600", b"G1 X20", b"G1 X30", b"G1 X40", wait])
    while live.deadline() < math.inf:
        now = live.deadline()
        live.advance(now)
    feed(live, [b"G1 X50", b"G1 X60", b"G1 X70"], now + 9.0)
    assert drain(live).starved == []
    assert live.least_buffered > 0


def test_the_end_of_a_job_starves_nobody():
    live = make_live()
    feed(live, [b"G1 X10 F600"])
    drain(live)
    live.advance(100.0)
    feed(live, [b"M400", b"M84", b"M104 S0"], 100.0)
    assert live.starved == []
    assert live.least_buffered == math.inf


def test_the_least_that_was_buffered():
    live = make_live()
    feed(live, [b"G1 X%d F600" % (10 * k) for k in range(1, 16)])
    for k in range(16, 60):
        live.advance(live.deadline())
        assert live.ready()
        live.take(b"G1 X%d" % (10 * k), live.begun + k - 15 + 0.5)
    assert live.least_buffered == pytest.approx(13.5, abs=0.1)
