"""The link bench: does every command arrive exactly once whatever goes wrong, how fast, and does the planner starve?

Four parts, each in its file of `link_bench`: faults (host against virtual printer under a virtual clock, thousands of
commands, seeds), throughput (a pty, beside a bare pyserial loop, in turns), load (of a stream at 500 lines a second),
starving (a file filtered on its way, at 115200 baud). With --peers the hosts that were there first print to the same
virtual printer with the same faults at line 150; they are installed into build/peers (tools/peers.sh).

    tools/bench_link              10,000 commands, 20 seeds
    tools/bench_link --quick      1,000 commands, 3 seeds
    tools/bench_link --only faults
    tools/bench_link --peers      and the table against OctoPrint, printcore, pronsole, marlin-host, mecode
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

from link_bench.faults import measured_faults
from link_bench.report import show, targets
from link_bench.starving import measured_starving
from link_bench.throughput import measured_load, measured_throughput

ROOT = Path(__file__).resolve().parent.parent
OWN_PART = ROOT / "tests" / "data" / "star_rel.gcode"
PARTS = ("throughput", "starving", "faults", "peers")
LINKS = ((115_200.0, 0.001, 1), (115_200.0, 0.004, 1), (115_200.0, 0.016, 1), (115_200.0, 0.016, 4))
"""Baud, seconds each way (USB serial chips take 1 to 16 ms), window."""


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer seeds, shorter jobs")
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--gcode", type=Path, help="the part that is filtered on its way (default: paste_cube)")
    parser.add_argument("--peers", action="store_true", help="and the table against other hosts (minutes)")
    parser.add_argument("--only", choices=PARTS, help="this part alone")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser.parse_args()


def part(options: argparse.Namespace) -> Path:
    """Return the part to stream: the one asked for, the corpus' paste_cube, or our own star."""
    if options.gcode:
        return Path(options.gcode)
    cube = Path(os.environ.get("GCODECTL_CORPUS", ROOT.parent / "shared" / "corpus")) / "paste_cube_prusaslicer.gcode"
    return cube if cube.exists() and not options.quick else OWN_PART


def main() -> None:
    """Run the bench."""
    options, begun = arguments(), time.perf_counter()
    seeds, commands = (3, 1_000) if options.quick else (20, 10_000)
    parts = {options.only} if options.only else {*PARTS} - (set() if options.peers else {"peers"})
    file = part(options)
    cells: list[dict[str, Any]] = []
    if "throughput" in parts:
        rounds, lines = (3, 4_000) if options.quick else (7, 20_000)
        cells += [*measured_throughput(rounds, lines), measured_load(4.0 if options.quick else 20.0)]
    if "starving" in parts:
        measured_starving(OWN_PART, "syringe", "paste-a", baud=115_200.0, latency=0.001, window=1)  # compiles
        for baud, latency, window in LINKS:
            cells.append(measured_starving(file, "syringe", "paste-a", baud=baud, latency=latency, window=window))
    if "faults" in parts:
        for window, number in ((1, seeds), (4, max(seeds // 5, 1))):
            cells += measured_faults(number, commands, window, options.processes, options.seed)
    if "peers" in parts:
        from link_bench.against import measured_peers

        cells += measured_peers()
    rows = targets(cells)
    setting = {
        "seeds": seeds, "seed": options.seed, "commands": commands, "part": file.name, "quick": options.quick,
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
        print(f"bench_link: {error}", file=sys.stderr)
        sys.exit(getattr(error, "exit_status", 1))
