import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.thermal.cooling import fit, standardised
from gcodectl.thermal.surface import Surface

AMBIENT = 24.0
DATA = Path(os.environ.get("GCODECTL_DATA", Path(__file__).resolve().parents[2] / "../shared/data")) / "lfam_hexagon"


def cooling_surface(count: int, seed: int = 0) -> Surface:
    rng = np.random.default_rng(seed)
    b1 = -rng.uniform(0.008, 0.018, count)
    return Surface(
        s=np.arange(count, dtype=float), b0=-b1 * rng.uniform(50, 80, count), b1=b1, t0=np.full(count, 5.0),
        temp0=rng.uniform(230, 250, count),
    )  # fmt: skip


def seen(surface: Surface, t: Floats, noise: float, seed: int = 1) -> Floats:
    exact = surface.at(np.broadcast_to(t, (len(surface), len(t))), AMBIENT)
    return exact + noise * np.random.default_rng(seed).standard_normal(exact.shape)


def test_without_noise_the_parameters_come_back_exactly() -> None:
    surface, t = cooling_surface(20), 5.0 + np.arange(80.0)
    fitted = fit(t, seen(surface, t, 0.0), AMBIENT)
    for name in ("b0", "b1", "temp0", "t0"):
        np.testing.assert_allclose(getattr(fitted, name), getattr(surface, name), rtol=1e-9)
    later = np.full(20, 300.0)
    np.testing.assert_allclose(fitted.predict(later, AMBIENT)[0], surface.at(later, AMBIENT), atol=1e-8)
    assert len(fitted.surface(surface.s)) == 20


def test_gaps_and_uneven_times_are_no_hindrance() -> None:
    surface = cooling_surface(6)
    t = np.sort(np.random.default_rng(3).uniform(5.0, 120.0, 60))
    observed = seen(surface, t, 0.0)
    observed[:, 10:25] = np.nan
    observed[2, :4] = np.nan
    fitted = fit(t, observed, AMBIENT)
    np.testing.assert_allclose(fitted.b1, surface.b1, rtol=1e-9)
    assert fitted.t0[2] == t[4]
    np.testing.assert_allclose(fitted.temp0[2], surface[2:3].at(t[4:5], AMBIENT), rtol=1e-9)


def test_least_squares_no_neighbour_fits_better() -> None:
    surface, t = cooling_surface(5), 5.0 + np.arange(60.0)
    observed = seen(surface, t, 2.0)
    fitted = fit(t, observed, AMBIENT)

    def squares(b0: Floats, b1: Floats, temp0: Floats) -> Floats:
        made = Surface(s=surface.s, b0=b0, b1=b1, t0=fitted.t0, temp0=temp0)
        return np.asarray(((made.at(np.broadcast_to(t, observed.shape), AMBIENT) - observed) ** 2).sum(axis=1))

    best = squares(fitted.b0, fitted.b1, fitted.temp0)
    for change in (0.999, 1.001):
        assert (squares(fitted.b0 * change, fitted.b1, fitted.temp0) > best).all()
        assert (squares(fitted.b0, fitted.b1 * change, fitted.temp0) > best).all()
        assert (squares(fitted.b0, fitted.b1, fitted.temp0 * change) > best).all()


@pytest.mark.parametrize("alpha", [0.05, 0.2])
def test_as_many_fall_outside_a_bound_as_it_says(alpha: float) -> None:
    surface, t = cooling_surface(3000), 5.0 + 3.0 * np.arange(30.0)
    fitted = fit(t, seen(surface, t, 2.0), AMBIENT)
    later = np.full(len(surface), 170.0)  # beyond what was seen
    low, high = fitted.bounds(later, AMBIENT, alpha)
    came = seen(surface, np.array([170.0]), 2.0, seed=9)[:, 0]
    spread = 4 * np.sqrt(alpha * (1 - alpha) / len(surface))
    assert abs(np.mean(came < low) - alpha) < spread
    assert abs(np.mean(came > high) - alpha) < spread
    assert 2.0 < np.mean(fitted.predict(later, AMBIENT)[1]) < 6.0
    assert np.sqrt(fitted.sigma2.mean()) == pytest.approx(2.0, rel=0.02)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 6.0))
def test_any_noise_gives_curves_that_cool_and_errors_that_are_finite(seed: int, noise: float) -> None:
    surface, t = cooling_surface(8, seed), 5.0 + np.arange(90.0)
    fitted = fit(t, seen(surface, t, noise, seed), AMBIENT)
    mean, error = fitted.predict(np.broadcast_to(t, (8, 90)), AMBIENT)
    assert (fitted.b1 < 0).all()
    assert np.isfinite(mean).all()
    assert np.isfinite(error).all()
    np.testing.assert_allclose((seen(surface, t, noise, seed) - mean).mean(axis=1), 0.0, atol=0.6)


def test_residuals_are_told_in_standard_deviations() -> None:
    surface, t = cooling_surface(4), 5.0 + np.arange(100.0)
    observed = seen(surface, t, 1.0)
    observed[1, 40] -= 60.0
    scores = standardised(fit(t, observed, AMBIENT), t, observed, AMBIENT)
    assert np.unravel_index(np.abs(scores).argmax(), scores.shape) == (1, 40)
    assert np.abs(scores[[0, 2, 3]]).max() < 4.5


def test_what_cannot_be_fitted_is_named() -> None:
    surface, t = cooling_surface(4), 5.0 + np.arange(50.0)
    observed = seen(surface, t, 1.0)
    with pytest.raises(InputError, match=r"location 2: fewer than 5 temperatures"):
        fit(t, np.where(np.arange(4)[:, None] == 2, np.nan, observed), AMBIENT)
    cold = observed.copy()
    cold[[1, 3]] = 24.0 + 0.001 * np.random.default_rng(0).standard_normal((2, 50)) + 1e-3 * t
    with pytest.raises(InputError, match="no cooling to be seen"):
        fit(t, cold, AMBIENT)


@pytest.mark.skipif(not DATA.is_dir(), reason="no measured data beside the checkout")
def test_measured_curves_are_fitted_closer_than_by_the_published_parameters() -> None:
    published = np.loadtxt(DATA / "cooling_parameters.csv", delimiter=",", skiprows=1)
    ours, theirs = [], []
    for location in range(27):
        file = DATA / f"part{location // 9 + 1}_pos{location % 9 + 1}.csv"
        t, observed = np.loadtxt(file, delimiter=",", skiprows=1, usecols=(2, 3), unpack=True)
        ours.append(float(np.sqrt(fit(t, observed[None], AMBIENT).sigma2[0])))
        b0, b1, temp0 = published[location, 1:]
        one = Surface(s=np.zeros(1), b0=np.array([b0]), b1=np.array([b1]), t0=t[:1], temp0=np.array([temp0]))
        theirs.append(float(np.sqrt(np.mean((one.at(t[None], AMBIENT) - observed) ** 2))))
    assert np.median(ours) < 1.5, ours
    assert max(ours) < 3.0, ours
    assert (np.array(ours) < theirs).all()
