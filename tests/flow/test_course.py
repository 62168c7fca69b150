"""Course: as cheap as dynamic programming over everything, and the goals themselves where the plunger can follow."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flow_models import MODELS, PLUNGER
from hypothesis import given, settings
from hypothesis import strategies as st
from inverting import goals_of, spaces
from moves import plain_python

from gcodectl.columns import Floats
from gcodectl.flow.course import (
    COURSE,
    DOWN,
    FLOW,
    GOAL,
    HIGHEST,
    LOW,
    LOWEST,
    UP,
    before_kernel,
    between_kernel,
    course_kernel,
    price_kernel,
    read_kernel,
)
from gcodectl.flow.flow_model import FlowModel, flow_kernel
from gcodectl.flow.inversion import Inversion

DT = 0.01
EACH = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def stiff(model: FlowModel) -> Inversion:
    return Inversion(model, 25.0, 2000.0, DT)


def course_of(inversion: Inversion, asked: Floats) -> tuple[Floats, int, Floats]:
    """The course from the pre-charge on, how many samples it left the goals for, and the space worked in."""
    work, cheapest = spaces(len(asked))
    n = len(asked)
    work[GOAL, : n + 1] = work[COURSE, : n + 1] = np.append(inversion.rest, goals_of(inversion, asked))
    took = course_kernel(asked, n, n, inversion.row, inversion.table, work, cheapest)
    return work[COURSE, 1 : n + 1].copy(), took, work


def price_of(inversion: Inversion, asked: Floats, course: Floats) -> float:
    flows = [flow_kernel(one, inversion.row) for one in course]
    return sum(price_kernel(*one, inversion.row) for one in zip(flows, course, asked, strict=True))


def cheapest_of(inversion: Inversion, asked: Floats, levels: int = 500) -> Floats:
    """The course by dynamic programming over the whole range of what may be stored; plain numpy."""
    goals = goals_of(inversion, asked)
    grid = np.linspace(inversion.rest, 1.3 * goals.max(), levels)
    p, table = inversion.row, inversion.table
    top, bottom = (np.array([s + read_kernel(s, column, p, table) for s in grid]) for column in (UP, DOWN))
    flow = [read_kernel(s, FLOW, p, table) for s in grid]

    def reached(k: int, top: Floats, bottom: Floats) -> Floats:
        return np.stack([top, bottom, np.clip(goals[k], bottom, top)])

    after = np.zeros((len(asked), levels))
    for k in range(len(asked) - 1, -1, -1):
        after[k] = [price_kernel(q, s, asked[k], p) for q, s in zip(flow, grid, strict=True)]
        if k + 1 < len(asked):
            after[k] += np.interp(reached(k + 1, top, bottom), grid, after[k + 1]).min(axis=0)
    course, stored = np.empty(len(asked)), inversion.rest
    for k in range(len(asked)):
        ends = [stored + read_kernel(stored, column, p, table) for column in (UP, DOWN)]
        choices = reached(k, *np.array(ends)[:, None])[:, 0]
        stored = course[k] = choices[np.interp(choices, grid, after[k]).argmin()]
    return course


def roads(*steps: tuple[float, float]) -> Floats:
    return np.concatenate([np.full(round(seconds / DT), flow) for flow, seconds in steps])


SHARP = roads((0, 0.6), (5, 1.0), (0, 0.1), (5, 0.2), (2, 0.5), (0, 0.4), (4, 0.8), (0, 1.2))


@EACH
def test_it_costs_no_more_than_the_best_of_all(model: FlowModel) -> None:
    inversion = stiff(dataclasses.replace(model, delay=0.0, gap=0.0, swing=0.0))
    course, took, _ = course_of(inversion, SHARP)
    assert 0 < took <= len(SHARP)
    best = price_of(inversion, SHARP, cheapest_of(inversion, SHARP))
    assert price_of(inversion, SHARP, course) < 1.05 * best + 0.05
    # and every step of it can be gone
    p, table = inversion.row, inversion.table
    for now, then in zip(np.append(inversion.rest, course), course, strict=False):
        assert now + read_kernel(now, DOWN, p, table) - 1e-9 <= then <= now + read_kernel(now, UP, p, table) + 1e-9


@EACH
def test_where_the_plunger_can_follow_the_goals_are_the_course(model: FlowModel) -> None:
    inversion = stiff(model)
    soft = np.concatenate([np.zeros(50), np.linspace(0.1, 3.0, 200), np.full(50, 3.0), np.linspace(3.0, 1.0, 200)])
    goals = goals_of(inversion, soft)
    work, cheapest = spaces(len(soft))
    n = len(soft) - 61
    work[GOAL, : n + 1] = work[COURSE, : n + 1] = goals[60:]
    assert course_kernel(soft[61:], n, n, inversion.row, inversion.table, work, cheapest) == 0
    assert np.array_equal(work[COURSE, 1 : n + 1], goals[61:])


@settings(max_examples=20)
@given(st.sampled_from(sorted(MODELS)), st.integers(0, 999))
def test_a_course_lies_between_its_limits_and_leaves_its_goals_only_there(structure: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    asked = np.repeat(np.maximum(rng.uniform(-4.0, 8.0, 12), 0.0), rng.integers(1, 40, 12))
    inversion = stiff(MODELS[structure])
    course, took, work = course_of(inversion, asked)
    n = len(asked)
    if took:
        slack = 0.02 * inversion.model.store
        assert (course >= work[LOWEST, 1 : n + 1] - slack).all()
        assert (course <= work[HIGHEST, 1 : n + 1] + slack).all()
    assert np.sum(course != work[GOAL, 1 : n + 1]) <= took


@EACH
def test_what_was_stored_before_is_found(model: FlowModel) -> None:
    p, table = stiff(model).row, stiff(model).table
    for stored in np.linspace(p[LOW] + 0.5, 6.0, 20):
        for column in (UP, DOWN):
            before = before_kernel(stored, column, p, table)
            assert before == before_kernel.py_func(stored, column, p, table)
            assert before + read_kernel(before, column, p, table) == pytest.approx(stored, abs=2e-3)


def test_prices() -> None:
    p = stiff(dataclasses.replace(PLUNGER, threshold=0.0)).row
    assert price_kernel(5.0, 6.0, 5.0, p) == 0.0
    assert price_kernel(2.0, 6.0, 5.0, p) > price_kernel(4.0, 6.0, 5.0, p)
    assert price_kernel(1.0, stiff(PLUNGER).rest, 0.0, stiff(PLUNGER).row) == pytest.approx(1.0 / 5.0)
    assert 0.0 < price_kernel(0.0, 1.0, 0.0, p) < 1e-3
    rows = np.arange(32.0).reshape(2, 16) ** 2
    found = [between_kernel(rows, 0, x, 1.0, 2.0) for x in (-1.0, 1.0, 1.25, 2.75, 99.0)]
    assert found == [0.0, 0.0, 0.5, 12.5, 225.0]


def test_the_same_with_the_jit_off() -> None:
    inversion = stiff(PLUNGER)
    short = SHARP[40:150]
    expected = course_of(inversion, short)[0]
    with plain_python("gcodectl.flow"):
        assert course_of(inversion, short)[0] == pytest.approx(expected, abs=1e-9)
