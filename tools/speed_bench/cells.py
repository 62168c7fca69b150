"""The cells: every command on every kind of input, each run a process of its own, the runs in turns.

    start     a run on a file of some hundred lines: imports, cached kernels loaded; compiles what is not cached
    probe     a run on PROBE MB: less the start, it tells the rate
    size      the wanted one, or the largest of LADDER that is expected to end within the limit
    measure   repeat x every cell, in turns; medians

A cell that was cut to a smaller input says so (`wanted_mb`, and what the wanted one is expected to take): too slow is a
result. MB/s is of input, over the whole process, start included; `warm_mb_s` is less the start, and none where that is
nearly all of it; `marginal_mb_s`, of the large input, is what it has more than the small one over what it takes longer.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from speed_bench.inputs import FAMILIES, FOLDER, MB, STAR, Family, Input, make_input
from speed_bench.process import Ran, gcodectl, median, run

Cell = dict[str, Any]
PROBE = 0.7
LADDER = (0.0, PROBE, 2.0, 6.0, 20.0, 60.0, 500.0)
"""MB; 0: one copy of the source, whatever its size."""
STAGES = ("check", "tasks", "neutral", "learned", "simulate")
LEFT_OUT = {"tasks": ("arcs", "fine", "paste"), "neutral": ("arcs", "fine")}
"""Where --quick does without a command."""
FINE = {"check": (0, 4)}
"""Exit statuses that are results; 4: the firmware would refuse a line."""


@dataclass(frozen=True)
class Plan:
    """How much is measured."""

    small: float
    """MB of every input."""
    large: float
    """MB of the one that memory is compared on."""
    repeat: int
    limit: float
    """s that one run may be expected to take."""
    families: tuple[str, ...] = tuple(one.name for one in FAMILIES)
    stages: tuple[str, ...] = STAGES
    folder: Path = FOLDER
    whole: bool = True
    """Every command on every input; else tasks and the neutral filter on some of them only."""


@dataclass
class Work:
    """One cell to be: a command on an input of a size."""

    family: Family
    stage: str
    wanted: float
    role: str
    """`small` or `large`."""
    input: Input | None = None
    expected: float = 0.0
    """s that the wanted size would take."""
    lines_out: int = 0
    runs: list[Ran] = field(default_factory=list)


def command(stage: str, family: Family, file: str) -> list[str]:
    """Return what is run for a stage."""
    machine = ("--machine", family.machine)
    return gcodectl(
        *{
            "check": ("check", file, *machine),
            "tasks": ("tasks", file, *machine, "--csv"),
            "neutral": ("filter", file, *machine),
            "learned": ("filter", file, *machine, "--material", family.material),
            "simulate": ("simulate", file, *machine, "--plant", "paste-a"),
        }[stage]
    )


def works(plan: Plan) -> list[Work]:
    """Return what there is to measure: all on all, the first family large as well, simulate on one paste part."""
    found = []
    for family in (one for one in FAMILIES if one.name in plan.families):
        for stage in (one for one in STAGES if one in plan.stages):
            if not plan.whole and family.name in LEFT_OUT.get(stage, ()):
                continue
            if stage != "simulate":
                found.append(Work(family, stage, plan.small, "small"))
                if family is FAMILIES[0]:
                    found.append(Work(family, stage, plan.large, "large"))
            elif family.name == "paste":
                found.append(Work(family, stage, 0.0, "small"))
    return found


def measured_cells(plan: Plan) -> list[Cell]:
    """Measure all that the plan names."""
    todo = works(plan)
    start = cache(lambda machine, stage: _start(plan, machine, stage))
    probe = cache(lambda family, stage: _probe(plan, family, stage, start(family.machine, stage)))
    for number, work in enumerate(todo):
        _say(f"sizing {number + 1} of {len(todo)}: {work.stage}, {work.family.name}")
        _size(work, plan, *probe(work.family, work.stage))
    for turn in range(plan.repeat):
        for number, work in enumerate(todo):
            _say(f"turn {turn + 1} of {plan.repeat}, {number + 1} of {len(todo)}: {work.stage}, {work.family.name}")
            if len(work.runs) > turn:
                continue
            assert work.input is not None
            work.runs.append(run(command(work.stage, work.family, str(work.input.path)), timeout=10 * plan.limit + 60))
    for work in todo:
        if work.family.name == "paste" and work.stage == "learned" and work.input is not None:
            counted = run(command(work.stage, work.family, str(work.input.path)), count=True)
            work.lines_out = counted.lines_out
    cells = [_cell(work, start(work.family.machine, work.stage)) for work in todo]
    for large in (cell for cell in cells if cell["role"] == "large"):
        small = by(cells, family=large["family"], stage=large["stage"], role="small")
        large["marginal_mb_s"] = marginal(small, large)
    return cells


def marginal(small: Cell | None, large: Cell) -> float | None:
    """Return the rate at which the large input's surplus is done, MB/s; None where it takes hardly longer."""
    if small is None or "wall_s" not in large:
        return None
    longer = large["wall_s"] - small["wall_s"]
    return float((large["input_mb"] - small["input_mb"]) / longer) if longer > 0.1 * large["wall_s"] else None


def _start(plan: Plan, machine: str, stage: str) -> float:
    """Return the seconds that a command takes on a file of some hundred lines, when nothing is left to compile."""
    family = next(one for one in FAMILIES if one.machine == machine)
    words = command(stage, family, str(STAR))
    first = run(words)
    runs = [run(words) for _ in range(plan.repeat)] if plan.repeat > 1 or "compiling" in first.said else [first]
    return median([one.wall_s for one in runs])


def _probe(plan: Plan, family: Family, stage: str, start: float) -> tuple[Input, float, Ran]:
    """Return the probe's input, how many seconds a MB of it takes, and the run; one that compiled is run again."""
    one = make_input(family, 0.0 if stage == "simulate" else min(PROBE, plan.small), plan.folder)
    words = command(stage, family, str(one.path))
    ran = run(words)
    if "compiling" in ran.said:
        ran = run(words)
    return one, max(ran.wall_s - start, 0.001) / (one.bytes / MB), ran


def _size(work: Work, plan: Plan, one: Input, seconds_per_mb: float, probe: Ran) -> None:
    """Choose the largest input that the limit allows, and make it; the probe is its first run where it is the same."""
    work.expected = seconds_per_mb * max(work.wanted, one.bytes / MB)
    sizes = {min(size, work.wanted) for size in (*LADDER, work.wanted)}
    chosen = max(size for size in sizes if size <= PROBE or size * seconds_per_mb <= plan.limit)
    work.input = make_input(work.family, chosen, plan.folder)
    if work.input.path == one.path:
        work.runs.append(probe)


def _cell(work: Work, start: float) -> Cell:
    assert work.input is not None
    good = [one for one in work.runs if not one.failure(FINE.get(work.stage, (0,)))]
    cell: Cell = {
        "family": work.family.name, "stage": work.stage, "role": work.role, "input_mb": work.input.bytes / MB,
        "lines": work.input.lines, "wanted_mb": work.wanted, "wanted_s": work.expected,
        "cut": work.input.bytes / MB < 0.8 * work.wanted, "runs": len(work.runs),
    }  # fmt: skip
    failures = [one.failure(FINE.get(work.stage, (0,))) for one in work.runs]
    if not good:
        return {**cell, "error": next(iter(failures), "no run")}
    wall = median([one.wall_s for one in good])
    warm = wall - start
    cell |= {
        "wall_s": wall, "start_s": start, "cpu_s": median([one.cpu_s for one in good]),
        "least_s": min(one.wall_s for one in good), "most_s": max(one.wall_s for one in good),
        "mb_s": cell["input_mb"] / wall,
        "warm_mb_s": cell["input_mb"] / warm if warm > 0.1 * wall else None, "lines_s": work.input.lines / wall,
        "peak_mb": max(one.peak_mb for one in good), "failed": len(work.runs) - len(good),
    }  # fmt: skip
    if work.lines_out:
        cell |= {"lines_out": work.lines_out, "lines_out_s": work.lines_out / wall}
    return cell


def _say(words: str) -> None:
    """Tell a terminal how far it is."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{words}", end="", file=sys.stderr, flush=True)


def by(cells: Sequence[Cell], **wanted: str) -> Cell | None:
    """Return the first cell that has all these values and was measured."""
    for cell in cells:
        if all(cell.get(name) == value for name, value in wanted.items()) and "mb_s" in cell:
            return cell
    return None
