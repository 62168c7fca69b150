"""A part that PrusaSlicer sliced for a syringe: filtered, printed before and after on a simulated paste, and scored.

Writes DIR (build/demo): before.gcode, after.gcode, before_after.png, the pictures of both prints, and flow_bench.png
with every baseline.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PART = ROOT / "tests" / "data" / "star_rel.gcode"
MACHINE, MATERIAL, PLANT = "syringe", "clay", "syringe"


def say(words: list[str]) -> None:
    """Run a command of this environment, and show it as a person would type it."""
    print("$ " + " ".join(words), flush=True)
    program = [sys.executable, "-m", "gcodectl.cli.main"] if words[0] == "gcodectl" else [sys.executable, words[0]]
    done = subprocess.run([*program, *words[1:]], cwd=ROOT, check=False)
    if done.returncode:
        sys.exit(done.returncode)


def picture(before: Path, after: Path, path: Path) -> None:
    """Draw the bead error of both prints, layer by layer, the one above the other."""
    import numpy as np

    from gcodectl.config import load_machine
    from gcodectl.report.part import plot_part
    from plant_models.bead import pieces
    from plant_models.gantry import Firmware, cut
    from plant_models.printing import set_up
    from plant_models.reading import read_moves
    from plant_models.score import bin_errors

    machine = load_machine(MACHINE)
    bench = set_up(cut(read_moves(before.read_bytes(), machine), machine, Firmware()), machine, PLANT)
    p0, p1, of_bin, layer = pieces(bench.roads)
    layers = np.unique(layer)[:3]
    few = np.isin(layer, layers)
    errors, panels = [], []
    names: dict[int, str] = {}
    for row, (name, file) in enumerate((("as sliced", before), ("filtered", after))):
        execution = bench.run(cut(read_moves(file.read_bytes(), machine), machine, Firmware()))
        errors.append(bin_errors(bench.roads, execution, bench.printed(execution)[1])[0][of_bin][few])
        panels.append(np.searchsorted(layers, layer[few]) + row * len(layers))
        names |= {int(k) + row * len(layers): f"{name}, layer {number}" for k, number in enumerate(layers)}
    plot_part(
        path, np.concatenate([p0[few], p0[few]]), np.concatenate([p1[few], p1[few]]), np.concatenate(errors),
        np.concatenate(panels), names=names, columns=len(layers), width=machine.nozzle,
    )  # fmt: skip


def shown(path: Path) -> str:
    """Return a path as seen from the project's root where it lies in it."""
    return str(path.relative_to(ROOT) if path.is_relative_to(ROOT) else path)


def main() -> None:
    """Run the demo."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("part", nargs="?", type=Path, default=PART, help="G-code for a syringe printer")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", default=ROOT / "build" / "demo")
    options = parser.parse_args()
    folder = options.output.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    before, after = folder / "before.gcode", folder / "after.gcode"
    shutil.copyfile(options.part, before)
    say(["gcodectl", "filter", shown(before), "-o", shown(after), "--machine", MACHINE, "--material", MATERIAL])
    on = ["--machine", MACHINE, "--plant", PLANT]
    say(["gcodectl", "simulate", shown(before), *on, "--plot", shown(folder / "before")])
    target = ["--target", shown(before), "--material", MATERIAL]
    say(["gcodectl", "simulate", shown(after), *target, *on, "--plot", shown(folder / "after")])
    say(["tools/bench_flow.py", "--gcode", shown(before), "--plant", PLANT, "--seeds", "2", "-o", shown(folder)])
    picture(before, after, folder / "before_after.png")
    print(
        f"\nlook at {shown(folder)}: " + ", ".join(sorted(str(one.relative_to(folder)) for one in folder.rglob("*.*")))
    )


if __name__ == "__main__":
    main()
