import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from layers import BAND, wall

from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.thermal.chance import chance_windows, margin
from gcodectl.thermal.cooling import Cooling
from gcodectl.thermal.layer_time import layer_time, print_time
from gcodectl.thermal.surface import Band, Surface


def known(surface: Surface, sigma: float = 1.0, spread: float = 0.0) -> Cooling:
    count = len(surface)
    covariance = np.zeros((count, 9))
    covariance[:, 8] = spread**2
    return Cooling(
        b0=surface.b0, b1=surface.b1, t0=surface.t0, temp0=surface.temp0, covariance=covariance,
        sigma2=np.full(count, sigma**2), freedom=np.full(count, 100),
    )  # fmt: skip


def cost(surface: Surface, way: Floats, t: float, weight: float) -> float:
    return float(np.sum((surface.at(t + way, BAND.ambient) - BAND.best) ** 2)) + weight * t


def test_the_published_curve_at_its_published_time() -> None:
    # table 3.2, 260 degC: after 260 s it is at 134.5 degC; the best time is a little before that of 135 degC
    one = Surface(s=np.zeros(1), b0=np.array([1.007]), b1=np.array([-0.01003]), t0=np.zeros(1), temp0=np.array([260.0]))
    best = layer_time(known(one, 0.87), BAND, weight=0.0)
    assert best.time == pytest.approx(255.0, abs=2.0)
    assert best.temperatures[0] == pytest.approx(135.0, abs=1e-3)
    assert layer_time(known(one, 0.87), BAND, weight=1.0).time < best.time
    assert best.widened == 0.0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.0, 300.0))
def test_no_other_time_is_better(seed: int, weight: float) -> None:
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, 6))
    b1, rest = -rng.uniform(0.004, 0.03, m), rng.uniform(40.0, 125.0, m)
    surface = Surface(
        s=np.sort(rng.uniform(0.0, 300.0, m)), b0=-b1 * (rest - 24.0), b1=b1, t0=rng.uniform(0.0, 30.0, m),
        temp0=rng.uniform(200.0, 250.0, m),
    )  # fmt: skip
    best = print_time(surface, 10.0, BAND, weight)
    way = (surface.s - surface.s[0]) / 10.0
    others = np.linspace(best.low, best.high if math.isfinite(best.high) else best.low + 2000.0, 501)
    assert best.low - 1e-9 <= best.time <= best.high + 1e-9
    assert best.cost <= min(cost(surface, way, t, weight) for t in others) * (1 + 1e-6) + 1e-6
    assert best.minima >= 1
    if best.convex:
        assert best.minima == 1


def test_two_minima_are_both_seen_and_the_better_one_taken() -> None:
    # one location that cools at once and one that cools late: the cost has a valley at each
    b1 = np.array([-0.2, -0.01])
    surface = Surface(s=np.zeros(2), b0=-36.0 * b1, b1=b1, t0=np.zeros(2), temp0=np.array([249.0, 249.0]))
    found = print_time(surface, 1.0, Band(low=25.0, high=249.5), 0.0)
    table = [cost(surface, np.zeros(2), t, 0.0) for t in np.arange(0.0, 300.0, 0.2)]
    valleys = [k for k in range(1, len(table) - 1) if table[k] < table[k - 1] and table[k] <= table[k + 1]]
    assert found.minima == len(valleys) == 2
    assert found.cost == pytest.approx(min(table), rel=1e-3)
    assert found.time == pytest.approx(0.2 * int(np.argmin(table)), abs=0.5)
    assert not found.convex


def test_bounds_are_where_the_hottest_and_the_coldest_location_meet_the_band() -> None:
    surface = wall()
    best = print_time(surface, 25.2, BAND)
    way = surface.s / 25.2
    assert surface.at(best.low + way, BAND.ambient).max() == pytest.approx(BAND.high)
    assert surface.at(best.high + way, BAND.ambient).min() == pytest.approx(BAND.low)
    assert best.convex
    assert best.high < best.gamma


def test_an_interval_that_is_empty_is_widened_by_as_little_as_can_be() -> None:
    surface = wall()
    tight = Band(low=134.9, high=135.1)
    best = print_time(surface, 25.2, tight)
    assert 0.0 < best.widened < 15.0
    outside = np.maximum(best.temperatures - tight.high, tight.low - best.temperatures).max()
    assert outside == pytest.approx(best.widened, abs=1e-3)
    assert print_time(surface, 25.2, Band(low=134.9 - best.widened - 0.01, high=135.11 + best.widened)).widened == 0.0


def test_chance_windows_are_where_the_bounds_meet_the_band() -> None:
    cooling = known(wall(), 1.5, 2.0)
    opens, shuts = chance_windows(cooling, BAND, 0.05)
    np.testing.assert_allclose(cooling.bounds(opens, BAND.ambient, 0.05)[1], BAND.high, atol=1e-6)
    np.testing.assert_allclose(cooling.bounds(shuts, BAND.ambient, 0.05)[0], BAND.low, atol=1e-6)
    narrow = margin(cooling, BAND, 0.05)
    inside = cooling.surface(np.zeros(len(cooling))).at(opens, BAND.ambient)
    assert (inside >= BAND.high - narrow - 1e-9).all()
    assert np.abs(inside - (BAND.high - narrow)).max() < 0.5


def test_a_location_that_never_is_inside_has_no_window() -> None:
    surface = wall()[:3]
    cooling = known(surface.replace(b0=-surface.b1 * np.array([80.0, 140.0, 100.0])))
    opens, shuts = chance_windows(cooling, BAND, 0.05)
    assert np.isfinite(opens[[0, 2]]).all()
    assert math.isinf(opens[1])
    assert math.isinf(shuts[2])
    assert opens[1] > shuts[1]


def test_less_certain_is_later_and_alpha_is_checked() -> None:
    surface = wall()
    sure, unsure = known(surface, 0.1), known(surface, 3.0)
    hurried = [layer_time(one, BAND, 0.05, weight=1e4).time for one in (sure, unsure)]
    assert hurried[0] < hurried[1]
    assert layer_time(sure, BAND, earliest=220.0).time == pytest.approx(220.0)
    with pytest.raises(UsageError, match="alpha is a probability"):
        layer_time(sure, BAND, 1.5)
    with pytest.raises(UsageError, match="print speed must be above 0"):
        print_time(surface, 0.0, BAND)
    assert dataclasses.asdict(layer_time(sure, BAND))["minima"] == 1
