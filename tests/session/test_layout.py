from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gcodectl.config import load_machine
from gcodectl.errors import UsageError
from gcodectl.session.layout import WIDEST, lay_out, lengths

MACHINE = load_machine("syringe")


def far_apart(path: np.ndarray) -> float:
    """The least distance between places of a path that are more than 10 mm of it apart."""
    s = lengths(path)
    fine = np.linspace(0.0, s[-1], 1500)
    x, y = np.interp(fine, s, path[:, 0]), np.interp(fine, s, path[:, 1])
    apart = np.hypot(x[:, None] - x, y[:, None] - y)
    return float(apart[np.abs(fine[:, None] - fine) > 10.0].min())


@given(
    nozzle=st.floats(0.3, 3.0), duration=st.floats(20.0, 90.0), speed=st.floats(3.0, 40.0),
    lag=st.floats(0.1, 8.0), corner=st.tuples(st.floats(-300.0, 50.0), st.floats(-300.0, 50.0)),
    size=st.floats(120.0, 600.0),
)  # fmt: skip
def test_it_lies_on_the_bed_as_long_as_it_should_be_or_is_refused(nozzle, duration, speed, lag, corner, size):
    x, y = corner
    machine = dataclasses.replace(MACHINE, bed=(x, y, x + size, y + size))
    try:
        found = lay_out(machine, nozzle=nozzle, duration=duration, speed=speed, lag=lag)
    except UsageError:
        assume(False)
    everything = np.concatenate([found.datum, found.set_off[None], found.path, found.run_out])
    low, high = everything.min(axis=0), everything.max(axis=0)
    assert (low >= [x, y]).all()
    assert (high <= [x + size, y + size]).all()
    assert speed / WIDEST <= found.speed <= speed
    assert found.length == pytest.approx(found.speed * duration, rel=1e-3)
    assert found.path[:, 0].min() > found.datum[:, 0].max() + 2.0 * nozzle
    assert far_apart(found.path) > 3.0 * nozzle
    ahead = np.diff(np.concatenate([found.set_off[None], found.path, found.run_out]), axis=0)
    heading = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    assert np.abs(np.diff(heading)).max() < 0.2  # nowhere a corner that would slow the head down


def test_half_circles_can_be_taken_at_full_speed():
    machine = load_machine("pellet")
    found = lay_out(machine, nozzle=5.0, duration=34.0, speed=80.0, lag=3.0)
    rows = np.unique(found.path[np.abs(np.diff(found.path[:, 1], append=0.0)) < 1e-9, 1])
    assert found.speed == 80.0
    assert 80.0**2 / (np.diff(rows).min() / 2.0) <= machine.accel / 2.0 + 1e-6


def test_a_bed_too_small_says_what_to_do():
    machine = dataclasses.replace(MACHINE, bed=(0.0, 0.0, 60.0, 30.0))
    with pytest.raises(UsageError, match=r"the bed of syringe \(60 x 30 mm\) has no room for it: ask for less flow"):
        lay_out(machine, nozzle=0.84, duration=60.0, speed=12.0, lag=3.0)


def test_a_bed_too_small_for_any_flow_does_not_ask_for_less():
    with pytest.raises(UsageError, match=r"no room for lanes of a 5 mm nozzle: use a finer nozzle, or set the profile"):
        lay_out(MACHINE, nozzle=5.0, duration=34.0, speed=0.3, lag=3.0)


def test_it_is_written_slower_where_the_bed_is_small_for_its_speed():
    machine = load_machine("filament")
    found = lay_out(machine, nozzle=0.4, duration=34.0, speed=130.0, lag=3.0)
    assert 130.0 / WIDEST < found.speed < 100.0
