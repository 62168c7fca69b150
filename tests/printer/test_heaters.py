"""Heaters: first order, in any steps."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plant_models.printer.heaters import BED, HOTEND, Heater


def test_a_heater_begins_cold_and_stays_so():
    heater = Heater()
    assert (heater.temperature(0.0), heater.temperature(1e6), heater.target) == (21.0, 21.0, 0.0)


def test_it_heats_as_a_first_order_system_does_and_holds():
    heater = Heater(HOTEND)
    heater.set(200.0, 10.0)
    wanted = HOTEND.hottest + (21.0 - HOTEND.hottest) * math.exp(-20.0 / HOTEND.tau)
    assert heater.temperature(30.0) == pytest.approx(wanted)
    assert heater.temperature(heater.there) == 200.0 == heater.temperature(1e4)
    assert heater.settled() == heater.there + HOTEND.residency


def test_it_cools_towards_the_room_and_gets_there():
    heater = Heater(BED)
    heater.set(80.0, 0.0)
    hot = heater.there
    heater.set(0.0, hot)
    assert 21.0 < heater.temperature(hot + BED.tau) == pytest.approx(21.0 + 59.0 / math.e)
    assert heater.temperature(heater.there) == 21.0
    assert not heater.heating


def test_a_target_above_the_limit_is_the_limit():
    heater = Heater(BED)
    heater.set(400.0, 0.0)
    assert heater.target == BED.limit


@given(st.lists(st.tuples(st.floats(0, 300), st.floats(0, 500)), max_size=6))
def test_temperatures_are_continuous_and_bounded(steps: list[tuple[float, float]]):
    heater, now = Heater(), 0.0
    for target, more in steps:
        before = heater.temperature(now)
        heater.set(target, now)
        assert heater.temperature(now) == pytest.approx(before, abs=0.51)
        now += more
        assert 21.0 <= heater.temperature(now) <= HOTEND.limit
