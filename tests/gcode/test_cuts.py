"""Cuts: no line misplaces more than it may, none is shorter than it may be, and none comes late where it matters."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import plain_python

from gcodectl.columns import Floats
from gcodectl.gcode import cuts as stage
from gcodectl.gcode.bounds import DT as DT_COLUMN
from gcodectl.gcode.bounds import LEAST_TIME
from gcodectl.gcode.cuts import (
    ADDED,
    LATE,
    LONGEST_CORNER,
    LONGEST_SHORTEST,
    N_CUT,
    PATH,
    UNTIL,
    added_kernel,
    corners_kernel,
    path_kernel,
    shortest_kernel,
    speeds_kernel,
)
from gcodectl.gcode.packed import (
    ACCEL,
    AREA,
    BEGIN,
    CORNER_SPEED,
    DISTANCE,
    E_DIGITS,
    END,
    FINISH,
    FLAGS,
    N_PHASE,
    N_STATE,
    NOMINAL,
    PHASES,
    START,
)

DT = 0.01


def ramps(begin: float, *pieces: tuple[float, float], v: float = 5.0) -> Floats:
    """Phases from `begin` on: seconds and acceleration of each, from a speed of `v`."""
    phases, t, s = np.zeros((len(pieces), N_PHASE)), begin, 0.0
    for k, (lasts, a) in enumerate(pieces):
        phases[k] = t, lasts, s, v, a, 0.0
        t, s, v = t + lasts, s + v * lasts + a * lasts**2 / 2, v + a * lasts
    return phases


def cut(
    rates: Floats, phases: Floats, most: float = 0.005, shortest: float = DT, slow: bool = False, moves: bool = True,
    soonest: float = -math.inf, latest: float = math.inf,
) -> Floats:  # fmt: skip
    """The lines' ends, the move's begin first; rates from time 0 on."""
    begin, end = phases[0, 0], phases[-1, 0] + phases[-1, 1]
    out = np.empty((len(rates) + 2, N_CUT))
    n = stage.cuts_kernel(
        rates, 0, DT, begin, end, phases, len(phases), moves, slow, soonest, latest, most, shortest, out
    )
    paths = places(phases, out[:n, UNTIL]) if moves else out[:n, UNTIL] - begin
    assert out[:n, PATH] == pytest.approx(paths, abs=1e-12)
    assert out[:n, ADDED] == pytest.approx(volumes(rates, begin, out[:n, UNTIL]), abs=1e-9)
    return np.concatenate([[begin], out[:n, UNTIL]])


def places(phases: Floats, times: Floats) -> Floats:
    return np.array([path_kernel(phases, 0, len(phases), t) for t in times])


def volumes(rates: Floats, begin: float, times: Floats) -> Floats:
    return np.array([added_kernel(rates, 0, DT, begin, t) for t in times])


def misplaced(rates: Floats, phases: Floats, ends: Floats) -> Floats:
    """The most that each line's chord is off the volume added, at the edges of the signal's cells inside it, mm^3."""
    worst = []
    for since, until in itertools.pairwise(ends):
        edges = np.arange(math.ceil(since / DT + 1e-6), math.ceil(until / DT - 1e-6)) * DT
        times = np.concatenate([[since], edges, [until]])
        s, volume = places(phases, times), volumes(rates, ends[0], times)
        worst.append(float(np.abs(np.interp(s, s[[0, -1]], volume[[0, -1]]) - volume).max()))
    return np.array(worst)


@st.composite
def signals(draw: st.DrawFn) -> tuple[Floats, Floats]:
    """A rough signal of up to 3 s, and a motion that never stands still under some of it."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    n = draw(st.integers(10, 300))
    rates = np.repeat(rng.normal(scale=draw(st.sampled_from([0.5, 5.0, 25.0])), size=n), draw(st.sampled_from([1, 7])))
    rates = np.convolve(rates[:n], np.ones(draw(st.sampled_from([1, 9]))), mode="same")
    begin = draw(st.sampled_from([0.0, 0.003, 0.05]))
    left = max(0.02, (n - 8) * DT - begin)
    a = draw(st.sampled_from([0.0, 3.0, -1.0]))
    phases = ramps(begin, (0.4 * left, a), (0.3 * left, 0.0), (0.3 * left, -a))
    return rates, phases


@given(signals(), st.sampled_from([0.0005, 0.005, 0.05]))
def test_no_line_misplaces_more_than_it_may(case: tuple[Floats, Floats], most: float) -> None:
    rates, phases = case
    ends = cut(rates, phases, most, shortest=1e-6)
    assert (misplaced(rates, phases, ends) <= most * (1 + 1e-6) + 1e-9).all()


@given(signals(), st.sampled_from([0.01, 0.02, 0.05]), st.booleans())
def test_every_line_lasts_and_they_go_on_to_the_end(case: tuple[Floats, Floats], shortest: float, slow: bool) -> None:
    rates, phases = case
    ends = cut(rates, phases, 0.001, shortest, slow)
    end = phases[-1, 0] + phases[-1, 1]
    assert ends[-1] == end
    if end - ends[0] > shortest:
        assert (np.diff(ends) >= 0.998 * shortest).all()
    assert len(ends) - 1 <= max(1.0, (end - ends[0]) / shortest * 1.01)


@given(signals(), st.floats(0.0, 0.4), st.floats(0.0, 0.4))
def test_no_cut_is_nearer_to_a_corner_than_it_may_be(case: tuple[Floats, Floats], after: float, before: float) -> None:
    rates, phases = case
    end = phases[-1, 0] + phases[-1, 1]
    inner = cut(rates, phases, 0.001, soonest=phases[0, 0] + after, latest=end - before)[1:-1]
    assert (inner >= phases[0, 0] + after).all()
    assert (inner <= end - before).all()


@given(signals(), st.sampled_from([0.0005, 0.05]), st.booleans())
def test_any_signal_conserves_volume(case: tuple[Floats, Floats], most: float, moves: bool) -> None:
    rates, phases = case
    ends = cut(rates, phases, most, moves=moves)
    parts = [added_kernel(rates, 0, DT, a, b) for a, b in itertools.pairwise(ends)]
    exact = np.interp(ends[[0, -1]], np.arange(len(rates) + 1) * DT, np.concatenate([[0.0], np.cumsum(rates)]) * DT)
    assert sum(parts) == pytest.approx(exact[1] - exact[0], abs=1e-9)


@pytest.mark.parametrize("a", [2.0, 10.0, -8.0])
def test_a_slow_ramp_is_a_stair_that_is_never_late(a: float) -> None:
    phases = ramps(0.0, (1.0, a), v=1.0 if a > 0 else 10.0)
    ends = cut(np.zeros(120), phases, slow=True)
    assert len(cut(np.zeros(120), phases, slow=False)) == 2
    assert 3 < len(ends) < 40
    for since, until in itertools.pairwise(ends):
        times = np.linspace(since, until, 50)
        s = places(phases, times)
        assert np.abs(np.interp(s, s[[0, -1]], [since, until]) - times).max() <= LATE * 1.1


def test_a_steady_signal_is_one_line_and_a_step_is_cut_where_it_is() -> None:
    phases = ramps(0.0, (1.0, 0.0))
    assert cut(np.full(100, 3.0), phases).tolist() == [0.0, 1.0]
    step = np.concatenate([np.zeros(40), np.full(60, 5.0)])
    ends = cut(step, phases, 0.001)
    assert np.abs(ends[1:-1] - 0.4).min() < 1e-9


def test_standing_is_cut_by_time() -> None:
    standing = np.array([[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]])
    rates = np.concatenate([np.zeros(30), np.full(20, 10.0), np.zeros(50)])
    ends = cut(rates, standing, 0.001, moves=False)
    assert np.allclose(sorted(np.round(ends, 6)), [0.0, 0.3, 0.5, 1.0], atol=0.0101)


def corner(v: float, straight_on: bool = False, accel: float = 500.0, speed: float = 5.0) -> tuple[float, float]:
    state, phases = np.zeros(N_STATE), ramps(0.0, (1.0, 0.0), v=v)
    state[CORNER_SPEED], state[ACCEL], state[DISTANCE], state[DT_COLUMN] = speed, accel, v, DT
    state[FINISH], state[PHASES], state[END] = 1.0, 1, 0 if straight_on else 5
    state[FLAGS] = stage.PART | stage.GOES_ON if straight_on else 0
    assert state[BEGIN] == state[START] == 0
    found = corners_kernel(state, phases)
    assert found == corners_kernel.py_func(state, phases)
    return float(found[0]), float(found[1])


def test_lines_beside_a_corner_are_as_long_as_its_arc_takes() -> None:
    soonest, latest = corner(20.0)
    # klipper: v^2 <= a d tan(angle / 2) / 2 with v^2 = R (sqrt 2 - 1) c^2, the longest at the speed of the line itself
    reach = 2 * (math.sqrt(2) - 1) * 25 / 500
    reach *= math.sqrt(1 + 4 * 400 / (reach * 500))
    assert soonest == pytest.approx(reach / 20, abs=DT)
    assert 1.0 - latest == pytest.approx(reach / 20, abs=DT)
    assert soonest * 20 >= reach
    assert corner(20.0, straight_on=True) == (0.0, 1.0)
    assert corner(0.0) == (0.0, 1.0)
    assert corner(20.0, speed=0.0) == (0.0, 1.0)
    far = corner(20.0, accel=10.0, speed=20.0)
    assert far[0] <= LONGEST_CORNER + DT
    assert far[1] >= 1.0 - LONGEST_CORNER - DT


@pytest.mark.parametrize("kernel", [shortest_kernel, shortest_kernel.py_func])
def test_the_shortest_line_shows_a_hundred_digits(kernel: Callable[[Floats], float]) -> None:
    def shortest(nominal: float) -> float:
        state = np.zeros(N_STATE)
        state[LEAST_TIME], state[AREA], state[E_DIGITS], state[NOMINAL] = 0.01, 196.0, 5, nominal
        return kernel(state)

    assert shortest(5.0) == pytest.approx(196.0 * 1e-5 / 0.01 / 5.0)
    assert shortest(500.0) == 0.01
    assert shortest(0.001) == LONGEST_SHORTEST
    assert shortest(0.0) == 0.01


def test_places_and_speeds_along_phases() -> None:
    phases = ramps(1.0, (0.5, 4.0), (1.0, 0.0), v=2.0)
    assert places(phases, np.array([0.0, 1.0, 1.5, 2.0, 9.0])) == pytest.approx([0.0, 0.0, 1.5, 3.5, 5.5])
    for kernel in (speeds_kernel, speeds_kernel.py_func):
        assert kernel(phases, 0, 2, -math.inf, math.inf) == pytest.approx((2.0, 4.0, 4.0))
        assert kernel(phases, 0, 2, 1.0, 1.25) == pytest.approx((2.0, 3.0, 4.0))
        assert kernel(phases, 0, 2, 5.0, 6.0) == (0.0, 0.0, 0.0)


@settings(max_examples=15)
@given(signals(), st.booleans(), st.booleans())
def test_the_same_with_the_jit_off(case: tuple[Floats, Floats], slow: bool, moves: bool) -> None:
    rates, phases = case
    expected = cut(rates, phases, 0.003, 0.02, slow, moves)
    with plain_python("gcodectl.gcode.cuts"):
        assert np.array_equal(cut(rates, phases, 0.003, 0.02, slow, moves), expected)
