"""Start-up with a warm cache, and the first run after installing: a fresh copy of the source with an empty cache."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

from speed_bench.cells import Plan, command
from speed_bench.inputs import FAMILIES, ROOT, Family, make_input
from speed_bench.process import Ran, gcodectl, median, run

ROUNDS = 7
WORD = "compiling"
"""What the first run says on stderr, and no later one."""


def measured_startup(plan: Plan) -> list[dict[str, Any]]:
    """Time `--help` and `filter` on an empty file, in turns, after one run that warms the caches."""
    plan.folder.mkdir(parents=True, exist_ok=True)
    nothing = plan.folder / "empty.gcode"
    nothing.write_bytes(b"")
    wanted = {
        "gcodectl --help": gcodectl("--help"),
        "filter of an empty file, neutral": command("neutral", FAMILIES[0], str(nothing)),
        "filter of an empty file, learned": command("learned", FAMILIES[0], str(nothing)),
    }
    for words in wanted.values():
        run(words)
    runs: dict[str, list[Ran]] = {name: [] for name in wanted}
    for _ in range(ROUNDS):
        for name, words in wanted.items():
            runs[name].append(run(words))
    return [
        {
            "name": name, "startup_s": median([one.wall_s for one in found]),
            "least_s": min(one.wall_s for one in found), "most_s": max(one.wall_s for one in found),
            "peak_mb": max(one.peak_mb for one in found),
            "error": next((one.failure() for one in found if one.failure()), ""),
        }
        for name, found in runs.items()
    ]  # fmt: skip


def measured_first_run(plan: Plan, family: Family = FAMILIES[1]) -> list[dict[str, Any]]:
    """Filter one copy with arcs and a learned material in a fresh copy of the source, twice: compiling, and not."""
    file = str(make_input(family, 0.0, plan.folder).path)
    with tempfile.TemporaryDirectory() as folder:
        fresh, cache = Path(folder) / "source", Path(folder) / "cache"
        for package in ("gcodectl", "plant_models"):
            shutil.copytree(ROOT / package, fresh / package, ignore=shutil.ignore_patterns("__pycache__"))
        cache.mkdir()
        words = command("learned", family, file)
        first, second = (run(words, root=fresh, environment={"NUMBA_CACHE_DIR": str(cache)}) for _ in range(2))
    return [
        {
            "name": "the first run after installing", "first_s": first.wall_s, "second_s": second.wall_s,
            "compiling_s": first.wall_s - second.wall_s, "says_so": WORD in first.said,
            "says_so_again": WORD in second.said, "peak_mb": first.peak_mb,
            "error": first.failure() or second.failure(),
        }
    ]  # fmt: skip
