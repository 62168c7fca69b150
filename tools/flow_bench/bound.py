"""What no controller can beat: the best plunger signal for a motion, found by optimisation on the true plant.

    u     knots every `KNOT` s, straight in between, each within +-max_flow (and so within the slew: the plunger checks)
    r(u)  [ bin errors / sqrt(bins) ... , off_path ]            |r|^2 = rmse^2 + off_path^2

    Gauss-Newton: J by moving one knot at a time (the plant is run on from its state at that knot), then the linear
    least squares within the bounds and a trust region around u; a step that does not help shrinks the region.

It reads the plant as no controller may, knows the whole part, and finds a local optimum: what is near it is near the
best. The motion is given, as sliced or as ours; with another motion there is another bound.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from flow_bench.cell import Station
from flow_bench.fronts import few
from flow_bench.learned import filtered
from gcodectl.columns import Floats
from gcodectl.flow.library import BasisSet
from gcodectl.records import Signal
from plant_models.baselines import Outcome
from plant_models.bead import deposit
from plant_models.bench_cases import Case
from plant_models.firmware import Execution, execute
from plant_models.match import match
from plant_models.printing import Bench
from plant_models.reading import read_moves

KNOT = 0.05
"""s"""
MOST_KNOTS = 500
"""More make the knots wider."""
ROUNDS = 8
ROUGH = 2
"""Samples this many times as long as the bench's."""
NUDGE = 0.02
"""Share of the plunger's cap by which a knot is moved to see what it does."""
CALM = 1e-3
"""Weight of a knot's change, so that knots without effect stay."""


@dataclasses.dataclass(frozen=True)
class Bound:
    """The best that was found, and how the search began."""

    rmse: float
    off_path: float
    begun_rmse: float
    rounds: int


class Problem:
    """One motion on one bench: knots in, residuals and their Jacobian out."""

    def __init__(self, bench: Bench, execution: Execution) -> None:
        self.bench, self.execution = bench, execution
        command = execution.command(bench.dt, bench.tail)
        self.shape, self.tools = command.values.shape, command.channels
        self.places = match(bench.roads, execution.segments)
        duration = self.shape[1] * bench.dt
        self.every = max(1, round(max(KNOT, self.shape[0] * duration / MOST_KNOTS) / bench.dt))
        self.at = np.arange(0, self.shape[1] + self.every, self.every)

    def knots(self, u: Floats) -> Floats:
        """Return the knots, [tool, knot], that come nearest to u[tool, n]: its means around them."""
        reach = self.every // 2
        total = np.concatenate([np.zeros((len(u), 1)), np.cumsum(u, axis=1)], axis=1)
        low = np.clip(self.at - reach, 0, u.shape[1] - 1)
        high = np.clip(self.at + reach + 1, 1, u.shape[1])
        return np.asarray((total[:, high] - total[:, low]) / np.maximum(high - low, 1), dtype=np.float64)

    def signal(self, knots: Floats) -> Floats:
        """Return u[tool, n]."""
        n = np.arange(self.shape[1])
        return np.stack([np.interp(n, self.at, row) for row in knots])

    def residual(self, q: Floats) -> Floats:
        """Return r for the flows q[tool, n]."""
        roads = self.bench.roads
        laid, off = deposit(roads, self.execution, *self.places, Signal(0.0, self.bench.dt, q, self.tools))
        errors = (laid / roads.target - 1.0) / np.sqrt(len(laid))
        return np.append(errors, off / roads.target.sum())

    def flow(self, knots: Floats) -> Floats:
        """Return q[tool, n]."""
        return self.bench.flow(Signal(0.0, self.bench.dt, self.signal(knots), self.tools)).values

    def jacobian(self, knots: Floats, nudge: float) -> tuple[Floats, Floats]:
        """Return r and dr/dknots, [residual, tool x knot]."""
        u, q = self.signal(knots), self.flow(knots)
        base = self.residual(q)
        columns = []
        for channel, tool in enumerate(self.tools):
            plant = self.bench.plants[tool]
            state, done = plant.initial(), 0
            for j, at in enumerate(self.at):
                begin = max(int(at) - self.every, 0)
                if begin > done:
                    state, _ = plant.run(state, u[channel, done:begin], self.bench.dt)
                    done = begin
                moved = knots[channel].copy()
                moved[j] += nudge
                other = q.copy()
                row = np.interp(np.arange(begin, self.shape[1]), self.at, moved)
                _, other[channel, begin:] = plant.run(state, row, self.bench.dt)
                columns.append((self.residual(other) - base) / nudge)
        return base, np.stack(columns, axis=1)


def best_signal(bench: Bench, execution: Execution, start: Floats) -> Bound:
    """Return the bound for a motion, searched for from u = `start` [tool, n], mm^3/s."""
    start = start[:, : start.shape[1] // ROUGH * ROUGH].reshape(len(start), -1, ROUGH).mean(axis=2)
    problem = Problem(dataclasses.replace(bench, dt=ROUGH * bench.dt), execution)
    cap = bench.machine.max_flow
    knots = np.clip(problem.knots(start), -cap, cap)
    best = problem.residual(problem.flow(knots))
    begun, trust, rounds = float(np.sqrt((best[:-1] ** 2).sum())), 0.3 * cap, 0
    J: Floats | None = None
    for _ in range(ROUNDS):
        if J is None:
            _, J = problem.jacobian(knots, NUDGE * cap)
        rounds += 1
        low = np.maximum(-cap - knots.ravel(), -trust) - 1e-9
        high = np.minimum(cap - knots.ravel(), trust) + 1e-9
        rows = np.vstack([J, CALM / cap * np.eye(J.shape[1])])
        step = lsq_linear(rows, np.append(-best, np.zeros(J.shape[1])), (low, high), max_iter=30).x
        moved = knots + np.asarray(step).reshape(knots.shape)
        found = problem.residual(problem.flow(moved))
        if (found**2).sum() < 0.999 * (best**2).sum():
            knots, best, J = moved, found, None
        elif trust < 0.005 * cap:
            break
        else:
            trust *= 0.35
    return Bound(float(np.sqrt((best[:-1] ** 2).sum())), float(best[-1]), begun, rounds)


def measured_bounds(
    cases: Sequence[Case], libraries: Mapping[str, Sequence[BasisSet]], processes: int
) -> list[dict[str, Any]]:
    """Return the bounds of a few cells, for the motion as sliced (begun from whole) and for ours."""
    work = [(cases[number], libraries[cases[number].plant][0]) for number in few(cases)]
    with ProcessPoolExecutor(processes, multiprocessing.get_context("fork")) as pool:
        return [row for rows in pool.map(_bounds, work) for row in rows]


def _bounds(work: tuple[Case, BasisSet]) -> list[dict[str, Any]]:
    case, one = work
    station = Station(case, (), 0)
    bench = station.bench
    moves = read_moves(filtered(case.data, case.machine, one), case.machine, source="the filtered file")
    execution = execute([moves], case.machine, firmware=bench.firmware)
    ours = Outcome("ours", bench.judge(execution), {}, execution, execution.command(bench.dt, bench.tail))
    rows: list[dict[str, Any]] = []
    for motion, begun in (("as sliced", station.tuned("whole", None)), ("ours", ours)):
        assert begun.execution is not None, "both were executed"
        assert begun.command is not None, "both have a signal"
        bound = best_signal(bench, begun.execution, begun.command.values)
        row = {"plant": case.plant, "part": case.part, "motion": motion, "time_s": begun.score.time_s}
        rows.append({**row, f"{begun.name}_rmse": begun.score.rmse, **dataclasses.asdict(bound)})
    return rows
