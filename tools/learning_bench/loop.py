"""The learning loop on the virtual printer: how far a session comes, and is its library as good as `learn run`'s?

    session --> trial-NN.gcode --> virtual firmware, plunger, plant --> bead along the path, noisy --> session ...
                                                                                                |
        true error: the same print's flow without noise, which the learner never sees           +--> library
    learn run: the same plant and noise, as often, no printer between  ----------------------------> library
                                                                            both filter parts that neither has seen

What the plunger's cap leaves of the error is not the loop's to reach: `bound` searches for the least rms of the flow on
the true plant, and the same session without noise shows what is reached of it.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeAlias

import numpy as np
from flow_bench.cell import Station
from flow_bench.learned import MAX_TRIALS, learn_library

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.errors import GcodectlError
from gcodectl.flow.library import BasisSet
from gcodectl.learn.reference import Routine
from gcodectl.session.checking import resample
from gcodectl.session.measured import Series
from gcodectl.session.record import Session
from gcodectl.session.steps import advance, begin, library, take
from learning_bench.bound import least_rms, problem_of
from learning_bench.weights import taken, weight_of
from plant_models.bead import bin_width
from plant_models.bench_cases import STRUCTURES, Case, cases
from plant_models.noise import ROAD_WIDTHS
from plant_models.plant import load_plant
from plant_models.recorded import record

Cell = dict[str, Any]
Measure: TypeAlias = Callable[[Session, Floats, Floats], Series]
"""What is measured of a print of a session, of whose bead the places, mm, and cross-sections there, mm^2, are given."""
WEIGHED = 1000
"""More prints than any session has."""
PLANTS = (
    "paste-a", "syringe-fast", "syringe-mid", "syringe-dead", "syringe-backlash", "pneumatic", "melt", "pellet",
)  # fmt: skip
PARTS = ("fig9", "short-travels", "comb")
CAP = 5.0
"""Nominal flows that the plunger can do, as in the flow bench."""
NOISE = 0.1
"""Factor on the measured road widths' noise (0.14 along a road, 0.20 from print to print), as in the flow bench."""
STEP = 0.25
"""Nozzles between two places that are measured."""
RATIO, AS_GOOD = 0.15, 1.10


@dataclasses.dataclass(frozen=True)
class Work:
    """One plant and seed."""

    cases: tuple[Case, ...]
    seed: int
    bounded: bool
    """Whether to search for the least rms that is possible."""


@dataclasses.dataclass(frozen=True)
class Course:
    """A session that was run to its end."""

    true: tuple[float, ...]
    """rms of the flow's error without noise, mm^3/s, trial by trial."""
    beads: tuple[float, ...]
    """rmse of the bead, likewise."""
    best: int
    stop: str
    learned: BasisSet | None
    session: Session
    u: Floats
    """The best trial's signal."""


def measure(seeds: Sequence[int], quick: bool) -> list[Cell]:
    """Return a cell a plant and seed; quick: three plants."""
    names = PLANTS[1:8:3] if quick else PLANTS
    all_cases = cases(names, CAP, None)
    work = [
        Work(tuple(one for one in all_cases if one.plant == name and one.part in PARTS), seed, seed == seeds[0])
        for name in names
        for seed in seeds
    ]
    with ProcessPoolExecutor(2, multiprocessing.get_context("fork")) as pool:
        return list(pool.map(_cell, work))


def targets(cells: Sequence[Cell]) -> list[Cell]:
    """Return the rows of the targets."""
    if not cells:
        return []
    plants = list(dict.fromkeys(cell["plant"] for cell in cells))
    of = {name: [cell for cell in cells if cell["plant"] == name] for name in plants}
    ratio = {name: float(np.median([cell["ratio"] for cell in mine])) for name, mine in of.items()}
    bound = {name: float(np.median([cell["bound"] for cell in mine])) for name, mine in of.items()}
    flow = {name: float(np.median([cell["flow_ratio"] for cell in mine])) for name, mine in of.items()}
    least = {cell["plant"]: cell["least"] for cell in cells if cell["least"] is not None}
    reached = sum(value <= RATIO for value in ratio.values())
    good = {name: [cell for cell in mine if cell["rmse"] is not None] for name, mine in of.items()}
    beside = {
        name: float(np.mean([cell["rmse"] for cell in mine]) / np.mean([cell["rmse_of_run"] for cell in mine]))
        for name, mine in good.items()
        if mine
    }
    middle = float(np.median(list(beside.values()))) if beside else float("inf")
    return [
        {"name": "loop: plants whose rmse falls to 0.15 of trial 0's within 10 trials, median over seeds",
         "value": reached, "unit": f"of {len(plants)}", "target": f"{len(plants)}", "met": reached == len(plants),
         "ratio": ratio, "without_noise": bound, "flow_over_time": flow,
         "least_flow_over_time": least},
        {"name": "loop: its library on unseen parts, mean rmse over that of `learn run`'s, median over plants",
         "value": middle, "unit": "x", "target": f"<= {AS_GOOD:g}", "met": middle <= AS_GOOD, "by_plant": beside,
         "failed": sum(cell["rmse"] is None for cell in cells)},
    ]  # fmt: skip


def with_noise(noise: float, seed: int) -> Measure:
    """Return what measures areas as a camera does that rides along."""
    rng = np.random.default_rng([seed, 7])

    def measured(now: Session, places: Floats, area: Floats) -> Series:
        if noise:
            area = area * np.maximum(1.0 + ROAD_WIDTHS.scaled(noise).along(places, rng), 0.0)
        return Series("s,area", places, area, source=f"trial {len(now.measured)}")

    return measured


def run_session(case: Case, seed: int, measured: Measure, weighed: int = 0) -> Course:
    """Run a session on a plant to its end; the first `weighed` of its prints are weighed, too."""
    machine = case.machine
    now = begin(
        machine, material=case.plant, flow=case.flow, max_trials=MAX_TRIALS, gcode=("G28", ""), date="2026-01-01"
    )
    true: list[float] = []
    beads: list[float] = []
    while True:
        places, area = _print(now, case, machine, seed)
        q = _flow(now, places, area)
        routine = now.setup.routine
        beads.append(bead_error(q, routine, bin_width(machine.nozzle)))
        true.append(float(np.sqrt(np.mean((q - routine.q_ref) ** 2))))
        plant = load_plant(case.plant, seed=seed + 1, flow=case.flow)
        series = measured(now, places, area)
        if len(now.measured) < weighed:
            now = taken(now, series, weight_of(now, plant, seed))
        else:
            now = take(now, None, [series], anyway=True)
        now, setup = advance(now)
        if setup.learner.stop is not None:
            break
    try:
        learned = library(now)[0]
    except GcodectlError:
        learned = None
    best = setup.learner.best
    return Course(tuple(true), tuple(beads), best.number, str(setup.learner.stop), learned, now, best.u)


def _print(now: Session, case: Case, machine: Machine, seed: int) -> tuple[Floats, Floats]:
    trial, printout = now.trials[-1], now.setup.printout
    data = printout.gcode(f"trial {trial.number}", trial.u, now.setup.routine.dt)
    plant = load_plant(case.plant, seed=seed + 1, flow=case.flow)
    return record(data, machine, plant, printout.layout.path).areas(STEP * machine.nozzle)


def _flow(now: Session, places: Floats, area: Floats) -> Floats:
    """Return the flow that really was, mm^3/s, on the routine's samples."""
    return resample(Series("s,area", places, area), now.setup.routine, now.setup.printout.layout.speed, 1.0)


def bead_error(q: Floats, routine: Routine, width: float) -> float:
    """Return rmse as prints are scored: of what lies in bins of about `width` mm of the routine's roads, less 1.

    The routine's own motion counts, in which the head stands while nothing is to flow: what flows then lies on no road,
    but for the corner's pause.
    """
    edges = np.arange(len(q) + 1) * routine.dt
    volume = np.concatenate([[0.0], np.cumsum(np.maximum(q, 0.0)) * routine.dt])
    path = np.concatenate([[0.0], np.cumsum(routine.v) * routine.dt])
    errors = []
    for starts, stops, _ in routine.roads:
        first, last = round(starts / routine.dt), round(stops / routine.dt)
        bins = max(1, round(float(path[last] - path[first]) / width))
        borders = np.linspace(path[first], path[last], bins + 1)
        # a tilt by nothing, so that a place where the head stands is one place
        times = np.interp(borders, path[first : last + 1] + 1e-9 * edges[first : last + 1], edges[first : last + 1])
        laid = np.diff(np.interp(times, edges, volume))
        errors.append(laid / (np.diff(borders) * routine.flow / routine.speed) - 1.0)
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _cell(work: Work) -> Cell:
    case = work.cases[0]
    noisy, clean = (run_session(case, work.seed, with_noise(noise, work.seed)) for noise in (NOISE, 0.0))
    own = learn_library(case.plant, case.machine, case.flow, work.seed, NOISE)
    rmse = None if noisy.learned is None else rmse_on_parts(work.cases, noisy.learned, work.seed)
    return {
        "part": "loop", "plant": case.plant, "structure": STRUCTURES[case.plant], "seed": work.seed, "noise": NOISE,
        "trials": len(noisy.true), "best": noisy.best, "stop": noisy.stop,
        "true": [value / noisy.true[0] for value in noisy.true],
        "flow_ratio": noisy.true[noisy.best] / noisy.true[0], "flow_bound": min(clean.true) / clean.true[0],
        "beads": [value / noisy.beads[0] for value in noisy.beads],
        "least": _least(case, work.seed, clean) if work.bounded else None,
        "ratio": noisy.beads[noisy.best] / noisy.beads[0], "bound": min(clean.beads) / clean.beads[0],
        "structure_found": noisy.learned.model.structure if noisy.learned and noisy.learned.model else None,
        "rmse": rmse, "rmse_of_run": rmse_on_parts(work.cases, own, work.seed),
    }  # fmt: skip


def _least(case: Case, seed: int, clean: Course) -> float:
    """Return the least rms of the flow that any signal gives, of trial 0's; see `bound`."""
    problem = problem_of(clean.session, load_plant(case.plant, seed=seed + 1, flow=case.flow))
    off = least_rms(problem, clean.u) - problem.reference
    return float(np.sqrt(np.mean(off**2))) / clean.true[0]


def rmse_on_parts(cases_of_plant: Sequence[Case], one: BasisSet, seed: int) -> float:
    """Return the median rmse over the parts, filtered with a library."""
    return float(np.median([Station(case, [], seed).learned(one, "").nominal.rmse for case in cases_of_plant]))
