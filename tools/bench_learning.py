"""The learning bench: how good a first guess for a new material is, and what it saves.

fabathome   real hand calibrations, a material left out at a time (needs the data: GCODECTL_DATA)
operator    simulated materials and a simulated operator, from four starts
starts      simulated materials and the learning loop, from four starts

tools/bench_learning              all of it (some minutes)
tools/bench_learning --quick      fewer materials
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from gcodectl.errors import GcodectlError

sys.path.insert(0, str(Path(__file__).resolve().parent))

from learning_bench import fabathome, guesses, starts
from learning_bench.table import show

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("GCODECTL_DATA") or ROOT.parent / "shared" / "data")
PARTS = ("fabathome", "operator", "starts")
MATERIALS, QUICK_MATERIALS = 24, 8


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--part", choices=PARTS, action="append", help="only this; default: all")
    parser.add_argument("--materials", type=int, help=f"simulated ones (default: {MATERIALS}, quick {QUICK_MATERIALS})")
    parser.add_argument("--seeds", type=int, help="draws of the simulated materials (default: 3, quick 1)")
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument("--quick", action="store_true", help="fewer materials")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    options = parser.parse_args()
    options.materials = options.materials or (QUICK_MATERIALS if options.quick else MATERIALS)
    options.seeds = options.seeds or (1 if options.quick else 3)
    if options.materials < 2 or options.seeds < 1:
        parser.error("it takes two materials and a seed")
    return options


def main() -> None:
    """Run the bench."""
    begun = time.perf_counter()
    options = arguments()
    parts = options.part or list(PARTS)
    cells: list[dict[str, Any]] = []
    rows: list[dict[str, Any]] = []
    if "fabathome" in parts:
        folder = DATA / "fabathome"
        if folder.is_dir():
            real = fabathome.measure(folder, options.seed, options.quick)
            cells, rows = cells + real, rows + fabathome.targets(real)
        else:
            print("bench_learning: no Fab@Home data here; name its folder in GCODECTL_DATA", file=sys.stderr)
    if "operator" in parts:
        seeds = range(options.seed, options.seed + options.seeds)
        simulated = [cell for seed in seeds for cell in guesses.measure(options.materials, seed)]
        cells, rows = cells + simulated, rows + guesses.targets(simulated, options.seed)
    if "starts" in parts:
        seeds = range(options.seed, options.seed + options.seeds)
        learned = [cell for seed in seeds for cell in starts.measure(options.materials, seed)]
        cells, rows = cells + learned, rows + starts.targets(learned, options.seed)
    setting = {
        "parts": parts, "materials": options.materials, "seed": options.seed, "seeds": options.seeds,
        "quick": options.quick, "seconds": time.perf_counter() - begun,
    }  # fmt: skip
    if options.json:
        print(json.dumps({"setting": setting, "targets": rows, "cells": cells}))
    else:
        show(cells, rows)


if __name__ == "__main__":
    try:
        main()
    except (GcodectlError, OSError) as error:
        print(f"bench_learning: {error}", file=sys.stderr)
        sys.exit(getattr(error, "exit_status", 1))
