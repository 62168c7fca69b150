"""Train the basis signal libraries that ship with gcodectl: one file a material in gcodectl/data/libraries.

The same code, plants and versions give the same bytes: the date is that of the last commit to what training runs
(or `--date`), never today's.
"""

from __future__ import annotations

import argparse
import dataclasses
import subprocess
import sys
from pathlib import Path

from gcodectl.config import load_machine
from gcodectl.flow.library import Library, save_library
from gcodectl.learn.training import finish, prepare
from gcodectl.learn.trials import run_trials
from plant_models.trial import as_extruder

HERE = Path(__file__).resolve().parent.parent
FOLDER = HERE / "gcodectl" / "data" / "libraries"


@dataclasses.dataclass(frozen=True)
class Recipe:
    """One material: the plant that stands for it, its machine, nozzle (mm) and nominal flow (mm^3/s)."""

    material: str
    plant: str
    machine: str
    nozzle: float
    flow: float


RECIPES = (
    Recipe("paste-a", "paste-a", "syringe", 0.84, 5.0),
    Recipe("paste-b", "paste-b", "syringe", 0.84, 5.0),
    Recipe("clay", "syringe", "syringe", 0.84, 5.0),
    Recipe("clay-slow", "syringe-slow", "syringe", 0.84, 5.0),
    Recipe("silicone", "pneumatic", "syringe", 0.84, 5.0),
    Recipe("filament", "melt", "filament", 0.4, 8.0),
    Recipe("filament-bowden", "melt-bowden", "filament", 0.4, 8.0),
    Recipe("pellet", "pellet", "pellet", 5.0, 1500.0),
)


def train(recipe: Recipe, seed: int, date: str) -> Library:
    """Return the library of one material."""
    extruder = as_extruder(recipe.plant, seed=seed, flow=recipe.flow)
    setup = prepare(extruder, load_machine(recipe.machine), nozzle=recipe.nozzle, flow=recipe.flow)
    trials = list(run_trials(extruder, setup.learner))
    made_by = {"plant": recipe.plant, "seed": seed}
    one = finish(setup, material=recipe.material, nozzle=recipe.nozzle, made_by=made_by, date=date)
    ratio = setup.learner.best.rms / trials[0].rms
    print(f"{one.key:22} {len(trials):3} trials  rms {ratio:.3f} of trial 0  {setup.learner.stop}", file=sys.stderr)
    return Library((one,))


def commit_date() -> str:
    """Return the date of the last commit to the code that training runs, YYYY-MM-DD."""
    what = ["gcodectl/learn", "gcodectl/flow/limits.py", "gcodectl/data/machines", "plant_models"]
    done = subprocess.run(
        ["git", "log", "-1", "--format=%cs", "--", *what], cwd=HERE, capture_output=True, text=True, check=False
    )
    date = done.stdout.strip()
    if done.returncode or not date:
        sys.exit("train_libraries: this is no git checkout with a history: please give --date YYYY-MM-DD")
    return date


def main() -> None:
    """Train every material, or the ones named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("materials", nargs="*", help="which materials (default: all)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the plants' randomness")
    parser.add_argument("--date", help="date for the record, YYYY-MM-DD (default: the last commit's)")
    parser.add_argument("-o", "--output", type=Path, default=FOLDER, help="folder to write to")
    arguments = parser.parse_args()
    names = {recipe.material: recipe for recipe in RECIPES}
    unknown = [name for name in arguments.materials if name not in names]
    if unknown:
        parser.error(f"no such material as {', '.join(unknown)}; there are {', '.join(names)}")
    date = arguments.date or commit_date()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for name in arguments.materials or names:
        save_library(train(names[name], arguments.seed, date), arguments.output / f"{name}.npz")


if __name__ == "__main__":
    main()
