"""One cell: one part on one plant, printed in every way; what was tuned or learned at nominal meets the drifted plant.

    tuned or learned     printed on
    none                 -                                nominal, every corner drawn
    coasting, pa, expert the part itself, nominal plant   nominal, every corner drawn (nothing tuned anew)
    whole                the part itself, nominal plant   nominal, every corner drawn (the same signal again)
    basis, ours          library k: nominal plant,        nominal, the corner of draw k
                         camera noise of seed k           (basis: the first 4 libraries, a corner each)

Drift draw k is one of the corners gain 1 +- 15 %, lag 1 +- 15 %, in an order drawn from the seed: not a spread within
15 % but its ends; every corner weighs the same. `rmse`, `off_path`, `time_s` are at nominal: of one print for what is
deterministic, the mean over the seeds for what was learned. A way that fails is a row that says so, and loses its cell.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from flow_bench.fronts import equal_time, tried_front
from flow_bench.learned import filtered, laws
from gcodectl.errors import GcodectlError
from gcodectl.flow.library import BasisSet
from plant_models.baselines import Outcome, coasting, expert, none, pressure_advance
from plant_models.bench_cases import Case
from plant_models.firmware import execute
from plant_models.gantry import Firmware, Segments, cut
from plant_models.match import match
from plant_models.printing import Bench, set_up
from plant_models.reading import read_moves
from plant_models.score import Score
from plant_models.whole import whole

BASELINES = ("none", "coasting", "pa", "expert", "whole")
LEARNED = {"basis": ("basis", 4), "ours": ("", 1000)}
"""Sequencer of each column that comes from the library (empty: the default), and of how many libraries at most."""
COLUMNS = ("none", "coasting", "pa", "expert", "basis", "ours", "whole")
DRIFT = 0.15
Corner: TypeAlias = tuple[float, float]
"""Gain and lag of a drifted plant, over the nominal one's."""
WHOLE_TRIALS = 31
NUMBERS = ("rmse", "off_path", "time_s")


@dataclasses.dataclass(frozen=True)
class Prints:
    """One way to print: its score at nominal and on the drifted plants."""

    nominal: Score
    drifted: tuple[Score, ...] = ()
    corners: tuple[Corner, ...] = ()
    """Gain and lag of the drifted plants."""


def drift_draws(count: int, seed: int) -> list[Corner]:
    """Return `count` pairs of gain and lag: the four corners of +-15 %, in an order drawn anew every four."""
    corners = [(1 + a * DRIFT, 1 + b * DRIFT) for a in (-1, 1) for b in (-1, 1)]
    rng = np.random.default_rng(seed)
    draws: list[Corner] = []
    while len(draws) < count:
        draws += [corners[i] for i in rng.permutation(4)]
    return draws[:count]


class Station:
    """A case set up to print: benches of the nominal plant and of the drifted ones."""

    def __init__(self, case: Case, draws: Sequence[Corner], seed: int) -> None:
        self.case = case
        self.original: Segments = cut(read_moves(case.data, case.machine, source=case.part), case.machine, Firmware())
        self.bench = set_up(self.original, case.machine, case.plant, seed=seed, flow=case.flow)
        self.draws = list(draws)
        self.drifted: dict[Corner, Bench] = {}
        for gain, lag in dict.fromkeys(self.draws):
            other = set_up(self.original, case.machine, case.plant, seed=seed, flow=case.flow, gain=gain, lag=lag)
            self.drifted[gain, lag] = dataclasses.replace(other, roads=self.bench.roads)

    def tuned(self, name: str, before: Outcome | None) -> Outcome:
        """Return a baseline, tuned on this part and the nominal plant; expert begins where `before`, pa, ended."""
        if name == "expert":
            assert before is not None, "expert begins where pa ended"
            return expert(self.bench, self.original, before)
        if name == "whole":
            return whole(self.bench, self.original, laws(self.bench, self.case.flow), WHOLE_TRIALS)
        make = {"none": none, "coasting": coasting, "pa": pressure_advance}[name]
        return make(self.bench, self.original)

    def learned(
        self, one: BasisSet, sequencer: str, corner: Corner | None = None, quality: float | None = None
    ) -> Prints:
        """Print what the filter makes of the part with one library, at nominal and on the plant of a corner."""
        data = filtered(self.case.data, self.case.machine, one, sequencer, quality)
        moves = read_moves(data, self.case.machine, source="the filtered file")
        execution = execute([moves], self.case.machine, firmware=self.bench.firmware)
        places = match(self.bench.roads, execution.segments)
        corners = () if corner is None else (corner,)
        drifted = tuple(self.drifted[one].judge(execution, places) for one in corners)
        return Prints(self.bench.judge(execution, places), drifted, corners)


def measure(case: Case, libraries: Sequence[BasisSet], draws: Sequence[Corner], seed: int) -> dict[str, Any]:
    """Return a cell: plant, part, and for every column its numbers; `libraries[k]` meets drift draw k."""
    station = Station(case, draws, seed)
    columns: dict[str, dict[str, Any]] = {}
    outcomes: dict[str, Outcome] = {}
    for name in BASELINES:
        begun = time.perf_counter()
        outcome = outcomes[name] = station.tuned(name, outcomes.get("pa"))
        again = tuple(outcome.again(bench) for bench in station.drifted.values())
        columns[name] = {
            **numbers([Prints(outcome.score, again, tuple(station.drifted))]),
            "settings": outcome.settings,
        }
        columns[name]["computed_s"] = time.perf_counter() - begun
    for name, (sequencer, most) in LEARNED.items() if libraries else ():
        columns[name] = _from_libraries(station, libraries[:most], sequencer)
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
            prints.append(station.learned(one, sequencer, station.draws[number]))
    except GcodectlError as error:
        lost = dict.fromkeys((*NUMBERS, *(f"drift_{name}" for name in NUMBERS)))
        return {**lost, "error": str(error), "computed_s": time.perf_counter() - begun}
    return {**numbers(prints), "computed_s": time.perf_counter() - begun}


def numbers(prints: Sequence[Prints]) -> dict[str, Any]:
    """Return the means of the numbers over the prints, 95 % intervals where there are several, and each print's."""
    row: dict[str, Any] = {}
    for name in NUMBERS:
        values = [float(getattr(one.nominal, name)) for one in prints]
        corners: dict[Corner, list[float]] = {}
        for one in prints:
            for corner, score in zip(one.corners, one.drifted, strict=True):
                corners.setdefault(corner, []).append(float(getattr(score, name)))
        row[name] = float(np.mean(values))
        row[f"drift_{name}"] = float(np.mean([np.mean(found) for found in corners.values()])) if corners else None
        if len(values) > 1:
            row[f"{name}_interval"] = interval(values)
            row[f"{name}_seeds"] = values
    row["bias"] = float(np.mean([one.nominal.bias for one in prints]))
    row["worst"] = max((one.nominal.worst for one in prints), key=abs)
    return row


def interval(values: Sequence[float]) -> list[float]:
    """Return the 95 % interval of the mean (Student's t)."""
    from scipy.stats import t

    reach = float(t.ppf(0.975, len(values) - 1)) * float(np.std(values, ddof=1)) / len(values) ** 0.5
    return [float(np.mean(values)) - reach, float(np.mean(values)) + reach]
