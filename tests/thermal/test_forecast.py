import numpy as np
import pytest
from layers import BAND

from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.thermal.control import Past, expected, plan_layer
from gcodectl.thermal.cooling import Cooling, fit
from gcodectl.thermal.forecast import forecast
from gcodectl.thermal.surface import Head, Surface

COUNT = 25


def layer(number: int, drift: float, noise: float = 1.0, seed: int = 0) -> tuple[Surface, Cooling]:
    """A layer that cools the faster the higher its number, and its fit."""
    base = np.random.default_rng(seed).uniform(0.009, 0.012, COUNT)
    b1 = -base * np.exp(-drift * number)
    b0 = 80.0 * base - 170.0 * (base + b1)  # fast at first, and colder in the end
    t0 = 0.5 * np.arange(COUNT)
    true = Surface(s=20.0 * np.arange(COUNT), b0=b0, b1=b1, t0=t0, temp0=np.full(COUNT, BAND.deposition))
    t = np.arange(20.0, 170.0, 2.0)
    readings = true.at(np.broadcast_to(t, (COUNT, len(t))), BAND.ambient)
    readings = readings + noise * np.random.default_rng([seed, number]).standard_normal(readings.shape)
    return true, fit(t, readings, BAND.ambient, t0)


def error(made: Cooling, true: Surface, t: float = 150.0) -> float:
    at = np.full(COUNT, t)
    return float(np.sqrt(np.mean((made.predict(at, BAND.ambient)[0] - true.at(at, BAND.ambient)) ** 2)))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_drift_is_followed_by_the_process_and_lagged_by_the_average(seed: int) -> None:
    layers = [layer(number, 0.04, 0.3, seed) for number in range(7)]
    true, fits = layers[6][0], [one[1] for one in layers[:6]]
    followed, lagged, last = forecast(fits), forecast(fits, ewma=True), fits[-1]
    assert error(followed, true) < 0.5 * error(lagged, true)
    assert error(followed, true) < 0.95 * error(last, true)


def test_without_drift_the_noise_is_smoothed() -> None:
    layers = [layer(number, 0.0, 3.0) for number in range(4)]
    true, fits = layers[3][0], [one[1] for one in layers[:3]]
    made = forecast(fits)
    assert error(made, true, 250.0) < 0.85 * error(fits[-1], true, 250.0)
    late = np.full(COUNT, 250.0)
    assert (made.predict(late, BAND.ambient)[1] < fits[-1].predict(late, BAND.ambient)[1]).mean() > 0.8


def test_the_correlation_of_the_parameters_is_kept() -> None:
    fits = [layer(number, 0.02)[1] for number in range(3)]
    for ewma in (False, True):
        made = forecast(fits, ewma=ewma).covariance.reshape(-1, 3, 3)
        correlation = made[:, 0, 1] / np.sqrt(made[:, 0, 0] * made[:, 1, 1])
        assert (correlation > -1.0).all()
        assert np.median(np.abs(correlation)) > 0.95
        assert (np.linalg.eigvalsh(made) > -1e-9).all()


def test_one_layer_is_its_own_forecast_and_none_has_none() -> None:
    first = layer(0, 0.0)[1]
    np.testing.assert_allclose(forecast([first]).b1, first.b1)
    with pytest.raises(UsageError, match="at least one layer"):
        forecast([])
    with pytest.raises(UsageError, match="the same locations"):
        forecast([first, first[:3]])


def test_bounds_of_a_forecast_hold_about_as_often_as_they_say() -> None:
    outside = []
    for seed in range(6):
        layers = [layer(number, 0.02, 1.0, seed) for number in range(4)]
        made = forecast([one[1] for one in layers[:3]])
        at = np.full(COUNT, 140.0)
        low, high = made.bounds(at, BAND.ambient, 0.05)
        came = layers[3][0].at(at, BAND.ambient) + np.random.default_rng(seed).standard_normal(COUNT)
        outside += [np.mean(came < low), np.mean(came > high)]
    assert np.mean(outside) < 0.08
    assert np.mean(outside) > 0.005


def heated(surface: Surface, share: float, delay: float) -> tuple[Floats, Floats]:
    """When each location is heated again (the middle ones), and its temperature just behind."""
    again = np.where(np.abs(np.arange(COUNT) - 12) < 4, surface.t0[-1] + delay, surface.t0)
    before = surface.at(again, BAND.ambient)
    return again, np.where(again > surface.t0, before + share * (BAND.deposition - before), surface.temp0)


def test_a_stretch_heated_again_is_expected_where_the_plan_puts_it() -> None:
    true, _ = layer(0, 0.0)
    again, temp0 = heated(true, 0.3, 20.0)
    t = np.arange(35.0, 170.0, 2.0)
    readings = true.replace(t0=again, temp0=temp0).at(np.broadcast_to(t, (COUNT, len(t))), BAND.ambient)
    past = Past(fit(t, readings, BAND.ambient, again), np.array(true.t0))
    np.testing.assert_allclose(past.share(BAND)[again > true.t0], 0.3, atol=1e-3)
    assert (past.share(BAND)[again == true.t0] == 0.0).all()
    slower = true.replace(t0=2.0 * true.t0)  # the next layer is laid at half the speed: colder when touched
    after, hot = heated(slower, 0.3, 20.0)
    made = expected([past], np.array(slower.t0), after, BAND)
    np.testing.assert_allclose(made.temp0, hot, atol=0.2)
    assert np.abs(hot - temp0)[again > true.t0].min() > 1.0


def test_a_layer_is_planned_from_what_was_seen_of_the_last_ones() -> None:
    layers = [layer(number, 0.01) for number in range(4)]
    true = layers[3][0]
    laid = np.array(true.t0)
    past = [Past(one[1], laid) for one in layers[:3]]
    made = plan_layer(past, np.array(true.s), laid, laid, Head(25.0, 80.0, 20.0), BAND, earliest=30.0)
    beneath = true.at(made.plan.times, BAND.ambient)
    assert made.plan.widened == 0.0
    assert np.mean((beneath < BAND.low) | (beneath > BAND.high)) == 0.0
    assert np.sqrt(np.mean((beneath - made.plan.temperatures) ** 2)) < 1.0
    assert made.plan.start >= 30.0
    assert len(made.partitions) == len(made.plan.speeds)
