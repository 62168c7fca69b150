"""The learning bench: how good a first guess is and what it saves, how far learning on a machine comes, and by photos.

fabathome       real hand calibrations, a material left out at a time (needs the data: GCODECTL_DATA)
operator        simulated materials and a simulated operator, from four starts
starts          simulated materials and the learning loop, from four starts
loop            learn start, next, finish on the virtual printer, and the library that gives
photographs     strips of simulated extruders, photographed and measured
photo-session   whole sessions by photographs

tools/bench_learning              all of it (half an hour)
tools/bench_learning --quick      less of each
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from gcodectl.errors import GcodectlError

sys.path.insert(0, str(Path(__file__).resolve().parent))

from learning_bench import fabathome, guesses, loop, photo_session, photographs, starts
from learning_bench.table import show

ROOT = Path(__file__).resolve().parent.parent
DATA = Path(os.environ.get("GCODECTL_DATA") or ROOT.parent / "shared" / "data")
MATERIALS, QUICK_MATERIALS = 24, 8
PHOTOGRAPHS, QUICK_PHOTOGRAPHS = 12, 3
"""Of each nozzle."""
Rows: TypeAlias = list[dict[str, Any]]


def _fabathome(options: argparse.Namespace) -> tuple[Rows, Rows]:
    folder = DATA / "fabathome"
    if not folder.is_dir():
        print("bench_learning: no Fab@Home data here; name its folder in GCODECTL_DATA", file=sys.stderr)
        return [], []
    cells = fabathome.measure(folder, options.seed, options.quick)
    return cells, fabathome.targets(cells)


def _operator(options: argparse.Namespace) -> tuple[Rows, Rows]:
    cells = [cell for seed in _seeds(options) for cell in guesses.measure(options.materials, seed)]
    return cells, guesses.targets(cells, options.seed)


def _starts(options: argparse.Namespace) -> tuple[Rows, Rows]:
    cells = [cell for seed in _seeds(options) for cell in starts.measure(options.materials, seed)]
    return cells, starts.targets(cells, options.seed)


def _loop(options: argparse.Namespace) -> tuple[Rows, Rows]:
    cells = loop.measure(_seeds(options), options.quick)
    return cells, loop.targets(cells)


def _photographs(options: argparse.Namespace) -> tuple[Rows, Rows]:
    count = QUICK_PHOTOGRAPHS if options.quick else PHOTOGRAPHS
    cells = photographs.measure(count, options.seed, options.quick)
    return cells, photographs.targets(cells)


def _photo_session(options: argparse.Namespace) -> tuple[Rows, Rows]:
    cells = photo_session.measure(_seeds(options), options.quick)
    return cells, photo_session.targets(cells)


PARTS: Mapping[str, Callable[[argparse.Namespace], tuple[Rows, Rows]]] = {
    "fabathome": _fabathome,
    "operator": _operator,
    "starts": _starts,
    "loop": _loop,
    "photographs": _photographs,
    "photo-session": _photo_session,
}
"""What makes each part's cells, and the rows of its targets."""


def _seeds(options: argparse.Namespace) -> range:
    return range(options.seed, options.seed + options.seeds)


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--part", choices=PARTS, action="append", help="only this; default: all")
    parser.add_argument("--materials", type=int, help=f"simulated ones (default: {MATERIALS}, quick {QUICK_MATERIALS})")
    parser.add_argument("--seeds", type=int, help="draws of all that is simulated (default: 3, quick 1)")
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument("--quick", action="store_true", help="less of each")
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
    parts = [name for name in PARTS if not options.part or name in options.part]
    cells: Rows = []
    rows: Rows = []
    for name in parts:
        measured, targets = PARTS[name](options)
        cells, rows = cells + measured, rows + targets
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
