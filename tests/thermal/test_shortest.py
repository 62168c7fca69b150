import math

import numpy as np
import pytest
from hypothesis import given, settings
from layers import paper_size, small_problems
from moves import plain_python

from gcodectl.columns import Floats
from gcodectl.thermal.dynamic import backward_kernel, dynamic
from gcodectl.thermal.graph import Graph, Lattice, graph
from gcodectl.thermal.problem import Problem, cost_at, drive
from gcodectl.thermal.shortest import least_to_go, shortest


def cost_to_go(made: Graph) -> Floats:
    problem, lattice = made.problem, made.lattice
    n = len(problem.length)
    value = np.full((n + 1, lattice.times, lattice.speeds), math.inf)
    backward_kernel(
        problem.first, problem.under, problem.lift, problem.b1, problem.t0, problem.weight, problem.of_mean,
        problem.end_weight, made.speed, made.duration, made.opens, made.shuts, made.decay, made.offset, made.free,
        lattice.time_base, lattice.time_step, lattice.time_first, value,
        np.full((n, lattice.times, lattice.speeds), -1, dtype=np.int64), np.empty(64),
    )  # fmt: skip
    return value


def test_at_the_published_size_astar_finds_what_dp_finds_and_opens_few_nodes() -> None:
    made = graph(*paper_size())
    exact, found = dynamic(made), shortest(made)
    assert found.cost == pytest.approx(exact.cost, rel=0, abs=1e-9)
    assert found.nodes < exact.nodes / 20
    assert exact.nodes == 8 * 61 * 26
    border, times = drive(made.problem, found.start, found.speeds)
    # seven roundings of at most a quarter of a second, at some tenths of a degree a second
    assert cost_at(made.problem, border, times) == pytest.approx(found.cost, rel=0.1)


@settings(max_examples=150, deadline=None)
@given(small_problems())
def test_astar_equals_dp(posed: tuple[Problem, Lattice]) -> None:
    made = graph(*posed)
    exact, found = dynamic(made), shortest(made)
    if math.isinf(exact.cost):
        assert math.isinf(found.cost)
    else:
        assert found.cost == pytest.approx(exact.cost, rel=1e-12, abs=1e-9)
        assert np.isfinite(found.speeds).all()


@settings(max_examples=100, deadline=None)
@given(small_problems())
def test_the_heuristic_never_promises_more_than_it_costs(posed: tuple[Problem, Lattice]) -> None:
    made = graph(*posed)
    value, bound = cost_to_go(made), least_to_go(made)
    cheapest = value.min(axis=2)
    reached = np.isfinite(cheapest)
    assert (bound[reached] <= cheapest[reached] * (1 + 1e-12) + 1e-9).all()


def test_a_loose_heuristic_would_open_more() -> None:
    problem, lattice = paper_size()
    made = graph(problem, lattice)
    bound = least_to_go(made)
    assert bound[0].min() > 0.5 * dynamic(made).cost
    assert (bound[:-1].min(axis=1) >= bound[1:].min(axis=1)).all()


def test_where_no_arc_leads_there_is_no_route() -> None:
    problem, lattice = paper_size()
    late = Lattice(
        400.0, 0.5, lattice.time_first, lattice.times, lattice.speed_base, 1.0, lattice.speed_first, lattice.speeds
    )
    made = graph(problem, late)
    assert math.isinf(dynamic(made).cost)
    assert math.isinf(shortest(made).cost)


@settings(max_examples=6, deadline=None)
@given(small_problems())
def test_plain_python_finds_the_same(posed: tuple[Problem, Lattice]) -> None:
    made = graph(*posed)
    fast = dynamic(made), shortest(made)
    with plain_python("gcodectl.thermal"):
        slow_graph = graph(*posed)
        slow = dynamic(slow_graph), shortest(slow_graph)
    for one, other in zip(fast, slow, strict=True):
        assert one.cost == pytest.approx(other.cost, rel=1e-12)
        np.testing.assert_allclose(one.speeds, other.speeds)
