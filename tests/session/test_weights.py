"""Weights: what a scale shows is read with its digits, and what cannot be the print's weight is refused."""

from __future__ import annotations

import numpy as np
import pytest
from sessions import FLOW, areas, printed, session

from gcodectl.errors import InputError, UsageError
from gcodectl.session.measured import Series, width_of
from gcodectl.session.record import Session, Weight
from gcodectl.session.steps import take
from gcodectl.session.weighing import counted
from gcodectl.session.weights import read_weight, with_density
from plant_models.plant import load_plant
from plant_models.recorded import laid

DENSITY = 1.3


@pytest.fixture(scope="module")
def fresh():
    """A session, what is measured of its first print exactly, and what that weighs, g."""
    now = session()
    printout = now.setup.printout
    data = printout.gcode("a trial", now.trials[0].u, now.setup.routine.dt)
    grams = DENSITY * laid(data, printout.machine, load_plant("linear", flow=FLOW)) / 1e3
    return now, areas(now), grams


def refused(fresh, times: float, step: float = 1e-4, plant: str = "") -> str:
    now, series, grams = fresh
    weights = [Weight(times * grams, step)]
    with pytest.raises(InputError) as caught:
        take(now, None, [areas(now, plant=plant) if plant else series], weights=weights, density=DENSITY)
    kept = take(now, None, [series], weights=weights, density=DENSITY, anyway=True)
    assert kept.trials[0].prints[0].weight == weights[0]
    return str(caught.value)


@pytest.mark.parametrize(
    ("times", "said"),
    [
        (1000.0, "it looks like mg; give --weighed in g"),
        (0.001, "it looks like kg; give --weighed in g"),
        (1.0 / 28.35, "it looks like oz; give --weighed in g"),
        (1.3, "see that nothing else lay on the scale (the sheet, what `begin` lays)"),
        (30.0, "see that nothing else lay on the scale"),
        (0.75, "weigh all that was laid, the datum too, and before it dries"),
    ],
)
def test_what_is_not_the_prints_weight_is_refused(fresh, times, said):
    message = refused(fresh, times)
    assert said in message
    assert f"{times:.3g} times what was measured of it at 1.3 g/cm^3"[:3] in message
    assert message.endswith("--anyway takes it as it is; the session is as it was")


def test_a_scale_that_says_less_than_the_measurement_is_refused(fresh):
    message = refused(fresh, 1.0, step=0.1)
    assert "on a scale that reads 0.1 g, which says less than the measurement: weigh with a scale that reads" in message
    assert "0.001 g, and give all its digits" in message


def test_a_scale_that_says_little_is_noted(fresh):
    now, series, grams = fresh
    one = take(now, None, [series], weights=[Weight(grams, 0.01)], density=DENSITY).trials[0].prints[0]
    assert one.faults == ()
    (note,) = one.notes
    assert f"so the amount is sure to {0.8 * 1.0 / grams:.1f} % only" in note
    assert "or lay more (`learn start` with more --flow or --lag)" in note
    one = take(now, None, [series], weights=[Weight(grams, 0.001)], density=DENSITY).trials[0].prints[0]
    assert one.notes == ()


def test_an_extruder_too_slow_for_its_trials_cannot_be_weighed(fresh):
    message = refused(fresh, 1.0, plant="syringe-slow")
    assert "says little: the extruder lags by" in message
    assert "start again with --lag" in message


def test_a_weight_of_a_measurement_that_is_wrong_itself_is_not_judged(fresh):
    now, series, grams = fresh
    half = series.x < 200.0
    short = type(series)(series.kind, series.x[half], series.y[half], source="half")
    with pytest.raises(InputError, match="measure the rest") as caught:
        take(now, None, [short], weights=[Weight(50.0 * grams, 1e-3)], density=DENSITY)
    assert "weighs" not in str(caught.value)
    kept = take(now, None, [short], weights=[Weight(50.0 * grams, 1e-3)], density=DENSITY, anyway=True)
    faults = kept.trials[0].prints[0].faults  # both, of what is taken all the same
    assert [one.partition(":")[0] for one in faults] == ["short", "weight"]


def test_roads_narrower_than_the_nozzle_is_high_are_corrected_by_any_weight():
    """Taken although it is in kg: an offset that leaves next to nothing of them."""
    now = session(height=2.4)
    s, area = printed(now).areas(0.25)
    series = Series("s,width", s, width_of(area, now.setup.printout.height))
    assert np.nanmax(series.y) < 0.75 * now.setup.printout.height
    for grams in (2e-4, 2.0):
        made = take(now, None, [series], weights=[Weight(grams, 1e-6)], density=DENSITY, anyway=True)
        one = made.trials[0].prints[0]
        q = counted(made)[0].q
        assert q.sum() * now.setup.routine.dt * (1.0 + one.beside) == pytest.approx(1e3 * grams / DENSITY, rel=0.01)


@pytest.mark.parametrize(
    ("text", "grams", "step"),
    [("1.230", 1.23, 0.001), ("46", 46.0, 1.0), (" 0,18 ", 0.18, 0.01), ("2.5e-1", 0.25, 0.01), ("1e3", 1000.0, 1e3)],
)
def test_the_digits_say_what_the_scale_reads(text, grams, step):
    found = read_weight(text)
    assert found.grams == grams
    assert found.readability == pytest.approx(step)


@pytest.mark.parametrize("text", ["", "heavy", "-1.2", "0.00", "nan", "inf", "1.2 g"])
def test_what_is_no_weight(text):
    with pytest.raises(UsageError, match=r"--weighed is .*; give grams as the scale shows them, as in 1.230"):
        read_weight(text)


@pytest.mark.parametrize(
    ("density", "said"),
    [
        (None, "--weighed needs the density once, as laid: --density, in g/cm^3"),
        (0.0, "--density is 0; it must be a positive number"),
        (-1.0, "--density is -1; it must be a positive number"),
        (float("nan"), "--density is nan"),
        (1050.0, r"--density is 1050 g/cm^3, and nothing is so dense: 1050 kg/m^3 are 1.05 g/cm^3"),
    ],
)
def test_a_density_is_needed_and_must_be_one(fresh, density, said):
    now, series, grams = fresh
    with pytest.raises(UsageError) as caught:
        take(now, None, [series], weights=[Weight(grams, 1e-3)], density=density)
    assert said in str(caught.value)


def test_a_density_is_remembered(fresh):
    now: Session = fresh[0]
    told = with_density(now, 1.9, 0)
    assert with_density(told, None, 1).setup.density == 1.9
    assert with_density(now, None, 0).setup.density == 0.0


def test_another_density_at_which_earlier_weights_cannot_be_is_refused(fresh):
    now, series, grams = fresh
    now = take(now, None, [series], weights=[Weight(grams, 1e-3)], density=DENSITY)
    with pytest.raises(UsageError, match=r"--density was 1.3 g/cm\^3 so far; at 2.6, .* weighs .* 0\.5") as caught:
        with_density(now, 2.0 * DENSITY, 0)
    assert "weigh all that was laid" in str(caught.value)
    assert with_density(now, 2.0 * DENSITY, 0, anyway=True).setup.density == 2.0 * DENSITY
    assert with_density(now, 1.1 * DENSITY, 0).setup.density == 1.1 * DENSITY


@pytest.mark.parametrize(("text", "said"), [("0.290", "0.290 g"), ("12", "12 g"), ("1,5", "1.5 g"), ("2.5e1", "25 g")])
def test_a_weight_is_said_with_all_its_digits(text: str, said: str) -> None:
    assert str(read_weight(text)) == said
