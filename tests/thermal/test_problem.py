import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from layers import BAND, HEAD, posed, wall

from gcodectl.errors import UsageError
from gcodectl.thermal.partitions import partition, partitions_at
from gcodectl.thermal.problem import after_kernel, cost_at, drive, windows
from gcodectl.thermal.surface import Band, Surface


@given(st.floats(1.0, 50.0), st.floats(1.0, 50.0), st.floats(0.5, 40.0), st.floats(0.0, 1.0))
def test_the_way_back_from_a_time_is_the_way_given(v0: float, v1: float, accel: float, share: float) -> None:
    # the slips of the paper: d = v t + a t^2 / 2 while the speed changes, not a t^2
    ramp = abs(v1**2 - v0**2) / (2 * accel)
    length = 1.5 * ramp + 1.0
    way = share * length
    t = float(after_kernel(way, v0, v1, accel))
    lasts = abs(v1 - v0) / accel
    sign = 1.0 if v1 >= v0 else -1.0
    ramped = min(t, lasts)
    back = v0 * ramped + sign * accel * ramped**2 / 2 + v1 * max(t - lasts, 0.0)
    assert back == pytest.approx(way, rel=1e-9, abs=1e-9)


def test_by_hand() -> None:
    # from 10 to 20 with 5: 30 of way in 2 s, then 20 more in 1 s; and an acceleration of inf is a jump
    assert after_kernel(30.0, 10.0, 20.0, 5.0) == pytest.approx(2.0)
    assert after_kernel(50.0, 10.0, 20.0, 5.0) == pytest.approx(3.0)
    assert after_kernel(30.0, 20.0, 10.0, 5.0) == pytest.approx(2.0)
    assert after_kernel(12.5, 10.0, 20.0, 5.0) == pytest.approx((-10 + math.sqrt(100 + 2 * 5 * 12.5)) / 5)
    assert after_kernel(50.0, 10.0, 20.0, math.inf) == pytest.approx(2.5)
    assert after_kernel(0.0, 10.0, 20.0, math.inf) == 0.0


def test_the_head_is_where_small_steps_of_time_take_it() -> None:
    surface = wall(2.5)
    problem = posed(surface, partitions_at(surface, np.array([0, 30, 61]), HEAD), entry=18.0)
    speeds = np.array([30.0, 16.0, 36.0])
    border, times = drive(problem, 100.0, speeds)
    dt, t, at, speed = 1e-3, 100.0, 0.0, 18.0
    begins, crossed, passed = problem.length.cumsum() - problem.length, [100.0], [100.0]
    for _ in range(40_000):
        j = int(np.searchsorted(begins, at, side="right")) - 1
        speed += float(np.clip(speeds[j] - speed, -problem.accel * dt, problem.accel * dt))
        before, at, t = at, at + speed * dt, t + dt
        passed += [t] * int(((surface.s > before) & (surface.s <= at)).sum())
        crossed += [t] * int(((begins > before) & (begins <= at)).sum())
    np.testing.assert_allclose(times, passed[: len(times)], atol=5e-3)
    np.testing.assert_allclose(border[:3], crossed, atol=5e-3)


def test_a_location_is_inside_the_band_between_opens_and_shuts() -> None:
    surface = wall()
    opens, shuts = windows(surface, BAND, 2.0)
    np.testing.assert_allclose(surface.at(opens, BAND.ambient), BAND.high - 2.0)
    np.testing.assert_allclose(surface.at(shuts, BAND.ambient), BAND.low + 2.0)


def test_windows_of_locations_that_never_cool_never_were_hot_or_warm_up() -> None:
    def one(rest: float, temp0: float) -> tuple[float, float]:
        surface = Surface(
            s=np.zeros(1), b0=np.array([0.01 * (rest - 24.0)]), b1=np.array([-0.01]), t0=np.array([7.0]),
            temp0=np.array([temp0]),
        )  # fmt: skip
        opens, shuts = windows(surface, BAND)
        return float(opens[0]), float(shuts[0])

    assert one(130.0, 140.0) == (7.0, math.inf)
    assert one(160.0, 240.0)[0] == math.inf
    assert one(100.0, 110.0)[1] == -math.inf
    assert one(130.0, 90.0)[0] == pytest.approx(7.0 - 100 * math.log(10.0 / 40.0))
    assert one(160.0, 130.0)[1] == pytest.approx(7.0 - 100 * math.log(10.0 / 30.0))


def test_what_does_not_fit_is_refused() -> None:
    surface = wall()
    parts = partition(surface, HEAD, BAND)
    with pytest.raises(UsageError, match="none that the head can do"):
        posed(surface, parts.replace(slowest=parts.fastest + 1.0))
    with pytest.raises(UsageError, match="reach from its first location"):
        posed(surface, parts.replace(length=0.5 * parts.length))
    with pytest.raises(UsageError, match="every partition needs a location"):
        posed(surface, parts.replace(first=np.full(len(parts), 3)))
    with pytest.raises(UsageError, match="the path ends"):
        partitions_at(surface, np.array([0]), HEAD, end=1.0)
    with pytest.raises(UsageError, match="must begin at rising"):
        partitions_at(surface, np.array([0, 9, 4]), HEAD)


def test_costs_by_hand() -> None:
    surface = Surface(
        s=np.array([0.0, 10.0]), b0=np.array([0.0, 0.0]), b1=np.array([-0.01, -0.01]), t0=np.zeros(2),
        temp0=np.array([224.0, 224.0]),
    )  # fmt: skip
    problem = posed(surface, partitions_at(surface, np.array([0]), HEAD), band=Band())
    border, times = drive(problem, 50.0, np.array([20.0]))
    temperature = 24.0 + 200.0 * np.exp(-0.01 * np.array([50.0, 50.5]))
    assert cost_at(problem, border, times) == pytest.approx(np.sum((temperature - 135.0) ** 2) + 50.0)
    mean = dataclasses.replace(problem, of_mean=True, start_weight=0.0, end_weight=2.0)
    assert cost_at(mean, border, times) == pytest.approx((temperature.mean() - 135.0) ** 2 + 2 * 50.5)
