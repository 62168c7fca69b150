"""Asking: the dead time taken off, jumps made ramps, the goals for it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flow_models import LINEAR, PLUNGER
from hypothesis import given
from hypothesis import strategies as st
from inverting import asked_of, goals_of, rates_of, spaces

from gcodectl.flow.asking import ask_kernel
from gcodectl.flow.flow_model import FlowModel
from gcodectl.flow.inversion import Inversion

DT = 0.01
CAP, SLEW = 25.0, 2000.0


def stiff(model: FlowModel) -> Inversion:
    return Inversion(model, CAP, SLEW, DT)


def test_asking_takes_off_the_dead_time_by_parts_of_a_sample_too() -> None:
    inversion = stiff(dataclasses.replace(LINEAR, delay=0.025))
    wanted = np.arange(40.0)
    asked, reach = asked_of(inversion, wanted), inversion.reach
    inside = slice(reach, 40 - reach - 4)
    assert asked[inside] == pytest.approx(wanted[inside] + 2.5)


def test_jumps_are_made_ramps_that_keep_their_volume_and_no_longer_than_the_plunger_takes() -> None:
    for slew in (100.0, 300.0, 2000.0):
        inversion = Inversion(dataclasses.replace(LINEAR, delay=0.0), CAP, slew, DT)
        wanted = np.concatenate([np.zeros(200), np.full(300, 5.0), np.zeros(200)])
        asked, reach = asked_of(inversion, wanted), inversion.reach
        assert reach * DT <= CAP / slew + DT
        assert asked.sum() == pytest.approx(wanted.sum())
        assert (asked >= -1e-12).all()
        there = np.flatnonzero((asked > 1e-9) & (asked < 5.0 - 1e-9))
        assert len(there) == 4 * reach
    assert Inversion(LINEAR, CAP, 1e9, DT).reach == 0


@given(st.integers(5, 59), st.integers(0, 99))
def test_asked_in_spans_it_is_the_triangle_by_hand(cut: int, seed: int) -> None:
    inversion = Inversion(PLUNGER, CAP, 300.0, DT)
    wanted = np.maximum(np.random.default_rng(seed).uniform(-3.0, 6.0, 60), 0.0)
    asked, goals, rates = np.empty((3, 60))
    work, _ = spaces(60)
    for at, end in ((5, cut), (cut, 60)):
        ask_kernel.py_func(wanted, 5, 50, at, end, inversion.row, asked, goals, rates, work)
    reach, whole = inversion.reach, int(inversion.delay)
    triangle = np.concatenate([np.arange(1, reach + 2), np.arange(reach, 0, -1)]) / (reach + 1.0) ** 2
    mine = np.where((np.arange(60) >= 5) & (np.arange(60) < 50), wanted, 0.0)
    smooth = np.convolve(np.concatenate([mine, np.zeros(40)]), triangle)[reach : reach + 90]
    part = inversion.delay - whole
    by_hand = (1 - part) * smooth[whole : whole + 60] + part * smooth[whole + 1 : whole + 61]
    assert asked[5:] == pytest.approx(by_hand[5:])
    assert goals[5:] == pytest.approx(goals_of(inversion, asked[5:]), abs=1e-4)
    assert rates[5:] == pytest.approx(rates_of(inversion, asked[5:]), abs=2e-2)
