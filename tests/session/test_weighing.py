"""Weighing: a known error of the measurement is found again from what the print weighs, and taken out."""

from __future__ import annotations

import dataclasses
import gzip
from pathlib import Path

import numpy as np
import pytest
from sessions import FLOW, areas, printed, session

from gcodectl.errors import UsageError
from gcodectl.session.measured import Series, width_of
from gcodectl.session.record import NAME, Session, Weight, load, save
from gcodectl.session.steps import advance, drop, library, take
from gcodectl.session.weighing import corrections, counted, laid_beside, told
from plant_models.plant import load_plant
from plant_models.recorded import laid

DENSITY = 1.3
OLD = Path(__file__).resolve().parents[1] / "data" / "session_v1.json.gz"


def volume(now: Session, number: int = -1, plant: str = "linear") -> float:
    printout, trial = now.setup.printout, now.trials[number]
    data = printout.gcode("a trial", trial.u, now.setup.routine.dt)
    return laid(data, printout.machine, load_plant(plant, flow=FLOW))


def weight(now: Session, number: int = -1, plant: str = "linear") -> Weight:
    return Weight(DENSITY * volume(now, number, plant) / 1e3, 1e-6)


def widths(now: Session, more: float = 0.0, number: int = -1, by: str = "", plant: str = "linear") -> Series:
    """What a camera sees that shows roads `more` mm wider, and thin ones by less."""
    s, area = printed(now, number, plant).areas(0.25)
    width = width_of(area, now.setup.printout.height)
    thin = np.minimum(1.0, width / (0.75 * now.setup.printout.height))
    seen = np.maximum(width + more * thin, 0.0)
    return Series("s,width", s, seen, source=f"{by} {number} {more}", by=by)


def exact_flow(now: Session, number: int = -1) -> np.ndarray:
    return take(session(), None, [areas(now, number)]).trials[0].q


@pytest.mark.parametrize("factor", [0.85, 1.0, 1.1])
@pytest.mark.parametrize("kind", ["s,area", "t,q"])
def test_a_factor_is_found_again(factor, kind):
    now = session()
    series = areas(now)
    if kind == "t,q":
        t, q = series.flow(now.setup.printout.layout.speed, 1.0)
        series = dataclasses.replace(series, kind=kind, x=t, y=q)
    off = dataclasses.replace(series, y=series.y * factor)
    now = take(now, None, [off], weights=[weight(now)], density=DENSITY)
    assert now.trials[0].prints[0].faults == ()
    found = corrections(now)[0, 0]
    assert found.factor == pytest.approx(1.0 / factor, rel=0.004)
    assert found.offset == 0.0
    assert found.own
    assert abs(found.factor * factor - 1.0) < 2.0 * found.sigma
    assert counted(now)[0].q == pytest.approx(exact_flow(now), abs=0.01 * FLOW)


@pytest.mark.parametrize("more", [-0.06, 0.0, 0.08])
def test_an_offset_of_widths_is_found_again(more):
    now = session()
    now = take(now, None, [widths(now, more)], weights=[weight(now)], density=DENSITY)
    found = corrections(now)[0, 0]
    assert found.offset == pytest.approx(-more, abs=0.003)
    assert found.factor == 1.0
    exact = exact_flow(now)
    wrong, right = (float(np.sqrt(np.mean((one.q - exact) ** 2))) for one in (now.trials[0], counted(now)[0]))
    assert right < max(0.2 * wrong, 0.01 * FLOW)


def test_widths_whose_height_was_measured_too_are_off_by_a_factor():
    now = session()
    flat = widths(now, 0.05)
    height = np.full(len(flat.x), now.setup.printout.height)
    now = take(now, None, [dataclasses.replace(flat, height=height)], weights=[weight(now)], density=DENSITY)
    assert now.trials[0].prints[0].way == "s,width,height"
    assert corrections(now)[0, 0].factor == pytest.approx(0.93, abs=0.03)


@pytest.mark.parametrize(
    ("plant", "within"), [("linear", 0.005), ("syringe-fast", 0.005), ("pneumatic", 0.005), ("syringe-mid", 0.015)]
)
def test_what_lies_beside_the_path_is_known_without_looking_at_it(plant, within):
    now = session()
    one = take(now, None, [areas(now, plant=plant)], anyway=True).trials[0].prints[0]
    known, _ = laid_beside(now.setup, now.trials[0].u, one, one.q)
    on_path = float(one.q.sum()) * now.setup.routine.dt
    whole = volume(now, plant=plant)
    assert on_path * (1.0 + known.beside) == pytest.approx(whole, rel=within)
    assert known.beside > 0.3  # it would be missed
    assert abs(whole / on_path - 1.0 - known.beside) < max(2.0 * known.beside_sigma, 0.005)


def test_what_was_measured_stays_and_the_learner_sees_it_corrected():
    off = session()
    series = areas(off)
    high = dataclasses.replace(series, y=1.15 * series.y)
    weighed = take(off, None, [high], weights=[weight(off)], density=DENSITY)
    plain = take(off, None, [high])
    assert weighed.trials[0].q.tolist() == plain.trials[0].q.tolist()
    (_, seen), (_, blind), (_, exact) = (advance(one) for one in (weighed, plain, take(off, None, [series])))
    assert seen.learner.trials[0].rms == pytest.approx(exact.learner.trials[0].rms, rel=0.01)
    assert blind.learner.trials[0].rms != pytest.approx(exact.learner.trials[0].rms, rel=0.05)
    assert abs(seen.model.K / exact.model.K - 1.0) < 0.01


def test_another_density_corrects_all_of_it_anew():
    now = session()
    now = take(now, None, [areas(now)], weights=[weight(now)], density=1.1 * DENSITY)
    assert corrections(now)[0, 0].factor == pytest.approx(1.0 / 1.1, rel=0.005)
    now, _ = advance(now)
    now = take(now, None, [areas(now, noise=0.001, seed=1)], density=DENSITY)
    assert corrections(now)[0, 0].factor == pytest.approx(1.0, rel=0.005)


def test_prints_that_were_not_weighed_get_what_those_measured_the_same_way_got():
    now = session()
    first = [widths(now, more, by="photo") for more in (0.05, 0.07)]
    now, _ = advance(take(now, None, first, weights=[weight(now)] * 2, density=DENSITY))
    now = take(now, None, [widths(now, 0.06, by="photo"), widths(now, 0.0), areas(now, noise=0.01, seed=3)])
    found = corrections(now)
    assert set(found) == {(0, 0), (0, 1), (1, 0)}
    assert [found[0, k].offset for k in range(2)] == pytest.approx([-0.05, -0.07], abs=0.003)
    assert found[1, 0].offset == pytest.approx(-0.06, abs=0.003)
    assert not found[1, 0].own
    assert found[1, 0].sigma > found[0, 0].sigma
    (table,) = told(now)
    assert (table["measured"], table["weighed"], table["corrected"]) == ("photo", 2, 3)
    assert table["offset_mm"] == pytest.approx(-0.06, abs=0.003)
    assert counted(now)[1].prints[1].q.tolist() == now.trials[1].prints[1].q.tolist()
    assert told(drop(now, 0)) == []


def test_a_scale_that_reads_less_makes_the_amount_less_sure():
    now = session()
    fine, coarse = (Weight(weight(now).grams, step) for step in (1e-4, 0.01))
    sigma = [
        corrections(take(now, None, [areas(now)], weights=[one], density=DENSITY, anyway=True))[0, 0].volume
        for one in (fine, coarse)
    ]
    assert sigma[1] ** 2 - sigma[0] ** 2 == pytest.approx((0.8 * 0.01 / fine.grams) ** 2, rel=0.01)


def test_the_record_says_what_was_weighed():
    now = session()
    now, _ = advance(take(now, None, [areas(now)], weights=[weight(now)], density=DENSITY))
    now, _ = advance(take(now, None, [areas(now, noise=0.001, seed=1)]))
    one, _ = library(now)
    (table,) = one.training["weighed"]
    assert (table["measured"], table["weighed"], table["corrected"], table["density"]) == ("s,area", 1, 2, DENSITY)
    assert table["factor"] == pytest.approx(1.0, abs=0.005)
    assert table["volume"] < 0.03


def test_a_weight_comes_back_from_the_file(tmp_path):
    now = session()
    now = take(now, None, [widths(now, 0.05, by="photo")], weights=[Weight(0.207, 0.001)], density=DENSITY)
    save(now, tmp_path)
    again = load(tmp_path)
    assert again.trials[0].prints[0].weight == Weight(0.207, 0.001)
    assert again.setup.density == DENSITY
    assert corrections(again) == corrections(now)


def test_a_session_of_before_there_were_weights_goes_on(tmp_path):
    """Written by the last version whose sessions were of format 1."""
    (tmp_path / NAME).write_bytes(gzip.decompress(OLD.read_bytes()))
    now = load(tmp_path)
    assert now.setup.density == 0.0
    assert [one.way for one in now.trials[0].prints] == [""]
    assert corrections(now) == {}
    series = [widths(now, 0.05)]
    now, _ = advance(take(now, None, series, weights=[weight(now)], density=DENSITY))
    assert set(corrections(now)) == {(1, 0)}
    save(now, tmp_path)
    assert b'"version": 2' in (tmp_path / NAME).read_bytes()  # which that version refuses, and does not overlook
    assert load(tmp_path).trials[1].prints[0].weight == now.trials[1].prints[0].weight


def test_weights_and_prints_must_be_as_many():
    now = session()
    one = areas(now)
    with pytest.raises(UsageError, match="--weighed is given 2 times for 1 prints: give it once a print"):
        take(now, None, [one], weights=[Weight(0.2, 0.001)] * 2, density=DENSITY)
