"""Fab@Home's hand calibrations, a material left out at a time: what a guess is off by, beside the mean's.

Two sets: the 40 files that name their material, and those with the two more that do not. These two are taken as
silicone: their description, tip and numbers are those of the silicone files beside them, and to hold them for another
material would leave silicone in while silicone is left out.

Deposition rate is learned as `inputspeed`: over the road's own width x height x speed, which is the same factor. What
the best learner would have been in hindsight, and how far the hand calibrations of one material are from each other,
bound what can be had from these files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gcodectl.calibrate.calibration import Calibration
from gcodectl.calibrate.evaluation import CHOSEN, Errors, evaluate, known_of
from gcodectl.calibrate.learners import COMMITTEE
from gcodectl.calibrate.toolfile import read_tool
from gcodectl.errors import InputError

Cell = dict[str, Any]
UNNAMED = {"10ccRedTaperLeft", "10ccRedTaperRight"}
SHOWN = {"pushouttime": "pushout", "inputspeed": "deposition rate", "pullbacktime": "suckback"}
DRAWS = 1000


def read_folder(folder: Path, unnamed: bool) -> tuple[list[Calibration], list[str]]:
    """Return the calibrations of a folder of tool files, and what was left out and why."""
    found, refused = [], []
    for file in sorted(folder.glob("*.tool")):
        try:
            found.append(read_tool(file, "silicone" if unnamed and file.stem in UNNAMED else None).calibration)
        except InputError as error:
            refused.append(str(error).replace(f"{folder}/", ""))
    return found, refused


def measure(folder: Path, seed: int, quick: bool) -> list[Cell]:
    """Return a cell a parameter and learner of each set of files; quick: the larger set only."""
    cells = []
    for name, unnamed in (("all pastes", True),) if quick else (("all pastes", True), ("named", False)):
        known, refused = read_folder(folder, unnamed)
        own = {parameter: _own(one.materials, one.y) for parameter, one in known_of(known).items()}
        for one in evaluate(known):
            if one.parameter in SHOWN:
                cells.append({"part": "fabathome", "files": name, "left_out": len(refused), **_cell(one, seed),
                              "repeats": own[one.parameter]})  # fmt: skip
    return cells


def targets(cells: list[Cell]) -> list[Cell]:
    """Return the rows of the targets, with what bounds them."""
    rows = []
    for parameter, most in (("pushouttime", 1.5), ("inputspeed", 1.12)):
        for files in dict.fromkeys(cell["files"] for cell in cells):
            mine = [cell for cell in cells if cell["parameter"] == parameter and cell["files"] == files]
            by = {cell["learner"]: cell["material_out"] for cell in mine}
            (chosen,) = [cell for cell in mine if cell["learner"] == CHOSEN]
            singles = [value for name, value in by.items() if name not in (CHOSEN, COMMITTEE)]
            name = f"Fab@Home ({files}, {chosen['samples']} files): {SHOWN[parameter]}, material left out, median"
            rows.append(
                {"name": name, "value": by[CHOSEN], "unit": "x", "target": f"<= {most:g}", "met": by[CHOSEN] <= most,
                 "interval": chosen["interval"], "mean": by["mean"], "best_in_hindsight": min(singles),
                 "a_material": chosen["over_materials"], "repeats": chosen["repeats"]}
            )  # fmt: skip
    return rows


def _cell(one: Errors, seed: int) -> Cell:
    rng = np.random.default_rng(seed)
    names = sorted(set(one.materials))
    of = {name: one.material_out[[k for k, material in enumerate(one.materials) if material == name]] for name in names}
    drawn = [
        float(np.median(np.concatenate([of[name] for name in rng.choice(names, len(names))]))) for _ in range(DRAWS)
    ]
    low, high = np.exp(np.quantile(drawn, [0.025, 0.975]))
    return {
        "parameter": one.parameter, "learner": one.learner, "samples": len(one.one_out),
        "one_out": one.median(one.one_out), "material_out": one.median(one.material_out),
        "over_materials": one.over_materials(one.material_out), "interval": [float(low), float(high)],
    }  # fmt: skip


def _own(materials: tuple[str, ...], y: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Return how far a calibration is from the mean of its own material's others, median, as a factor."""
    off = []
    for k, name in enumerate(materials):
        others = [j for j, other in enumerate(materials) if other == name and j != k]
        if others:
            off.append(abs(float(y[k] - y[others].mean())))
    return float(np.exp(np.median(off)))
