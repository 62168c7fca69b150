"""The bound: on a plant that can be inverted the best signal is found, and nothing leaves the plunger's limits."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from flow_bench import bound as bound_module
from flow_bench.bound import Problem, best_signal, measured_bounds
from flow_bench.learned import learn_library

from gcodectl.config import load_machine
from plant_models.bench_cases import Case
from plant_models.gantry import Firmware, cut
from plant_models.printing import Bench, capped, set_up
from plant_models.reading import read_moves

PART = b"G28\nG21\nG90\nM83\nG1 Z.6 F600\nG1 X40 Y5 F2400\nG1 X60 E.04 F600\nG1 Y15 F2400\nG1 X45 E.03 F600\n"
MACHINE = capped(load_machine("syringe"), 4.0, 8.0)


@pytest.fixture(scope="module")
def bench() -> Bench:
    made = set_up(cut(read_moves(PART, MACHINE), MACHINE, Firmware()), MACHINE, "linear")
    return dataclasses.replace(made, dt=0.005, tail=1.0)


def test_the_best_signal_is_far_better_than_what_was_sliced(bench: Bench) -> None:
    execution = bench.run(cut(read_moves(PART, MACHINE), MACHINE, Firmware()))
    start = execution.command(bench.dt, bench.tail).values
    found = best_signal(bench, execution, start)
    assert found.begun_rmse > 0.2
    assert found.rmse < 0.25 * found.begun_rmse
    assert found.off_path < 0.15


def test_the_jacobian_is_what_moving_a_knot_does(bench: Bench) -> None:
    execution = bench.run(cut(read_moves(PART, MACHINE), MACHINE, Firmware()))
    problem = Problem(bench, execution)
    u = execution.command(bench.dt, bench.tail).values
    knots = problem.knots(u)
    assert np.abs(problem.signal(knots) - u).mean() < 0.1 * np.abs(u).mean()
    base, J = problem.jacobian(knots, 0.1)
    moved = knots.copy()
    moved[0, 20] += 0.1
    np.testing.assert_allclose((problem.residual(problem.flow(moved)) - base) / 0.1, J[:, 20], atol=1e-9)


def test_bounds_of_a_case(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bound_module, "ROUNDS", 2)
    monkeypatch.setattr(bound_module, "MOST_KNOTS", 60)
    case = Case("linear", "linear", "two roads", PART, MACHINE, 4.0)
    rows = measured_bounds([case], {"linear": [learn_library("linear", MACHINE, 4.0, 0, 0.0)]}, 1)
    assert [row["motion"] for row in rows] == ["as sliced", "ours"]
    for row in rows:
        assert row["rmse"] <= row["begun_rmse"] + 1e-9
