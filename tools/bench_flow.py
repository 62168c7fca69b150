"""Every baseline beside the library's signals, on one part and one extruder: how good is the bead, and at what time?

none, coasting, pa, expert (see plant_models.baselines), whole (learning control on this very part, what a library gives
up), basis (the paper's concatenation of basis signals) and ours (gcodectl's filter as it comes: superposition of the
same signals). All drive the same plunger with the same limits; the rows that win are shown too.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.table import Table

from gcodectl.config import Machine, load_machine
from gcodectl.errors import GcodectlError, UsageError
from gcodectl.flow.library import builtin_libraries, load_library
from gcodectl.flow.limits import within_limits
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import identify_by_step
from gcodectl.pipeline import Options, filter_bytes
from plant_models.baselines import Outcome, coasting, expert, none, pressure_advance
from plant_models.firmware import execute
from plant_models.gantry import Firmware, cut
from plant_models.plant import Plant
from plant_models.printing import Bench, capped, nominal_flow, set_up
from plant_models.reading import first_layers, read_moves
from plant_models.whole import Update, whole

ROOT = Path(__file__).resolve().parent.parent
PART = "paste_cube_prusaslicer.gcode"
QUICK_LAYERS = 3
TRIALS = 31


def trained_on(plant: str) -> str:
    """Return the built-in material that was trained on a plant; the plant's own name where there is none."""
    for name, path in builtin_libraries().items():
        if any(one.training.get("plant") == plant for one in load_library(path).sets):
            return name
    return plant


def learned(material: str, library: Path | None) -> Callable[[Machine, str], Callable[[bytes], bytes]] | None:
    """Return what makes gcodectl's filter for a machine and a sequencer; None without a library for the material."""
    path = library or builtin_libraries().get(material)
    if path is None:
        return None

    def make(machine: Machine, sequencer: str) -> Callable[[bytes], bytes]:
        options = Options(machine, (load_library(path).find(material, machine.nozzle),), sequencer=sequencer)
        return lambda data: filter_bytes(data, options)

    return make


def laws(bench: Bench, flow: float) -> dict[int, Update]:
    """Return a learning law for every tool, its model identified from a step of the plant."""

    def law_of(plant: Plant) -> Update:
        law = Law(identify_by_step(lambda u, dt: plant.run(plant.initial(), u, dt)[1], flow, 0.01), bench.dt)
        flow_limit, slew = bench.machine.max_flow, bench.machine.max_flow_slew
        return lambda u, error: within_limits(law.update(u, error), flow_limit, slew, bench.dt)

    return {tool: law_of(plant) for tool, plant in bench.plants.items()}


def printed(name: str, bench: Bench, data: bytes, filtered: Callable[[bytes], bytes]) -> Outcome:
    """Print what `filtered` makes of the file's bytes."""
    moves = read_moves(filtered(data), bench.machine, source="the filtered file")
    return Outcome(name, bench.judge(execute([moves], bench.machine, firmware=bench.firmware)))


def compare(
    data: bytes,
    machine: Machine,
    plant: str,
    cap: float,
    seed: int,
    filtered: Callable[[Machine, str], Callable[[bytes], bytes]] | None,
) -> tuple[list[dict[str, object]], dict[str, object]]:
    """Print the part in every way; returns a cell a row, and the setting."""
    moves = read_moves(data, machine, source="the part")
    flow = nominal_flow(cut(moves, machine, Firmware()))
    machine = capped(machine, flow, cap)
    original = cut(moves, machine, Firmware())
    bench = set_up(original, machine, plant, seed=seed)
    cells: list[dict[str, object]] = []

    def add(make: Callable[[], Outcome]) -> Outcome:
        begun = time.perf_counter()
        with Console(stderr=True).status(f"{len(cells)} rows done"):  # says nothing where stderr is no terminal
            outcome = make()
        took = time.perf_counter() - begun
        cells.append({"baseline": outcome.name, **outcome.score.table(), **outcome.settings, "computed_s": took})
        return outcome

    add(lambda: none(bench, original))
    add(lambda: coasting(bench, original))
    advanced = add(lambda: pressure_advance(bench, original))
    add(lambda: expert(bench, original, advanced))
    add(lambda: whole(bench, original, laws(bench, flow), TRIALS))
    if filtered is not None:
        add(lambda: printed("basis", bench, data, filtered(machine, "basis")))
        add(lambda: printed("ours", bench, data, filtered(machine, "superpose")))
    return cells, {"nominal_flow": flow, "max_flow": machine.max_flow, "dt": bench.dt, "tail": bench.tail}


def targets(cells: list[dict[str, object]]) -> list[dict[str, object]]:
    """Return the targets: ours against none; empty where ours was not run."""
    by_name = {str(cell["baseline"]): cell for cell in cells}
    if "ours" not in by_name:
        return []
    rows: list[dict[str, object]] = []
    for column in ("rmse", "off_path"):
        share = float(str(by_name["ours"][column])) / float(str(by_name["none"][column]))
        rows.append(
            {
                "name": f"{column} of ours over none",
                "value": share,
                "unit": "1",
                "target": "<= 0.5",
                "met": share <= 0.5,
            }
        )
    return rows


def find_part(given: Path | None) -> Path:
    """Return the G-code to print: the one given, the corpus's paste cube, or a file of the tests."""
    if given is not None:
        return given
    corpus = os.environ.get("GCODECTL_CORPUS")
    places = [Path(corpus) / PART] if corpus else []
    places += [ROOT / "tests" / "data" / PART, *sorted((ROOT / "tests" / "data").glob("**/*.gcode"))]
    for place in places:
        if place.is_file():
            return place
    raise UsageError("no part to print: give one with --gcode, or set GCODECTL_CORPUS to the folder of test files")


def show(cells: list[dict[str, object]], setting: dict[str, object], rows: list[dict[str, object]]) -> None:
    """Print the table for people."""
    table = Table(title=f"{setting['gcode']} on {setting['plant']}, plunger <= {setting['max_flow']:.1f} mm^3/s")
    for heading in ("baseline", "rmse", "off_path", "time_s", "bias", "worst", "tuned to"):
        table.add_column(heading, justify="left" if heading in ("baseline", "tuned to") else "right")
    known = {"baseline", "computed_s", *(one for one in cells[0] if one not in ("distance", "advance"))}
    for cell in cells:
        tuned = ", ".join(f"{name} {value:.3g}" for name, value in cell.items() if name not in known)
        numbers = [f"{cell[name]:.4f}" for name in ("rmse", "off_path")]
        table.add_row(
            str(cell["baseline"]),
            *numbers,
            f"{cell['time_s']:.1f}",
            f"{cell['bias']:+.4f}",
            f"{cell['worst']:+.2f}",
            tuned,
        )
    console = Console()
    console.print(table)
    for row in rows:
        console.print(
            f"{'met   ' if row['met'] else 'MISSED'} {row['name']}: {row['value']:.3f} (target {row['target']})"
        )


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--gcode", type=Path, help=f"the part; default: {PART} of the corpus")
    parser.add_argument("--material", help="whose basis signals the filter uses; default: the one trained on the plant")
    parser.add_argument("--library", type=Path, help="library file with that material; default: the built-in one")
    parser.add_argument("--machine", default="syringe")
    parser.add_argument("--plant", default="paste-a", help="a name, or path/to/file.py:Attribute")
    parser.add_argument("--cap", type=float, default=5.0, help="plunger cap, as a multiple of the nominal flow")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help=f"the first {QUICK_LAYERS} layers only")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="write flow_bench.png here")
    return parser.parse_args()


def main() -> None:
    """Run the bench."""
    options = arguments()
    machine, part = load_machine(options.machine), find_part(options.gcode)
    data = part.read_bytes()
    if options.quick:
        data = first_layers(data, read_moves(data, machine, source=str(part)), QUICK_LAYERS)
    material = options.material or trained_on(options.plant)
    filtered = learned(material, options.library)
    if filtered is None:
        names = ", ".join(builtin_libraries())
        print(
            f"bench_flow: no library for {material!r}, so no 'basis', no 'ours'; give --material ({names})",
            file=sys.stderr,
        )
    cells, setting = compare(data, machine, options.plant, options.cap, options.seed, filtered)
    setting = {
        "gcode": part.name, "plant": options.plant, "material": material, "machine": machine.name, "cap": options.cap,
        "seed": options.seed, "quick": options.quick, **setting,
    }  # fmt: skip
    rows = targets(cells)
    if options.output:
        from gcodectl.report.rows import plot_rows

        options.output.mkdir(parents=True, exist_ok=True)
        plot_rows(options.output / "flow_bench.png", cells, title=f"{part.name} on {options.plant}")
    if options.json:
        print(json.dumps({"setting": setting, "targets": rows, "cells": cells}))
    else:
        show(cells, setting, rows)


if __name__ == "__main__":
    try:
        main()
    except (GcodectlError, OSError) as error:
        print(f"bench_flow: {error}", file=sys.stderr)
        sys.exit(getattr(error, "exit_status", 1))
