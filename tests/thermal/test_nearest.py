import math

import numpy as np
import pytest
from hypothesis import given, settings
from layers import BAND, HEAD, posed, small_problems, wall
from moves import plain_python

from gcodectl.errors import UsageError
from gcodectl.thermal.graph import Lattice, graph
from gcodectl.thermal.nearest import departures, least_departure
from gcodectl.thermal.partitions import partition
from gcodectl.thermal.polish import exact_kernel, polish
from gcodectl.thermal.problem import Problem, Weights, cost_at, drive
from gcodectl.thermal.relaxation import lower_bound
from gcodectl.thermal.shortest import shortest


@settings(max_examples=40, deadline=None)
@given(small_problems())
def test_no_route_leaves_its_bounds_by_less(posed_: tuple[Problem, Lattice]) -> None:
    problem, lattice = posed_
    count = len(problem.way)
    low, high = np.full(count, -4.0), np.full(count, 3.0)
    made = graph(problem, lattice)
    least = least_departure(made, low, high)
    cheapest = shortest(made)
    assert math.isinf(least.cost) == math.isinf(cheapest.cost)
    if math.isfinite(least.cost):
        assert least.cost >= 0.0
        _, times = drive(problem, least.start, least.speeds)
        # rounding of at most half a step a partition, at up to 2 degC a second
        slack = len(problem.length) * lattice.time_step * 2.0
        assert departures(problem, times, low, high).max() <= least.cost + slack
        _, others = drive(problem, cheapest.start, cheapest.speeds)
        assert departures(problem, others, low, high).max() >= least.cost - slack


@settings(max_examples=40, deadline=None)
@given(small_problems())
def test_polishing_never_costs_and_keeps_what_the_head_can_do(posed_: tuple[Problem, Lattice]) -> None:
    problem, lattice = posed_
    found = shortest(graph(problem, lattice))
    if math.isinf(found.cost):
        return
    start, speeds = polish(problem, lattice.time_base, found.start, found.speeds, 0.1)

    def penalised(begin: float, at: np.ndarray) -> float:
        return float(
            exact_kernel(
                problem.first, problem.way, problem.under, problem.lift, problem.b1, problem.t0, problem.opens,
                problem.shuts, problem.weight, problem.length, problem.pause, problem.slowest, problem.fastest,
                problem.free.astype(np.int64), problem.entry, problem.accel, problem.change, problem.start_weight,
                problem.end_weight, problem.of_mean, lattice.time_base, np.append(begin, at),
                np.empty(len(at) + 1), np.empty(len(problem.way)),
            )
        )  # fmt: skip

    assert penalised(start, speeds) <= penalised(found.start, found.speeds)
    assert math.isfinite(penalised(start, speeds))


def test_the_penalised_cost_is_the_cost_where_nothing_is_outside() -> None:
    surface = wall()
    problem = posed(surface, partition(surface, HEAD, BAND))
    n = len(problem.length)
    plan, border, times = np.append(160.0, np.full(n, 25.0)), np.empty(n + 1), np.empty(len(surface))
    arguments = (
        problem.first, problem.way, problem.under, problem.lift, problem.b1, problem.t0, problem.opens, problem.shuts,
        problem.weight, problem.length, problem.pause, problem.slowest, problem.fastest, problem.free.astype(np.int64),
        problem.entry, problem.accel, problem.change, 1.0, 0.0, False, -math.inf,
    )  # fmt: skip
    expected = cost_at(problem, *drive(problem, 160.0, plan[1:]))
    assert exact_kernel(*arguments, plan, border, times) == pytest.approx(expected)
    with plain_python("gcodectl.thermal"):
        start, speeds = polish(problem, -math.inf, 160.0, plan[1:6], 0.1) if n == 5 else (160.0, plan[1:])
    assert cost_at(problem, *drive(problem, start, speeds)) <= expected
    plan[0] = 100.0  # too hot: a second outside costs more than any temperature
    assert exact_kernel(*arguments, plan, border, times) > 1e5
    plan[1] = 41.0
    assert math.isinf(exact_kernel(*arguments, plan, border, times))


def test_no_motion_costs_less_than_the_bound() -> None:
    surface = wall()
    parts = partition(surface, HEAD, BAND, most=7, gain=0.0)
    problem = posed(surface, parts)
    coarse, fine = lower_bound(problem, cells=4_000), lower_bound(problem, cells=40_000)
    assert coarse <= fine
    rng = np.random.default_rng(0)
    slow, fast = 1.0 / HEAD.slowest, 1.0 / HEAD.fastest
    for _ in range(300):  # any speed at any location
        pace = np.clip(rng.uniform(fast, slow) + rng.normal(0.0, 0.01, len(surface) - 1), fast, slow)
        times = rng.uniform(145.0, 165.0) + np.concatenate(([0.0], np.cumsum(np.diff(surface.s) * pace)))
        cost = float(np.sum((surface.at(times, BAND.ambient) - BAND.best) ** 2)) + float(times[0])
        assert cost >= fine
    with pytest.raises(UsageError, match="by location only"):
        lower_bound(posed(surface, parts, weights=Weights(of_mean=True)))
