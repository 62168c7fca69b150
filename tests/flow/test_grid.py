"""The grid: volumes of phases in cells of time, where passages begin, which moves may leave."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moves import SYRINGE, Pen, chunked, pens, three_lines

from gcodectl.flow.grid import command_of, passage_times, phase_rates, ready, reference_kernel
from gcodectl.motion.lookahead import plan
from gcodectl.motion.profile import profile
from gcodectl.records import Moves, Profile, SpeedPlan

DT = 0.01


def timed(pen: Pen) -> tuple[Moves, Profile]:
    pieces: list[tuple[Moves, SpeedPlan, Profile]] = list(profile(plan(chunked(pen.moves(), 10_000), SYRINGE), SYRINGE))
    return Moves.concat([one[0] for one in pieces]), Profile.concat([one[2] for one in pieces])


@given(pens())
def test_every_mm3_of_the_roads_is_in_some_cell(pen: Pen) -> None:
    moves, phases = timed(pen)
    if not len(phases):
        return
    cells = np.zeros(int((phases.t[-1] + phases.duration[-1]) / DT) + 2)
    rates = phase_rates(moves, phases, np.ones(1))
    reference_kernel(*rates, 0, DT, cells)
    plain = np.zeros(len(cells))
    reference_kernel.py_func(*rates, 0, DT, plain)
    assert np.array_equal(cells, plain)
    laid = moves.deposits & np.isin(moves.row, phases.row)
    assert cells.sum() * DT == pytest.approx(float((moves.e * moves.area)[laid].sum()), rel=1e-6, abs=1e-9)
    assert (cells >= -1e-9).all()


def test_a_tools_gain_scales_its_own_roads_only() -> None:
    moves, phases = timed(Pen().road(10, 0).tool(1).road(20, 0))
    plain, scaled = (phase_rates(moves, phases, gain)[5] for gain in (np.ones(2), np.array([1.0, 3.0])))
    second = moves.tool[phases.row - moves.row[0]] == 1
    assert scaled[second] == pytest.approx(3 * plain[second])
    assert np.array_equal(scaled[~second], plain[~second])


def test_passages_begin_after_barriers_and_tools() -> None:
    moves, phases = timed(Pen().road(10, 0).barrier().road(20, 0).tool(1))
    now = float(phases.t[-1] + phases.duration[-1])
    begins = passage_times(moves, phases, now)
    row = moves.row[moves.starts_passage]
    assert len(begins) == len(row) == 2
    assert begins[0] == phases.t[phases.row > row[0]][0]
    assert begins[1] == now


def test_moves_leave_when_all_their_samples_are_settled() -> None:
    moves, phases = timed(three_lines())
    assert ready(moves, phases, np.inf) == (len(moves), len(phases))
    middle = float(phases.t[phases.row == 2][0])
    rows, count = ready(moves, phases, middle + 0.01)
    assert rows == 2
    assert (phases.row[:count] < 2).all()
    assert phases.row[count] == 2
    assert ready(moves, phases, 0.0)[0] <= 1
    assert ready(moves, phases, float(phases.t[-1] + phases.duration[-1]))[0] == len(moves)


@given(st.integers(0, 50))
def test_a_command_spans_its_phases(first: int) -> None:
    _, phases = timed(three_lines())
    u = np.arange(5000.0)
    last = phases[len(phases) // 2 :]
    cells = command_of(last, u, -u, first=0, dt=DT)
    assert cells.t0 <= last.t[0]
    assert cells.t1 >= last.t[-1] + last.duration[-1]
    assert cells.u[0] == round(cells.t0 / DT)
    assert np.array_equal(cells.reference, -cells.u)
    low = int(last.t[0] / DT)
    moved = command_of(last, u[min(first, low) :], -u, first=min(first, low), dt=DT)
    assert np.array_equal(moved.u, cells.u)
    assert len(command_of(Profile.empty(), u, u, 0, DT).u) == 0
