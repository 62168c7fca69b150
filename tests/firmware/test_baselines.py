"""Benches of known plants: what coasting and pressure advance do, and that the tuning finds it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from paths import AREA, BEAD, MACHINE, make, road

from gcodectl.errors import InputError, UsageError
from gcodectl.records import Kind
from plant_models.baselines import coasting, cost, expert, none, pressure_advance, slow
from plant_models.coast import coast
from plant_models.gantry import E_ONLY, PATH, Firmware, cut
from plant_models.linear import Linear
from plant_models.plunger import Plunger
from plant_models.printing import Bench, capped, nominal_flow, reference, set_up
from plant_models.whole import whole, widened

PART = make(
    [{"to": (-5, 0)}, *road([(0, 0), (20, 0), (20, 20), (0, 20)]), {"to": (0, 25)}, *road([(4, 4), (12, 4), (12, 12)])]
)
ORIGINAL = cut(PART, MACHINE, Firmware())


def bench(tau: float, K: float = 1.0, max_flow: float = 1e6) -> Bench:
    made = set_up(ORIGINAL, MACHINE, "linear")
    return dataclasses.replace(made, plants={0: Plunger(Linear(K, tau), max_flow)}, dt=0.005)


def test_nominal_flow_is_the_median_by_volume():
    rows = [*road([(0, 0), (30, 0)], feed=10), *road([(0, 5), (10, 5)], feed=20)]
    assert nominal_flow(cut(make(rows), MACHINE, Firmware())) == pytest.approx(10 * BEAD)
    with pytest.raises(InputError, match="no road"):
        nominal_flow(cut(make([{"to": (5, 5)}]), MACHINE, Firmware()))


def test_the_cap_is_a_multiple_of_the_flow():
    assert capped(MACHINE, 5.0, 4.0).max_flow == 20
    assert capped(MACHINE, 5.0, None) is MACHINE
    with pytest.raises(UsageError, match="cap"):
        capped(MACHINE, 5.0, 0.0)


@pytest.mark.parametrize("distance", [0.3, 2.0, 50.0])
def test_coasting_leaves_out_the_last_volume_and_keeps_the_path(distance: float):
    out = coast(ORIGINAL, distance)
    left_out = min(distance, 30) + min(distance, 8)
    assert out.volume.sum() == pytest.approx(ORIGINAL.volume.sum() - left_out * BEAD)
    path = out.kind == PATH
    assert out.length[path].sum() == pytest.approx(ORIGINAL.length.sum())
    np.testing.assert_allclose(out.p0[1:], out.p1[:-1])
    np.testing.assert_allclose(np.linalg.norm(out.p1 - out.p0, axis=1), out.length, atol=1e-9)
    last = np.flatnonzero(out.volume > 0)[-1]
    assert np.linalg.norm(out.p1[last] - (12, 12, 0)) == pytest.approx(min(distance, 8), abs=1e-6)


def test_coasting_nothing_changes_nothing():
    assert coast(ORIGINAL, 0.0) is ORIGINAL
    travel = cut(make([{"to": (5, 5)}]), MACHINE, Firmware())
    assert len(coast(travel, 1.0)) == 1


def test_coasting_is_tuned_or_left_alone():
    obedient = coasting(bench(1e-4), ORIGINAL)
    assert obedient.settings["distance"] < 0.05
    ample = coasting(bench(0.3, K=1.1), ORIGINAL)
    assert cost(ample.score) <= cost(none(bench(0.3, K=1.1), ORIGINAL).score)
    assert ample.settings["distance"] > 0


def test_tuning_finds_the_lag_and_the_gain():
    tuned = pressure_advance(bench(0.2, K=1.25), ORIGINAL, evaluations=40)
    assert tuned.settings["advance"] == pytest.approx(0.2, rel=0.15)
    assert tuned.settings["gain"] == pytest.approx(1 / 1.25, rel=0.02)
    assert tuned.score.rmse < 0.25 * none(bench(0.2, K=1.25), ORIGINAL).score.rmse


def test_an_expert_pays_with_time_for_what_the_cap_forbids():
    tight = bench(1.0, max_flow=5 * 10 * BEAD)
    advanced = pressure_advance(tight, ORIGINAL, evaluations=10)
    best = expert(tight, ORIGINAL, advanced, evaluations=10)
    assert best.name == "expert"
    assert cost(best.score) < 0.7 * cost(advanced.score)
    assert best.score.time_s > advanced.score.time_s
    assert {"accel", "corner_speed", "retracts"} <= set(best.settings)


def test_slowing_keeps_travels_and_may_drop_retractions():
    rows = [*road([(0, 0), (9, 0)]), {"e": -0.01, "feed": 1}, {"to": (20, 0), "feed": 40}, {"e": 0.01, "feed": 1}]
    segments = cut(make([*rows, *road([(20, 0), (30, 0)])]), MACHINE, Firmware())
    slowed = slow(segments, 10.0, 0.5, retracts=False)
    assert not (slowed.kind == E_ONLY).any()
    assert slowed.accel.tolist() == [10, MACHINE.travel_accel, 10]
    assert slowed.corner_speed.tolist() == [0.5] * 3
    assert slowed.broken.tolist() == [False, True, True]
    assert len(slow(segments, 10.0, 0.5, retracts=True)) == len(segments)


def test_a_widened_reference_holds_the_flow_beside_roads_only():
    wanted = np.array([[0, 0, 0, 5, 2, 5, 5, 0, 0, 0, 0.0]])
    assert widened(wanted, 0.2, 0.1).tolist() == [[0, 5, 5, 5, 2, 5, 5, 5, 5, 0, 0]]
    assert widened(wanted, 0.0, 0.1) is wanted


def test_learning_on_the_whole_part_gets_better_trial_by_trial():
    lagging = bench(0.3)
    laws = {0: lambda u, error: u + 0.5 * error}
    first, last = (whole(lagging, ORIGINAL, laws, trials) for trials in (1, 15))
    assert last.settings["trial"] > 5
    assert cost(last.score) < 0.5 * cost(first.score)
    assert last.settings["margin"] in (0.0, 0.1, 0.2)
    stuck = whole(lagging, ORIGINAL, {0: lambda u, _: 0.9 * u}, 31, margins=(0.0,))
    assert stuck.settings["trial"] == 0


def test_the_reference_is_what_the_roads_ask_for():
    rows = [*road([(0, 0), (20, 0)]), {"e": 0.02, "feed": 1}]
    segments = cut(make(rows), MACHINE, Firmware())
    execution, wanted = reference(dataclasses.replace(bench(1.0), tail=1.0), segments)
    assert wanted.sum() * 0.005 == pytest.approx(20 * BEAD)
    assert execution.command(0.005).values.sum() * 0.005 == pytest.approx(20 * BEAD + 0.02 * AREA)


def test_every_tool_has_its_plant():
    rows = [*road([(0, 0), (20, 0)]), {"kind": Kind.TOOL, "tool": 1}, {"to": (0, 0), "e": 0.02, "tool": 1}]
    segments = cut(make(rows), MACHINE, Firmware())
    made = set_up(segments, MACHINE, "linear", tool_plants={1: "paste-b"})
    _, q = made.printed(made.run(segments))
    u = made.run(segments).command(made.dt, made.tail).values
    assert sorted(made.plants) == [0, 1]
    assert q.values[1].sum() < 0.89 * u[1].sum()
    assert q.values[0].sum() == pytest.approx(u[0].sum(), rel=1e-3)
