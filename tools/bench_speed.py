"""The speed bench: how fast and in how much memory are check, tasks, filter and simulate, and how soon do they start?

Inputs are made under build/speed and kept: a sliced file repeated in Z, an arc-rich one, fine curves in 0.1 mm moves, a
paste part. Every run is a process of its own, reading the file and writing to the null device; runs go in turns. What
would take longer than --limit is measured on a smaller input, and says so. This process stays small on purpose: see
speed_bench.inputs.

    tools/bench_speed                       60 MB of each and 500 MB of the first, 3 runs each
    tools/bench_speed --quick               6 and 20 MB, one run each, 4 s a run, fewer cells
    tools/bench_speed --peers               and what pip and Debian can install, on the same file
    tools/bench_speed --profile             where the time of filter with a learned material goes
    tools/bench_speed --only cells --stage check --family real
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from speed_bench.cells import STAGES, Plan, measured_cells
from speed_bench.inputs import FAMILIES, FOLDER
from speed_bench.report import show, targets

from gcodectl.errors import GcodectlError

PARTS = ("cells", "startup", "first-run", "peers", "profile")


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="6 and 20 MB instead of 60 and 500")
    parser.add_argument("--seed", type=int, default=0, help="taken for the benches' sake: nothing here is random")
    parser.add_argument("--sizes", metavar="SMALL,LARGE", help="MB of the inputs")
    parser.add_argument("--repeat", type=int, help="runs of every cell; default: 3, with --quick 1")
    parser.add_argument("--limit", type=float, help="s that a run may take; default: 60, with --quick 4")
    parser.add_argument("--stage", choices=STAGES, action="append", help="this command alone; may be repeated")
    parser.add_argument("--family", choices=[one.name for one in FAMILIES], action="append", help="this input alone")
    parser.add_argument("--peers", action="store_true", help="and other readers of G-code beside it")
    parser.add_argument("--profile", action="store_true", help="and where the time goes")
    parser.add_argument("--only", choices=PARTS, help="this part alone")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the inputs are kept")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    options = parser.parse_args()
    try:
        sizes = [float(one) for one in (options.sizes or ("6,20" if options.quick else "60,500")).split(",")]
        options.small, options.large = sizes
    except ValueError:
        parser.error("--sizes takes two numbers of MB, such as 6,20")
    return options


def plan_of(options: argparse.Namespace) -> Plan:
    """Return what the options ask for."""
    names = tuple(one.name for one in FAMILIES)
    return Plan(
        options.small, options.large, options.repeat or (1 if options.quick else 3),
        options.limit or (4.0 if options.quick else 60.0), tuple(options.family or names),
        tuple(options.stage or STAGES), options.folder.resolve(), not options.quick,
    )  # fmt: skip


def measured(parts: set[str], plan: Plan) -> dict[str, Any]:
    """Measure the parts named."""
    from speed_bench.peers import measured_peers
    from speed_bench.profiling import measured_profile
    from speed_bench.startup import measured_first_run, measured_startup

    cells = measured_cells(plan) if "cells" in parts else []
    startup = measured_startup(plan) if "startup" in parts else []
    first = measured_first_run(plan) if "first-run" in parts else []
    peers = measured_peers(plan, cells) if "peers" in parts else []
    asked = [name for name in plan.stages if name != "simulate"] if len(plan.stages) < len(STAGES) else ["learned"]
    family = plan.families[0]
    profiles = [measured_profile(plan, family, stage) for stage in asked] if "profile" in parts else []
    rows = targets(cells, startup, first)
    return {
        "targets": rows, "cells": cells, "startup": startup, "first_run": first, "peers": peers, "profiles": profiles
    }  # fmt: skip


def main() -> None:
    """Run the bench."""
    options, begun = arguments(), time.perf_counter()
    plan = plan_of(options)
    extra = {name for name in ("peers", "profile") if getattr(options, name)}
    parts = {options.only} if options.only else {"cells", "startup", "first-run"} | extra
    found = measured(parts, plan)
    setting = {
        "small_mb": plan.small, "large_mb": plan.large, "repeat": plan.repeat, "limit_s": plan.limit,
        "quick": options.quick, "seed": options.seed, "cores": os.cpu_count(), "load": os.getloadavg()[0],
        "seconds": time.perf_counter() - begun,
    }  # fmt: skip
    if options.json:
        print(json.dumps({"setting": setting, **found}))
        return
    from speed_bench.profiling import show_profile

    show(found)
    for one in found["profiles"]:
        show_profile(one)
    print(f"{setting['seconds']:.0f} s on {setting['cores']} cores, load {setting['load']:.1f} at the end")


if __name__ == "__main__":
    try:
        main()
    except (GcodectlError, OSError) as error:
        print(f"bench_speed: {error}", file=sys.stderr)
        sys.exit(getattr(error, "exit_status", 1))
