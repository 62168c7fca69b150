"""What everyone does about an extruder's lag, each tuned on the very part it is judged by.

    none      the slicer's file as it is
    coasting  E stops a tuned distance before each road ends (plant_models.coast)
    pa        pressure advance as Klipper does it, smoothing included; advance and flow multiplier tuned
    expert    the same with the print acceleration lowered, out of a list, until the plunger's cap holds; it may lower
              the corner speed too and leave the slicer's retractions out: on a pure first-order plant close to exact,
              paid for with time

Tuned means: rmse + off_path is least. All of them drive the same plunger with the same limits.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import minimize

from gcodectl.columns import Floats
from gcodectl.records import Signal
from plant_models.bead import on_road
from plant_models.coast import coast
from plant_models.firmware import Execution
from plant_models.gantry import E_ONLY, Segments, carry_marks
from plant_models.match import match
from plant_models.printing import Bench
from plant_models.score import Score
from plant_models.score import score as judge

ADVANCES = (0.03, 0.1, 0.3, 1.0, 1.7, 3.0, 5.0)
"""s, where the search for pressure advance begins."""
DISTANCES = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""mm, where the search for coasting begins."""
ACCELERATIONS = (200.0, 100.0, 50.0, 25.0, 15.0, 10.0, 6.0, 4.0)
"""mm/s^2, expert's list."""
CORNER_SPEEDS = (5.0, 0.5)
"""mm/s, expert's list."""
ROUGH = 4
"""The list is searched with samples this many times as long; what is found is judged and tuned on with fine ones."""
REFINED = 3
"""How many of expert's list are tuned on."""


@dataclasses.dataclass(frozen=True)
class Outcome:
    """One way to print the part: its score, and what it was tuned to."""

    name: str
    score: Score
    settings: dict[str, float] = dataclasses.field(default_factory=dict)
    execution: Execution | None = None
    """What was executed, so that it can be printed again on another plant."""
    command: Signal | None = None
    """u where it is not the execution's own."""
    tried: tuple[Score, ...] = ()
    """Scores of everything that was tuned to on the way: a front of error against time."""

    def again(self, bench: Bench) -> Score:
        """Print the same on another bench, nothing tuned anew."""
        assert self.execution is not None, "the outcome was made without its execution"
        if self.command is None:
            return bench.judge(self.execution)
        return judge(bench.roads, self.execution, bench.flow(self.command))


def cost(score: Score) -> float:
    """Return what tuning makes least."""
    return score.rmse + score.off_path


def none(bench: Bench, original: Segments) -> Outcome:
    """Print the file as it is."""
    execution = bench.run(original)
    return Outcome("none", bench.judge(execution), execution=execution)


def coasting(bench: Bench, original: Segments, evaluations: int = 16) -> Outcome:
    """Tune the coasting distance."""

    def trial(values: Sequence[float]) -> Score:
        return bench.judge(bench.run(coast(original, math.exp(values[0]))))

    best, score = _tune(trial, [[math.log(one)] for one in DISTANCES], evaluations)
    plain = none(bench, original)
    if cost(plain.score) <= cost(score):
        return dataclasses.replace(plain, name="coasting", settings={"distance": 0.0})
    distance = math.exp(best[0])
    return Outcome("coasting", score, {"distance": distance}, bench.run(coast(original, distance)))


def pressure_advance(bench: Bench, original: Segments, evaluations: int = 30) -> Outcome:
    """Tune the advance (s) and the flow multiplier."""
    return _advance(bench, original, "pa", _begins(bench, original), evaluations)


def expert(bench: Bench, original: Segments, start: Outcome, evaluations: int = 30) -> Outcome:
    """Tune acceleration, corner speed, retractions, advance and flow; `start` is where `pressure_advance` ended."""
    begins = _begins(bench, original)
    rough = dataclasses.replace(bench, dt=ROUGH * bench.dt)
    found: list[tuple[Outcome, Segments]] = [(start, original)]
    choices = (True, False) if (original.kind == E_ONLY).any() else (True,)
    for accel, corner, kept in itertools.product(ACCELERATIONS, CORNER_SPEEDS, choices):
        slowed = slow(original, accel, corner, kept)
        one = _advance(rough, slowed, "expert", begins, 0)
        one = dataclasses.replace(one, score=one.again(bench))
        settings = {**one.settings, "accel": accel, "corner_speed": corner, "retracts": float(kept)}
        found.append((dataclasses.replace(one, settings=settings), slowed))
    found.sort(key=lambda one: cost(one[0].score))
    outcomes = [start]
    for one, slowed in found[:REFINED]:
        tuned = _advance(rough, slowed, "expert", [_point(one)], evaluations)
        tuned = _advance(bench, slowed, "expert", [_point(one), _point(tuned)], evaluations // 3)
        outcomes.append(dataclasses.replace(tuned, settings={**one.settings, **tuned.settings}))
    best = min(outcomes, key=lambda one: cost(one.score))
    tried = tuple(one.score for one, _ in found) + tuple(one.score for one in outcomes)
    return dataclasses.replace(best, name="expert", tried=tried)


def _point(outcome: Outcome) -> list[float]:
    """Return where in the search an outcome lies."""
    return [math.log(outcome.settings["advance"]), outcome.settings["gain"]]


def _begins(bench: Bench, original: Segments) -> list[list[float]]:
    """Return where the search for advance (its logarithm) and flow begins: at the flow that mends the steady error."""
    steady = 1 + bench.judge(bench.run(original)).median
    return [[math.log(one), 1 / max(steady, 0.2)] for one in ADVANCES]


def slow(original: Segments, accel: float, corner_speed: float, retracts: bool) -> Segments:
    """Lower acceleration on the roads (mm/s^2) and corner speed (mm/s) to these; drop moves of E alone, if asked."""
    slowed = original.replace(
        accel=np.where(on_road(original), np.minimum(original.accel, accel), original.accel),
        corner_speed=np.minimum(original.corner_speed, corner_speed),
    )
    if retracts:
        return slowed
    alone = slowed.kind == E_ONLY
    return slowed.replace(rest=carry_marks(slowed.rest, ~alone), broken=carry_marks(slowed.broken | alone, ~alone))[
        ~alone
    ]


def _advance(bench: Bench, segments: Segments, name: str, begins: list[list[float]], evaluations: int) -> Outcome:
    execution = bench.run(segments)
    places = match(bench.roads, segments)

    def advanced(values: Sequence[float]) -> Execution:
        return dataclasses.replace(execution, pressure_advance=math.exp(values[0]), gain=values[1])

    best, score = _tune(lambda values: bench.judge(advanced(values), places), begins, evaluations)
    return Outcome(name, score, {"advance": math.exp(best[0]), "gain": best[1]}, advanced(best))


def _tune(
    trial: Callable[[Sequence[float]], Score], begins: list[list[float]], evaluations: int
) -> tuple[list[float], Score]:
    """Try all of `begins`, then walk downhill from the best one (Nelder and Mead); returns the best ever seen."""
    seen: list[tuple[float, list[float], Score]] = []

    def objective(values: Floats) -> float:
        point = [float(one) for one in values]
        score = trial(point)
        seen.append((cost(score), point, score))
        return seen[-1][0]

    for begin in begins:
        objective(np.array(begin))
    start = np.array(min(seen, key=lambda one: one[0])[1])
    steps = np.array([0.5, -0.1])[: len(start)]
    if not evaluations:
        return list(start), min(seen, key=lambda one: one[0])[2]
    simplex = np.vstack([start, *(start + np.eye(len(start)) * steps)])
    minimize(
        objective,
        start,
        method="Nelder-Mead",
        options={"maxfev": evaluations, "initial_simplex": simplex, "xatol": 1e-3},
    )
    _, best, score = min(seen, key=lambda one: one[0])
    return best, score
