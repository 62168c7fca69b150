"""Refine: search a coarse lattice over all that is possible, then finer ones around what was found.

    time
      |  . . . . . . .        1  coarse: TIMES x SPEEDS nodes a border, over every time a border can be passed at
      |  . . .:o:.o. .        2  finer by FACTOR, REACH speeds and REACH_TIME times to either side of the way found
      |  . .:o: . . .         3  again from there while it helps; then finer
      +---------------- border

A coarse lattice rounds times, so it may shut out what is just allowed: `opens` and `shuts` are moved apart by what
      |  . .:o: . . .         3  again from there while it helps; then finer
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from gcodectl.columns import Floats
from gcodectl.thermal.dynamic import Route
from gcodectl.thermal.graph import Graph, Lattice, graph
from gcodectl.thermal.problem import Problem, drive

TIMES = 241
SPEEDS = 26
FACTOR = 4
REACH = 6
REACH_TIME = 16
TRIES = 8
"""Searches at one step, at most."""
PRECISE = 1e-2
"""Of the first step of time: polishing does the rest."""

Finder = Callable[[Graph], Route]
Measure = Callable[[Problem, Floats, Floats], float]
"""What a plan costs, by its borders' and its locations' times; inf: it is not allowed."""


@dataclasses.dataclass(frozen=True)
class Found:
    """A plan."""

    cost: float
    start: float
    speeds: Floats
    border: Floats
    times: Floats


def start_range(problem: Problem, earliest: float) -> tuple[float, float]:
    """Return between which times a plan begins, if it is any good; s.

    Before the first, every location is met before it opens, at whatever speed; after the last, every location is
    colder than best (or has come to rest), so that an earlier start is better for all.
    """
    slow, fast = ways(problem)
    before = np.where(np.isfinite(problem.opens), problem.opens, problem.t0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(problem.lift > 0.0, -problem.under / problem.lift, 1.0)
    best = problem.t0 + np.log(np.clip(share, 1e-3, 1.0)) / problem.b1
    low = max(float(np.min(before - slow)), earliest)
    high = float(np.max(np.maximum(best, before) - fast))
    return low, max(low, high)


def ways(problem: Problem) -> tuple[Floats, Floats]:
    """Longest and shortest time from the start to each location, s."""
    counts = np.diff(problem.first)
    found = []
    for speed in (problem.slowest, problem.fastest):
        before = np.cumsum(problem.pause + problem.length / speed) - problem.length / speed
        found.append(np.repeat(before, counts) + problem.way / np.repeat(speed, counts))
    return found[0], found[1]


def whole_lattice(problem: Problem, earliest: float, times: int = TIMES, speeds: int = SPEEDS) -> Lattice:
    """Return the coarse lattice over all that is possible."""
    low, high = start_range(problem, earliest)
    first = low + np.concatenate(([0.0], np.cumsum(problem.pause + problem.length / problem.fastest)))
    last = high + np.concatenate(([0.0], np.cumsum(problem.pause + problem.length / problem.slowest)))
    step = max(float(np.max(last - first)) / (times - 2), 1e-6)
    slowest, fastest = float(problem.slowest.min()), float(problem.fastest.max())
    n = len(problem.length)
    return Lattice(
        time_base=low, time_step=step, time_first=np.floor((first - low) / step).astype(np.int64), times=times,
        speed_base=slowest, speed_step=(fastest - slowest) / (speeds - 1) or 1.0,
        speed_first=np.zeros(n + 1, dtype=np.int64), speeds=speeds if fastest > slowest else 1,
    )  # fmt: skip


def around(problem: Problem, coarse: Lattice, found: Found, factor: int) -> Lattice:
    """Return a lattice finer by `factor`, with REACH speeds and REACH_TIME times or more to either side."""
    step, speed_step = coarse.time_step / factor, coarse.speed_step / factor
    half, speed_half = max(REACH_TIME, FACTOR * (len(problem.length) + 1) // 2 + FACTOR), REACH
    centre = np.round((found.border - coarse.time_base) / step).astype(np.int64)
    came = problem.entry if not math.isnan(problem.entry) else found.speeds[0]
    speeds = np.round((np.append(came, found.speeds) - coarse.speed_base) / speed_step).astype(np.int64)
    first = centre - half
    first[0] = max(first[0], 0)
    return Lattice(
        time_base=coarse.time_base, time_step=step, time_first=first, times=2 * half + 1, speed_base=coarse.speed_base,
        speed_step=speed_step, speed_first=speeds - speed_half, speeds=2 * speed_half + 1,
    )  # fmt: skip


def loosened(problem: Problem, lattice: Lattice) -> Problem:
    """Return the problem with its windows wider by what rounding can amount to."""
    slack = np.repeat(np.arange(1, len(problem.length) + 1) * 0.5 * lattice.time_step, np.diff(problem.first))
    return dataclasses.replace(problem, opens=problem.opens - slack, shuts=problem.shuts + slack)


def refine(
    problem: Problem, earliest: float, finder: Finder, measure: Measure, precise: float = PRECISE
) -> Found | None:
    """Return the best plan, to a step of time `precise` times the first, or None if there is none."""
    lattice = whole_lattice(problem, earliest)
    smallest = precise * lattice.time_step
    found = _search(problem, lattice, finder, measure)
    if found is None:
        return None
    while lattice.time_step > smallest:
        factor = FACTOR
        best: Found | None = None
        for _ in range(TRIES):
            finer = around(problem, lattice, found, factor)
            lattice, factor = finer, 1
            tried = _search(problem, lattice, finder, measure)
            if tried is None or (best is not None and tried.cost >= best.cost - 1e-9 * abs(best.cost)):
                break
            best = found = tried
        if best is None:  # what rounding let through is not there on a finer lattice: as near as this one comes
            break
    return found


def _search(problem: Problem, lattice: Lattice, finder: Finder, measure: Measure) -> Found | None:
    """Return the best plan on a lattice, measured exactly."""
    route = finder(graph(loosened(problem, lattice), lattice))
    if not math.isfinite(route.cost):
        return None
    border, times = drive(problem, route.start, route.speeds)
    return Found(measure(problem, border, times), route.start, route.speeds, border, times)
