"""The matrix worked through: libraries first, one a plant and seed, then every cell, two processes at a time.

    plant x seed --learn_library--> libraries --+
    plant x part ------------------------------- measure --> cells, in the order of the cases

A library is learned once for a plant and a seed, whatever the part. Every cell is measured whole in one process, so
that all its columns are compared under the same conditions.
"""

from __future__ import annotations

import dataclasses
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

from flow_bench.cell import drift_draws, measure
from flow_bench.learned import learn_library
from gcodectl.config import Machine
from gcodectl.flow.library import BasisSet
from plant_models.bench_cases import Case

In = TypeVar("In")
Out = TypeVar("Out")
Key = tuple[str, str, float]


@dataclasses.dataclass(frozen=True)
class Plan:
    """How much is measured."""

    seeds: int
    seed: int = 0
    noise: float = 0.1
    """Factor on the measured road widths' noise (0.14 along a road, 0.20 from print to print)."""
    processes: int = 2
    given: BasisSet | None = None
    """A library that is there already; None: learn one a plant and seed."""

    def seeds_used(self) -> range:
        """Return the seeds; a library that is there already has but one."""
        return range(self.seed, self.seed + (self.seeds if self.given is None else 1))


@dataclasses.dataclass(frozen=True)
class _Learn:
    plant: str
    machine: Machine
    flow: float
    seed: int
    noise: float


@dataclasses.dataclass(frozen=True)
class _Cell:
    case: Case
    libraries: tuple[BasisSet, ...]
    seed: int
    draws: int


def run_matrix(cases: Sequence[Case], plan: Plan) -> tuple[list[dict[str, Any]], dict[str, tuple[BasisSet, ...]]]:
    """Return a cell for every case, and the libraries by plant; what is under way is said on stderr."""
    with ProcessPoolExecutor(plan.processes, multiprocessing.get_context("fork")) as pool:
        apply = pool.map if plan.processes > 1 and len(cases) > 1 else map
        libraries = _libraries(cases, plan, apply)
        work = [_Cell(case, libraries[_key(case)], plan.seed, max(plan.seeds, 1)) for case in cases]
        cells: list[dict[str, Any]] = []
        for cell in _counted(apply(_measured, work), len(work), "cells"):
            cells.append(cell)
    return cells, {key[0]: sets for key, sets in libraries.items()}


def _libraries(
    cases: Sequence[Case], plan: Plan, apply: Callable[..., Iterator[BasisSet]]
) -> dict[Key, tuple[BasisSet, ...]]:
    keys = {_key(case): case for case in cases}
    if plan.given is not None:
        return dict.fromkeys(keys, (plan.given,))
    seeds = list(plan.seeds_used())
    work = [_Learn(case.plant, case.machine, case.flow, seed, plan.noise) for case in keys.values() for seed in seeds]
    learned = list(_counted(apply(_learned, work), len(work), "libraries"))
    return {key: tuple(learned[i * len(seeds) : (i + 1) * len(seeds)]) for i, key in enumerate(keys)}


def _key(case: Case) -> Key:
    return case.plant, case.machine.name, case.flow


def _learned(work: _Learn) -> BasisSet:
    return learn_library(work.plant, work.machine, work.flow, work.seed, work.noise)


def _measured(work: _Cell) -> dict[str, Any]:
    begun = time.perf_counter()
    cell = measure(work.case, work.libraries, drift_draws(work.draws, work.seed), work.seed)
    return {**cell, "computed_s": time.perf_counter() - begun}


def _counted(results: Iterator[Out], total: int, what: str) -> Iterator[Out]:
    """Hand results on, saying every now and then how many there are."""
    begun = last = time.monotonic()
    for number, one in enumerate(results, 1):
        yield one
        now = time.monotonic()
        if now - last > 10 or number == total:
            print(f"bench_flow: {number} of {total} {what}, {now - begun:.0f} s", file=sys.stderr)
            last = now
