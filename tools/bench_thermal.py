"""The thermal bench: does the camera see what the surface is, and do the plans keep it in its band, sooner than fixed?

Four parts, each in its file of `thermal_bench`: camera (frames with the head before the part, tracked for 10 layers),
plans (the published grid by A* and by dynamic programming, and the measured hexagon, where `../shared/data` or
GCODECTL_DATA has it), closed loop (wall and chassis printed layer by layer with plans from fitted forecasts, beside the
fixed policy), drifting (13 layers of a wall whose cooling changes). All on the simulated surface of
`plant_models.cooling`, which no controller sees; 10 seeds, medians with 95 % intervals.

    tools/bench_thermal                  10 seeds
    tools/bench_thermal --quick          2 seeds
    tools/bench_thermal --only camera    or control
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from gcodectl.errors import GcodectlError

sys.path.insert(0, str(Path(__file__).resolve().parent))

from thermal_bench.camera import camera_cells, camera_targets
from thermal_bench.control import control_cells, control_targets

PARTS = {"camera": (camera_cells, camera_targets), "control": (control_cells, control_targets)}


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="2 seeds instead of 10")
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument("--seeds", type=int, help="how many")
    parser.add_argument("--only", choices=tuple(PARTS), help="this part alone")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser.parse_args()


def show(cells: Sequence[dict[str, Any]], rows: Sequence[dict[str, Any]], setting: dict[str, Any]) -> None:
    """Print the targets for people; the cells are in the JSON."""
    console = Console(width=max(Console().width, 130))
    table = Table("target", "asked", "median", "95 % interval", "worst", "", box=None)
    for row in rows:
        low, high = row["interval"]
        table.add_row(
            row["name"], f"{row['target']} {row['unit']}", f"{row['value']:.4g}", f"{low:.4g} to {high:.4g}",
            f"{row['worst']:.4g}", "met" if row["met"] else "MISSED",
        )  # fmt: skip
    console.print(table)
    console.print(
        f"{len(cells)} cells, seeds {setting['seed']} to {setting['seed'] + setting['seeds'] - 1}, "
        f"{setting['seconds']:.0f} s; simulated surface and camera, seconds are of one core"
    )


def main() -> None:
    """Run the bench."""
    options, begun = arguments(), time.perf_counter()
    count = options.seeds or (2 if options.quick else 10)
    seeds = range(options.seed, options.seed + count)
    cells: list[dict[str, Any]] = []
    rows: list[dict[str, Any]] = []
    for name in [options.only] if options.only else PARTS:
        measure, judge = PARTS[name]
        found = measure(seeds)
        cells += [{"bench": name, **cell} for cell in found]
        rows += judge(found)
    setting = {
        "seeds": count, "seed": options.seed, "quick": options.quick, "plant": "plant_models.cooling",
        "seconds": time.perf_counter() - begun,
    }  # fmt: skip
    if options.json:
        print(json.dumps({"setting": setting, "targets": rows, "cells": cells}))
    else:
        show(cells, rows, setting)


if __name__ == "__main__":
    try:
        main()
    except (GcodectlError, OSError) as error:
        print(f"bench_thermal: {error}", file=sys.stderr)
        sys.exit(getattr(error, "exit_status", 1))
