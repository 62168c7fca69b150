import dataclasses
import math
import os
from pathlib import Path

import numpy as np
import pytest
from layers import BAND, HEAD, posed, wall

from gcodectl.columns import Floats
from gcodectl.errors import InputError, UsageError
from gcodectl.thermal.graph import Lattice, graph
from gcodectl.thermal.partitions import Partitions, partition, partitions_at
from gcodectl.thermal.problem import Problem, Weights, cost_at, drive
from gcodectl.thermal.relaxation import lower_bound
from gcodectl.thermal.shortest import shortest
from gcodectl.thermal.speed import Ruled, SpeedsPlan, plan_speeds
from gcodectl.thermal.surface import Band, Head, Surface

DATA = Path(os.environ.get("GCODECTL_DATA", Path(__file__).resolve().parents[2] / "../shared/data")) / "lfam_hexagon"
INSTANT = dataclasses.replace(HEAD, accel=math.inf)


def seven(surface: Surface) -> Partitions:
    return partition(surface, HEAD, BAND, most=7, gain=0.0)


def kept(plan: SpeedsPlan, problem: Problem, head: Head, entry: float | None = None) -> None:
    """A plan does what it says, and what the head can do."""
    border, times = drive(problem, plan.start, plan.speeds)
    np.testing.assert_allclose(plan.times, times)
    assert plan.cost == pytest.approx(cost_at(problem, border, times))
    assert (plan.speeds >= head.slowest).all()
    assert (plan.speeds <= head.fastest).all()
    before = np.append(plan.speeds[0] if entry is None else entry, plan.speeds[:-1])
    assert (np.abs(plan.speeds**2 - before**2) <= 2 * head.accel * problem.length * (1 + 1e-6)).all()


def test_the_wall_is_planned_within_one_percent_of_what_any_motion_costs() -> None:
    surface = wall()
    problem = posed(surface, seven(surface))
    plan = plan_speeds(surface, seven(surface), HEAD, BAND)
    kept(plan, problem, HEAD)
    assert plan.widened == 0.0
    assert plan.complaint() == ""
    assert BAND.low < plan.temperatures.min() < plan.temperatures.max() < BAND.high
    assert plan.cost <= 1.01 * lower_bound(problem, cells=100_000)


def test_no_finer_grid_finds_better() -> None:
    surface = wall()
    for head in (HEAD, INSTANT):
        problem = posed(surface, seven(surface), head)
        plan = plan_speeds(surface, seven(surface), head, BAND)
        border = np.zeros(8, dtype=np.int64)
        route = shortest(graph(problem, Lattice(140.0, 0.05, border, 800, 15.0, 0.5, border, 51)))
        exact = cost_at(problem, *drive(problem, route.start, route.speeds))
        assert plan.cost <= exact + 1e-6
        assert plan.cost >= lower_bound(problem)


def test_random_changes_of_a_plan_do_not_better_it() -> None:
    surface = wall()
    problem, rng = posed(surface, seven(surface)), np.random.default_rng(0)
    plan = plan_speeds(surface, seven(surface), HEAD, BAND)
    for scale in (1e-3, 1e-2, 0.1):
        for _ in range(200):
            speeds = np.clip(plan.speeds * (1 + scale * rng.standard_normal(7)), HEAD.slowest, HEAD.fastest)
            if (np.abs(np.diff(speeds**2)) > 2 * HEAD.accel * problem.length[1:]).any():
                continue
            other = cost_at(problem, *drive(problem, plan.start + 10 * scale * rng.standard_normal(), speeds))
            assert other >= plan.cost - 1e-6


def test_a_start_cannot_be_before_the_earliest_and_nothing_before_it_was_laid() -> None:
    surface = wall()
    late = plan_speeds(surface, seven(surface), HEAD, BAND, earliest=180.0)
    assert late.start == pytest.approx(180.0, abs=1e-6)
    assert late.cost > plan_speeds(surface, seven(surface), HEAD, BAND).cost
    t0 = np.array(surface.t0)
    t0[-6:] = 168.0  # laid once more: the head must not come by before
    temp0 = np.array(surface.temp0)
    temp0[-6:] = 149.0
    again = surface.replace(t0=t0, temp0=temp0)
    plan = plan_speeds(again, partition(again, HEAD, BAND), HEAD, BAND)
    assert (plan.times >= t0 - 1e-3).all()
    assert plan.widened == 0.0


def test_limits_pauses_and_entry_are_heeded_and_told() -> None:
    surface = wall()
    parts = partitions_at(surface, np.array([0, 15, 30]), HEAD)
    parts = parts.replace(fastest=np.array([40.0, 17.0, 40.0]), pause=np.array([0.0, 0.0, 4.0]))
    plan = plan_speeds(surface, parts, HEAD, BAND, Weights(1.0, 30.0), entry=16.0)
    kept(plan, posed(surface, parts, weights=Weights(1.0, 30.0), entry=16.0), Head(15.0, 40.0, math.inf))
    assert plan.speeds[1] <= 17.0
    assert plan.speeds[1] == pytest.approx(17.0, rel=1e-3)
    assert plan.ruled[1] == Ruled.FASTEST
    assert plan.times[30] - plan.times[29] > 4.0
    assert plan.end == plan.borders[-1]
    quick = plan_speeds(surface, parts, Head(15.0, 40.0, 1.0), BAND, Weights(1.0, 1000.0), entry=16.0)
    assert quick.ruled[0] in (Ruled.REACH, Ruled.HEAT)
    assert quick.speeds[0] ** 2 <= 16.0**2 + 2 * 1.0 * parts.length[0] + 1e-6


def test_a_band_that_no_plan_keeps_gets_the_least_widening() -> None:
    surface = wall()
    tight = Band(low=133.0, high=140.0)
    plan = plan_speeds(surface, seven(surface), HEAD, tight)
    assert 0.1 < plan.widened < 3.0
    assert plan.outside.max() == pytest.approx(plan.widened, abs=0.05)
    assert "no plan keeps the band: location" in plan.complaint()
    assert f"{plan.widened:.1f} degC wider" in plan.complaint()
    share = plan.widened * 0.98 - 0.02
    less = plan_speeds(
        surface, seven(surface), HEAD, dataclasses.replace(tight, low=tight.low - share, high=tight.high + share)
    )
    assert less.widened > 0.0
    more = plan.widened + 0.03
    wider = plan_speeds(
        surface, seven(surface), HEAD, dataclasses.replace(tight, low=tight.low - more, high=tight.high + more)
    )
    assert wider.widened == 0.0


def test_a_margin_narrows_the_band() -> None:
    surface = wall()
    free = plan_speeds(surface, seven(surface), HEAD, BAND)
    band = Band(low=130.0, high=142.0)
    plan = plan_speeds(surface, seven(surface), HEAD, band, margin=np.full(len(surface), 1.5))
    assert plan.widened == 0.0
    assert plan.temperatures.min() >= 131.5 - 0.01
    assert plan.temperatures.max() <= 140.5 + 0.01
    assert plan.cost >= free.cost - 1e-6


def test_what_has_no_plan_at_all_is_refused() -> None:
    surface = wall()
    parts = partitions_at(surface, np.array([0, 20]), HEAD)
    with pytest.raises(InputError, match="no speeds take the head"):
        plan_speeds(
            surface, parts.replace(slowest=np.array([39.0, 15.0]), fastest=np.array([40.0, 16.0])),
            Head(15.0, 40.0, 1.0), BAND,
        )  # fmt: skip
    with pytest.raises(UsageError, match="a change of at least 0"):
        plan_speeds(surface, parts, HEAD, BAND, change=-1.0)


def hexagon(slowest: float, fastest: float) -> tuple[Surface, Partitions, Floats]:
    """The measured layer: each partition cools as its own location; laid at 20 mm/s, known where it ends."""
    table = np.loadtxt(DATA / "cooling_parameters.csv", delimiter=",", skiprows=1)
    length, row = np.loadtxt(DATA / "partitions.csv", delimiter=",", skiprows=1, usecols=(1, 2), unpack=True)
    b0, b1, temp0 = table[row.astype(int), 1:].T
    of = np.repeat(np.arange(len(length)), (length / 11.0).astype(int))
    begin = np.cumsum(length) - length
    s = 11.0 * np.arange(len(of)) + 5.5
    surface = Surface(s=s, b0=b0[of], b1=b1[of], t0=(begin + length)[of] / 20.0, temp0=temp0[of])
    first = np.searchsorted(of, np.arange(len(length)))
    limits = np.full(len(length), slowest), np.full(len(length), fastest)
    return surface, Partitions(first, begin, length, *limits, np.zeros(len(length))), begin + length


@pytest.mark.skipif(not DATA.is_dir(), reason="no measured data beside the checkout")
def test_the_measured_hexagon() -> None:
    surface, parts, ends = hexagon(10.0, 60.0)
    band, weights = Band(low=60.0, best=120.0, high=190.0), Weights(0.0, 1.0, of_mean=True)
    laid = float(ends[-1]) / 20.0
    problem = posed(surface, parts, Head(10.0, 60.0, math.inf), band, weights, 20.0, 0.05)
    assert cost_at(problem, *drive(problem, laid, np.full(25, 20.0))) - laid == pytest.approx(1546.7, abs=0.05)
    ruled = plan_speeds(
        surface, parts, Head(10.0, 60.0, math.inf), band, weights, entry=20.0, earliest=laid, change=0.05
    )
    assert ruled.cost - laid <= 680.0
    ratio = ruled.speeds / np.append(20.0, ruled.speeds[:-1])
    assert (np.abs(ratio - 1.0) <= 0.05 + 1e-6).all()
    surface, parts, _ = hexagon(5.0, 100.0)
    plan = plan_speeds(surface, parts, Head(5.0, 100.0, 50.0), band, weights, entry=20.0, earliest=laid)
    kept(plan, posed(surface, parts, Head(5.0, 100.0, 50.0), band, weights, 20.0), Head(5.0, 100.0, 50.0), 20.0)
    assert plan.cost - laid <= 337.0
