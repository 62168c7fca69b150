"""One cell: one part on one plant, printed in every way; what was tuned or learned at nominal meets the drifted plant.

    tuned or learned     printed on
    none                 -                                nominal, every drift draw
    coasting, pa, expert the part itself, nominal plant   nominal, every drift draw (nothing tuned anew)
    whole                the part itself, nominal plant   nominal, every drift draw (the same signal again)
    basis, ours          library k: nominal plant,        nominal, drift draw k
                         camera noise of seed k

Drift draw k is one of the corners gain 1 +- 15 %, lag 1 +- 15 %, in an order drawn from the seed: not a spread within
15 % but its ends. `rmse`, `off_path`, `time_s` are at nominal: of one print for what is deterministic, the mean over
the seeds for what was learned. A way that fails is a row that says so, and loses its cell.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from flow_bench.fronts import equal_time, tried_front
from flow_bench.learned import filtered, laws
from gcodectl.errors import GcodectlError
from gcodectl.flow.library import BasisSet
from plant_models.baselines import Outcome, coasting, expert, none, pressure_advance
from plant_models.bench_cases import Case
from plant_models.firmware import execute
from plant_models.gantry import Firmware, Segments, cut
from plant_models.printing import Bench, set_up
from plant_models.reading import read_moves
from plant_models.score import Score
from plant_models.whole import whole

BASELINES = ("none", "coasting", "pa", "expert", "whole")
LEARNED = {"basis": "basis", "ours": ""}
"""Sequencer of each column that comes from the library; empty: gcodectl's default."""
COLUMNS = ("none", "coasting", "pa", "expert", "basis", "ours", "whole")
DRIFT = 0.15
WHOLE_TRIALS = 31
NUMBERS = ("rmse", "off_path", "time_s")


@dataclasses.dataclass(frozen=True)
class Prints:
    """One way to print: its score at nominal and on the drifted plants."""

    nominal: Score
    drifted: tuple[Score, ...] = ()


def drift_draws(count: int, seed: int) -> list[tuple[float, float]]:
    """Return `count` pairs of gain and lag: the four corners of +-15 %, in an order drawn anew every four."""
    corners = [(1 + a * DRIFT, 1 + b * DRIFT) for a in (-1, 1) for b in (-1, 1)]
    rng = np.random.default_rng(seed)
    draws: list[tuple[float, float]] = []
    while len(draws) < count:
        draws += [corners[i] for i in rng.permutation(4)]
    return draws[:count]


class Station:
    """A case set up to print: benches of the nominal plant and of the drifted ones."""

    def __init__(self, case: Case, draws: Sequence[tuple[float, float]], seed: int) -> None:
        self.case = case
        self.original: Segments = cut(read_moves(case.data, case.machine, source=case.part), case.machine, Firmware())
        self.bench = set_up(self.original, case.machine, case.plant, seed=seed, flow=case.flow)
        others = [
            set_up(self.original, case.machine, case.plant, seed=seed, flow=case.flow, gain=gain, lag=lag)
            for gain, lag in draws
        ]
        self.drifted: list[Bench] = [dataclasses.replace(one, roads=self.bench.roads) for one in others]

    def tuned(self, name: str, before: Outcome | None) -> Outcome:
        """Return a baseline, tuned on this part and the nominal plant; expert begins where `before`, pa, ended."""
        if name == "expert":
            assert before is not None, "expert begins where pa ended"
            return expert(self.bench, self.original, before)
        if name == "whole":
            return whole(self.bench, self.original, laws(self.bench, self.case.flow), WHOLE_TRIALS)
        make = {"none": none, "coasting": coasting, "pa": pressure_advance}[name]
        return make(self.bench, self.original)

    def learned(self, one: BasisSet, sequencer: str, drifted: Sequence[Bench], quality: float | None = None) -> Prints:
        """Print what the filter makes of the part with one library."""
        data = filtered(self.case.data, self.case.machine, one, sequencer, quality)
        moves = read_moves(data, self.case.machine, source="the filtered file")
        execution = execute([moves], self.case.machine, firmware=self.bench.firmware)
        return Prints(self.bench.judge(execution), tuple(bench.judge(execution) for bench in drifted))


def measure(
    case: Case, libraries: Sequence[BasisSet], draws: Sequence[tuple[float, float]], seed: int
) -> dict[str, Any]:
    """Return a cell: plant, part, and for every column its numbers; `libraries[k]` meets drift draw k."""
    station = Station(case, draws, seed)
    columns: dict[str, dict[str, Any]] = {}
    outcomes: dict[str, Outcome] = {}
    for name in BASELINES:
        begun = time.perf_counter()
        outcome = outcomes[name] = station.tuned(name, outcomes.get("pa"))
        again = tuple(outcome.again(bench) for bench in station.drifted)
        columns[name] = {**numbers([Prints(outcome.score, again)]), "settings": outcome.settings}
        columns[name]["computed_s"] = time.perf_counter() - begun
    for name, sequencer in LEARNED.items() if libraries else ():
        columns[name] = _from_libraries(station, libraries, sequencer)
    cell: dict[str, Any] = {"plant": case.plant, "structure": case.structure, "part": case.part}
    cell |= {"machine": case.machine.name, "max_flow": case.machine.max_flow, "flow": case.flow}
    cell["columns"] = {name: columns[name] for name in COLUMNS if name in columns}
    front = tried_front(outcomes["expert"].tried)
    cell["expert_front"] = front
    if libraries and columns["ours"]["rmse"] is not None:
        cell["expert_at_equal_time"] = equal_time(front, columns["ours"]["time_s"])
    return cell


def _from_libraries(station: Station, libraries: Sequence[BasisSet], sequencer: str) -> dict[str, Any]:
    begun = time.perf_counter()
    prints: list[Prints] = []
    try:
        for number, one in enumerate(libraries):
            prints.append(station.learned(one, sequencer, station.drifted[number : number + 1]))
    except GcodectlError as error:
        lost = dict.fromkeys((*NUMBERS, *(f"drift_{name}" for name in NUMBERS)))
        return {**lost, "error": str(error), "computed_s": time.perf_counter() - begun}
    return {**numbers(prints), "computed_s": time.perf_counter() - begun}


def numbers(prints: Sequence[Prints]) -> dict[str, Any]:
    """Return the means of the numbers over the prints, 95 % intervals where there are several, and each print's."""
    row: dict[str, Any] = {}
    for name in NUMBERS:
        values = [float(getattr(one.nominal, name)) for one in prints]
        drifted = [float(getattr(score, name)) for one in prints for score in one.drifted]
        row[name] = float(np.mean(values))
        row[f"drift_{name}"] = float(np.mean(drifted)) if drifted else None
        if len(values) > 1:
            row[f"{name}_interval"] = interval(values)
            row[f"{name}_seeds"] = values
        if name == "rmse" and len(drifted) > 1:
            row["drift_rmse_seeds"] = drifted
    row["bias"] = float(np.mean([one.nominal.bias for one in prints]))
    row["worst"] = max((one.nominal.worst for one in prints), key=abs)
    return row


def interval(values: Sequence[float]) -> list[float]:
    """Return the 95 % interval of the mean (Student's t)."""
    from scipy.stats import t

    reach = float(t.ppf(0.975, len(values) - 1)) * float(np.std(values, ddof=1)) / len(values) ** 0.5
    return [float(np.mean(values)) - reach, float(np.mean(values)) + reach]
