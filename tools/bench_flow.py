"""The flow bench: every baseline beside the library's signals, on every plant and part: how good is the bead, and when?

Columns: none, coasting, pa, expert (see plant_models.baselines), basis (the paper's concatenation of basis signals),
ours (gcodectl's filter as it comes), whole (learning control on this very part, 31 trials: what a library gives up).
All drive the same plunger with the same limits. Each has rmse, off_path and time_s: never one without the other.

Design. Rows are the cases of plant_models.bench_cases (12 plants, 14 to 16 parts each), or what --plant and --gcode
name. The baselines are deterministic for a plant, so each is tuned once a cell, on the part itself and the plant at its
nominal parameters, and what was tuned is printed there and on every drift draw (the ends of +-15 % in gain and lag).
Libraries are learned at nominal, at most 10 trials of one routine under camera noise, one a plant and seed, used on
every part; library k is printed at nominal and on drift draw k, by both of its columns. So the seeds vary the noise,
the drift and, for plants that have it, the day; intervals are over them. Two processes share the cells.

    tools/bench_flow                          the matrix, 10 seeds (4 of them: 11 minutes on 2 cores)
    tools/bench_flow --quick                  four plants, four parts, 2 seeds; with --gcode the first 3 layers
    tools/bench_flow --plant my.py:Extruder   every part of --machine on one's own plant
    tools/bench_flow --gcode part.gcode       one part on --plant (paste-a); both may come several times
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from gcodectl.config import load_machine
from gcodectl.errors import GcodectlError, UsageError
from gcodectl.flow.library import BasisSet, builtin_libraries, load_library
from plant_models.bench_cases import PLANTS, SHOPS, STRUCTURES, Case, cases, shop_parts
from plant_models.gantry import Firmware, cut
from plant_models.plant import load_plant
from plant_models.printing import capped, nominal_flow
from plant_models.reading import first_layers, read_moves

sys.path.insert(0, str(Path(__file__).resolve().parent))

from flow_bench.bound import measured_bounds
from flow_bench.fronts import measured_fronts
from flow_bench.learned import MAX_TRIALS
from flow_bench.matrix import Plan, run_matrix
from flow_bench.table import show, show_bounds
from flow_bench.targets import summary, targets, worse_than_pa

ROOT = Path(__file__).resolve().parent.parent
STAR = ROOT / "tests" / "data" / "star_rel.gcode"
QUICK_LAYERS = 3
QUICK_PLANTS = ("paste-a", "syringe-mid", "syringe-dead", "melt-bowden")
QUICK_PARTS = ("short-travels", "dots", "star", "mixed-speeds")
QUICK_SEEDS = 2


def choose(options: argparse.Namespace) -> list[Case]:
    """Return what is to be printed on what."""
    if options.gcode:
        plants = options.plant or ["paste-a"]
        return [_given(part, plant, options) for plant in plants for part in options.gcode]
    corpus = os.environ.get("GCODECTL_CORPUS")
    names = tuple(options.plant or (QUICK_PLANTS if options.quick else tuple(one.name for one in PLANTS)))
    folder = Path(corpus) if corpus else None
    found = cases(tuple(name for name in names if name in STRUCTURES), options.cap, folder, STAR)
    for name in names:
        found += [] if name in STRUCTURES else _own_plant(name, options, folder)
    return [case for case in found if not options.quick or case.part in QUICK_PARTS]


def _own_plant(plant: str, options: argparse.Namespace, corpus: Path | None) -> list[Case]:
    """Return the parts of --machine on a plant that is not in the bench's table."""
    if options.machine not in SHOPS:
        raise UsageError(f"the bench draws no parts for the machine {options.machine!r}: please give them with --gcode")
    shop = SHOPS[options.machine]
    load_plant(plant, flow=shop.flow)  # an unknown one must fail before anything is measured
    machine = capped(load_machine(shop.machine), shop.flow, options.cap)
    parts = shop_parts(shop, corpus, STAR)
    return [Case(plant, "own", part, data, machine, shop.flow) for part, data in parts.items()]


def _given(part: Path, plant: str, options: argparse.Namespace) -> Case:
    """Return a file on a plant that is made for that file's nominal flow."""
    machine, data = load_machine(options.machine), part.read_bytes()
    if options.quick:
        data = first_layers(data, read_moves(data, machine, source=str(part)), QUICK_LAYERS)
    flow = nominal_flow(cut(read_moves(data, machine, source=str(part)), machine, Firmware()))
    load_plant(plant, flow=flow)
    return Case(plant, STRUCTURES.get(plant, "own"), part.name, data, capped(machine, flow, options.cap), flow)


def given_library(options: argparse.Namespace) -> BasisSet | None:
    """Return the basis set that --material and --library name; None: one is learned for every plant."""
    if options.material is None and options.library is None:
        return None
    nozzle = load_machine(options.machine).nozzle
    if options.library is None:
        known = builtin_libraries()
        if options.material not in known:
            raise UsageError(f"there is no built-in material {options.material!r}; there are {', '.join(known)}")
        return load_library(known[options.material]).find(options.material, nozzle)
    library = load_library(options.library)
    return library.find(options.material or library.sets[0].material, nozzle)


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--gcode", type=Path, action="append", help="a part; default: those of the bench")
    parser.add_argument("--plant", action="append", help="a name, or path/to/file.py:Attribute; default: all of them")
    parser.add_argument("--machine", default="syringe", help="of --gcode, and of plants that the bench does not know")
    parser.add_argument("--material", help="use this material's signals; default: learn them on the plant")
    parser.add_argument("--library", type=Path, help="library file with that material; default: the built-in one")
    parser.add_argument("--cap", type=float, default=5.0, help="plunger cap, as a multiple of the nominal flow")
    parser.add_argument("--seeds", type=int, help="how many; default: 10, with --quick 2")
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument(
        "--noise", type=float, default=0.1, help="of the camera, times that of the measured road widths"
    )
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="a small matrix; of --gcode, the first layers only")
    parser.add_argument("--bound", action="store_true", help="and the best signal there is, for a few cells (minutes)")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="write flow_bench.png here")
    options = parser.parse_args()
    if options.seeds is None:
        options.seeds = QUICK_SEEDS if options.quick else 10
    if options.seeds < 1 or options.processes < 1:
        parser.error("--seeds and --processes must be at least 1")
    return options


def main() -> None:
    """Run the bench."""
    begun = time.perf_counter()
    options = arguments()
    given = given_library(options)
    work = choose(options)
    plan = Plan(options.seeds, options.seed, options.noise, options.processes, given)
    cells, libraries = run_matrix(work, plan)
    trials = [int(one.training.get("trials", 0)) for sets in libraries.values() for one in sets]
    rows = targets(cells, max(trials, default=0))
    fronts = measured_fronts(work, libraries, cells)
    bounds = measured_bounds(work, libraries, options.processes) if options.bound else []
    setting: dict[str, Any] = {
        "plants": list(dict.fromkeys(case.plant for case in work)),
        "parts": list(dict.fromkeys(case.part for case in work)), "cap": options.cap, "seed": options.seed,
        "seeds": len(plan.seeds_used()), "noise": options.noise, "max_trials": MAX_TRIALS, "quick": options.quick,
        "library": given.key if given else "learned", "seconds": time.perf_counter() - begun,
    }  # fmt: skip
    if options.output:
        from gcodectl.report.bench import plot_bench

        options.output.mkdir(parents=True, exist_ok=True)
        plot_bench(options.output / "flow_bench.png", cells, fronts)
    if options.json:
        found = {"summary": summary(cells), "worse_than_pa": worse_than_pa(cells), "fronts": fronts, "bounds": bounds}
        print(json.dumps({"setting": setting, "targets": rows, **found, "cells": cells}))
    else:
        show(cells, setting, rows)
        show_bounds(bounds)


if __name__ == "__main__":
    try:
        main()
    except (GcodectlError, OSError) as error:
        print(f"bench_flow: {error}", file=sys.stderr)
        sys.exit(getattr(error, "exit_status", 1))
