"""Where the time of a command goes: cProfile, own time by stage (a file of gcodectl is one), kernels apart from Python.

What calls a kernel's machine code bears the kernel's name (`kernels.native`), so cProfile and py-spy see every kernel
that Python calls; a kernel inside a kernel counts to the outer one. cProfile slows Python down and kernels not, so the
Python share is too high rather than too low.
"""

from __future__ import annotations

import pstats
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from speed_bench.cells import Plan, command
from speed_bench.inputs import FAMILIES, ROOT, make_input
from speed_bench.process import run

TOP = 15
LARGEST = 6.0
"""MB; more tells nothing else."""


def measured_profile(plan: Plan, family: str = "real", stage: str = "learned") -> dict[str, Any]:
    """Profile one command on a family's input, of LARGEST MB at most."""
    chosen = next(one for one in FAMILIES if one.name == family)
    file = make_input(chosen, min(plan.small, LARGEST), plan.folder)
    words = command(stage, chosen, str(file.path))
    run(words)
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "told"
        ran = run([words[0], "-m", "cProfile", "-o", str(told), *words[1:]])
        if not told.exists():
            return {"family": family, "stage": stage, "error": ran.failure() or "cProfile wrote nothing"}
        found = summed(pstats.Stats(str(told)))
    sampled = _sampled(words) if shutil.which("py-spy") else []
    return {"family": family, "stage": stage, "input": file.path.name, **found, "py_spy": sampled}


def summed(stats: pstats.Stats) -> dict[str, Any]:
    """Return own time by stage, and the TOP functions of each that takes more than a hundredth."""
    rows: list[dict[str, Any]] = []
    for (path, line, name), (_, calls, own, whole, _) in stats.stats.items():  # type: ignore[attr-defined]
        where = stage_of(path)
        rows.append({"where": where, "name": f"{name}:{line}", "calls": calls, "own_s": own, "all_s": whole})
    total = sum(row["own_s"] for row in rows)
    stages = []
    for where in {row["where"] for row in rows}:
        mine = sorted((row for row in rows if row["where"] == where), key=lambda row: -row["own_s"])
        own = sum(row["own_s"] for row in mine)
        kernels = sum(row["own_s"] for row in mine if is_kernel(row["name"]))
        if own > 0.01 * total:
            top = [row for row in mine[:TOP] if row["own_s"] > 0.001 * total]
            stages.append({"where": where, "own_s": own, "share": own / total, "kernels_s": kernels, "top": top})
    return {"total_s": total, "stages": sorted(stages, key=lambda one: -one["own_s"])}


def stage_of(path: str) -> str:
    """Name the stage that a source file belongs to: a file of this repository, or a package it uses."""
    place = Path(path)
    if place.is_absolute() and place.is_relative_to(ROOT):
        return str(place.relative_to(ROOT).with_suffix(""))
    parts = place.parts
    if "site-packages" in parts:
        return parts[parts.index("site-packages") + 1]
    return "built in" if path in ("~", "") else "Python's library"


def is_kernel(name: str) -> bool:
    """Whether a function is compiled: the house's kernels are named so."""
    return name.partition(":")[0].endswith("_kernel")


def _sampled(words: list[str]) -> list[str]:
    """Return py-spy's most frequent leaves: how many samples, and where."""
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "told"
        spy = ["py-spy", "record", "--format", "raw", "--rate", "200", "--output", str(told), "--", *words]
        subprocess.run(spy, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False, cwd=ROOT)
        if not told.exists():
            return ["py-spy was not allowed to look"]
        counts: dict[str, int] = {}
        for line in told.read_text().splitlines():
            stack, _, count = line.rpartition(" ")
            leaf = stack.rpartition(";")[2]
            counts[leaf] = counts.get(leaf, 0) + int(count)
    return [f"{count} {leaf}" for leaf, count in sorted(counts.items(), key=lambda one: -one[1])[:TOP]]


def show_profile(found: dict[str, Any]) -> None:
    """Print where the time went, as text."""
    if "error" in found:
        print(f"profile of {found['stage']}, {found['family']}: {found['error']}")
        return
    print(f"profile of {found['stage']} on {found['input']}: {found['total_s']:.2f} s under cProfile")
    for one in found["stages"]:
        python = one["own_s"] - one["kernels_s"]
        print(f"  {one['share']:6.1%}  {one['where']}: Python {python:.2f} s, kernels {one['kernels_s']:.2f} s")
        for row in one["top"]:
            print(f"          {row['own_s']:8.3f} s own, {row['all_s']:8.3f} s all, {row['calls']:>9} x {row['name']}")
    for line in found["py_spy"]:
        print(f"  py-spy: {line}")
    sys.stdout.flush()
