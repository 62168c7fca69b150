import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcodectl.motion import ramp

KERNELS = ("ramp_time_kernel", "ramp_distance_kernel", "reachable_kernel", "slope_kernel", "peak_kernel")
speeds = st.floats(0.0, 300.0)
accels = st.sampled_from([20.0, 500.0, 8_000.0])
jerks = st.sampled_from([500.0, 20_000.0, 1e6, math.inf])


def integrated(v0: float, v1: float, a: float, j: float) -> tuple[float, float]:
    """Seconds and path of a ramp, by stepping through its acceleration: up at j, held at a, down at j."""
    dv = abs(v1 - v0)
    peak = min(a, math.sqrt(dv * j))
    rise, flat = peak / j, dv / peak - peak / j
    times = np.linspace(0.0, 2 * rise + flat, 200_001)
    acceleration = np.interp(times, [0.0, rise, rise + flat, 2 * rise + flat], [0.0, peak, peak, 0.0])
    step = times[1]
    speed = v0 + math.copysign(1, v1 - v0) * np.concatenate(
        [[0.0], np.cumsum(0.5 * (acceleration[1:] + acceleration[:-1])) * step]
    )
    assert speed[-1] == pytest.approx(v1, abs=1e-6)
    return float(times[-1]), float(np.sum(0.5 * (speed[1:] + speed[:-1])) * step)


@pytest.mark.parametrize(("v0", "v1"), [(0, 10), (3, 40), (40, 3), (9.9, 10), (0, 200)])
@pytest.mark.parametrize(("a", "j"), [(500, 20_000), (500, 1e6), (20, 300)])
def test_closed_forms_against_integration(v0: float, v1: float, a: float, j: float) -> None:
    seconds, path = integrated(v0, v1, a, j)
    assert ramp.ramp_time_kernel(v0, v1, a, j) == pytest.approx(seconds, rel=1e-9)
    assert ramp.ramp_distance_kernel(v0, v1, a, j) == pytest.approx(path, rel=1e-6)


def test_without_a_limit_of_jerk_a_ramp_is_a_straight_line() -> None:
    assert ramp.ramp_time_kernel(2.0, 12.0, 50.0, math.inf) == pytest.approx(0.2)
    assert ramp.ramp_distance_kernel(2.0, 12.0, 50.0, math.inf) == pytest.approx((144 - 4) / 100)
    assert ramp.ramp_distance_kernel(7.0, 7.0, 50.0, math.inf) == 0.0
    assert ramp.reachable_kernel(3.0, 2.0, 50.0, math.inf) == pytest.approx(math.sqrt(9 + 200))
    assert ramp.peak_kernel(0.0, 0.0, 99.0, 2.0, 50.0, math.inf) == pytest.approx(10.0)


@given(speeds, st.floats(1e-6, 400.0), accels, jerks)
def test_what_is_reachable_takes_the_whole_distance(v0: float, d: float, a: float, j: float) -> None:
    v1 = ramp.reachable_kernel(v0, d, a, j)
    assert v1 >= v0
    took = ramp.ramp_distance_kernel(v0, v1, a, j)
    assert took <= d * (1 + 1e-9) + 1e-9
    assert ramp.ramp_distance_kernel(v0, v1 + 1e-6 + 1e-9 * v1, a, j) > d * (1 - 1e-9) - 1e-9


@pytest.mark.parametrize("v0", [1e-300, 1e-9, 5e-5, 1e-3])
def test_reachable_from_nearly_rest_does_not_overrun(v0: float) -> None:
    speed = ramp.reachable_kernel(v0, 0.003, 500.0, 20_000.0)
    assert ramp.ramp_distance_kernel(v0, speed, 500.0, 20_000.0) == pytest.approx(0.003, rel=1e-11)


@given(speeds, speeds, st.floats(0.0, 1.0), accels, jerks)
def test_reachable_undoes_the_distance_of_a_ramp(low: float, dv: float, more: float, a: float, j: float) -> None:
    d = ramp.ramp_distance_kernel(low, low + dv, a, j)
    assert ramp.reachable_kernel(low, d, a, j) == pytest.approx(low + dv, rel=1e-6, abs=1e-5)
    assert ramp.reachable_kernel(low, d + more, a, j) >= ramp.reachable_kernel(low, d, a, j)


@given(speeds, speeds, st.floats(0.0, 300.0), st.floats(0.0, 300.0), accels, jerks)
def test_a_peak_fits_and_keeps_the_cruising_speed(
    v0: float, v1: float, faster: float, spare: float, a: float, j: float
) -> None:
    cruise = max(v0, v1) + faster
    d = ramp.ramp_distance_kernel(v0, v1, a, j) + spare
    peak = ramp.peak_kernel(v0, v1, cruise, d, a, j)
    assert max(v0, v1) <= peak <= cruise
    need = ramp.ramp_distance_kernel(v0, peak, a, j) + ramp.ramp_distance_kernel(peak, v1, a, j)
    assert need <= d * (1 + 1e-9) + 1e-9
    if peak < cruise:
        assert need == pytest.approx(d, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("j", [20_000.0, math.inf])
def test_the_same_with_the_jit_off(j: float) -> None:
    for name, numbers in zip(
        KERNELS, [(0, 10, 500, j), (8, 3, 500, j), (2, 0.5, 500, j), (3, 8, 500, j), (2, 1, 50, 3, 500, j)], strict=True
    ):
        kernel = getattr(ramp, name)
        with np.errstate(divide="ignore", invalid="ignore"):
            plain = kernel.py_func(*map(np.float64, numbers))
        assert kernel(*map(float, numbers)) == pytest.approx(float(plain), rel=1e-12)
