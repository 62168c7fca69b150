"""Burg's method against known processes and Yule-Walker; the noise against the data it was fitted to."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from gcodectl.errors import UsageError
from plant_models.noise import ROAD_WIDTHS, MeasurementNoise, fit_burg, fit_noise

KNOWN = np.array([-1.2, 0.6, -0.1])


def process(n: int, seed: int = 0) -> np.ndarray:
    white = np.random.default_rng(seed).normal(0.0, 0.5, n + 500)
    return np.asarray(lfilter([1.0], [1.0, *KNOWN], white))[500:]


def data_file() -> Path | None:
    """The measured widths: in GCODECTL_DATA, else in `data` beside GCODECTL_CORPUS."""
    data, corpus = os.environ.get("GCODECTL_DATA"), os.environ.get("GCODECTL_CORPUS")
    folder = Path(data) if data else Path(corpus).parent / "data" if corpus else None
    path = folder / "diw_road_widths.csv" if folder else None
    return path if path and path.is_file() else None


def test_burg_finds_a_known_process() -> None:
    a, variance = fit_burg(process(50_000), 3)
    np.testing.assert_allclose(a, KNOWN, atol=0.02)
    assert variance == pytest.approx(0.25, rel=0.02)


def test_burg_agrees_with_yule_walker_on_a_long_record() -> None:
    x = process(20_000, seed=1)
    lags = np.array([np.dot(x[: len(x) - k], x[k:]) / len(x) for k in range(4)])
    np.testing.assert_allclose(fit_burg(x, 3)[0], -solve_toeplitz(lags[:3], lags[1:]), atol=5e-3)


def test_burg_reads_a_sine_that_yule_walker_smears() -> None:
    x = np.sin(0.4 * np.arange(40))
    a, variance = fit_burg(x, 2)
    np.testing.assert_allclose(a, [-2 * np.cos(0.4), 1.0], atol=0.02)
    assert variance < 0.01


def test_several_records_are_fitted_as_one_process() -> None:
    a, variance = fit_burg(process(60_000, seed=2).reshape(-1, 60), 3)
    np.testing.assert_allclose(a, KNOWN, atol=0.03)
    assert variance == pytest.approx(0.25, rel=0.05)


@settings(deadline=None)
@given(st.lists(st.floats(-10.0, 10.0), min_size=5, max_size=40), st.integers(1, 4))
def test_burg_is_never_unstable(x: list[float], order: int) -> None:
    a, variance = fit_burg(np.array(x), order)
    assert variance >= 0
    assert np.abs(np.roots([1.0, *a])).max(initial=0.0) < 1 + 1e-6


def test_burg_needs_more_samples_than_coefficients() -> None:
    with pytest.raises(UsageError, match="needs more than 3 samples; there are 3"):
        fit_burg(np.zeros(3), 3)


def test_samples_have_the_spread_and_the_memory_they_should() -> None:
    rng = np.random.default_rng(7)
    prints = np.stack([ROAD_WIDTHS.sample(400, rng) for _ in range(400)])
    offsets = prints.mean(axis=1)
    assert offsets.std() == pytest.approx(ROAD_WIDTHS.offset, rel=0.15)
    road = prints - offsets[:, None]
    assert road.std() == pytest.approx(ROAD_WIDTHS.deviation, rel=0.03)
    np.testing.assert_allclose(fit_burg(road, 3)[0], ROAD_WIDTHS.coefficients, atol=0.02)
    assert road[:, :3].std() == pytest.approx(road[:, -3:].std(), rel=0.15)  # settled from the first bin on


def test_the_seed_decides_and_a_scale_scales() -> None:
    first, again = (ROAD_WIDTHS.sample(50, np.random.default_rng(8)) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    np.testing.assert_allclose(ROAD_WIDTHS.scaled(0.1).sample(50, np.random.default_rng(8)), 0.1 * first)
    assert ROAD_WIDTHS.scaled(0.5).deviation == pytest.approx(0.5 * ROAD_WIDTHS.deviation)


def test_along_a_road_a_bin_reads_the_same_throughout() -> None:
    noise = MeasurementNoise((-0.5,), variance=0.01, offset=0.1, spacing=2.0)
    s = np.arange(0.0, 20.0, 0.25) + 3.0
    read = noise.along(s, np.random.default_rng(9))
    assert read.shape == s.shape
    assert (np.ptp(read.reshape(10, 8), axis=1) == 0).all()
    assert len(np.unique(read)) == 10
    np.testing.assert_array_equal(read[::8], noise.sample(10, np.random.default_rng(9)))
    assert len(noise.along(np.zeros(0), np.random.default_rng(9))) == 0


@pytest.mark.skipif(data_file() is None, reason="no measured widths here: neither GCODECTL_DATA nor GCODECTL_CORPUS")
def test_the_numbers_are_those_of_the_measured_roads() -> None:
    path = data_file()
    assert path is not None
    fitted = fit_noise(np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:])
    np.testing.assert_allclose(fitted.coefficients, ROAD_WIDTHS.coefficients, atol=1e-5)
    assert fitted.variance == pytest.approx(ROAD_WIDTHS.variance, rel=1e-4)
    assert fitted.offset == pytest.approx(ROAD_WIDTHS.offset, rel=1e-4)
    assert fitted.deviation == pytest.approx(0.14, abs=0.005)
