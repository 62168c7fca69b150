"""Whole sessions by photographs: every trial printed on the virtual printer, rendered, photographed, measured, learned.

    session --> trial-NN.gcode --> virtual firmware, plant --> bead --> photograph, a view a trial --> widths --> ...

The error of a photograph is measured minus true width over the nominal one, rms over the strip. What learning makes of
such widths is judged as in the loop: rmse of the routine without noise, of trial 0's, beside a session that sees all,
and beside sessions by photographs whose prints are weighed, all of them or the first one only.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.session.measured import Series
from gcodectl.session.photographs import sheet_of, widths_in
from gcodectl.session.record import Session
from learning_bench.loop import CAP, PARTS, WEIGHED, rmse_on_parts, run_session, with_noise
from learning_bench.photographs import strip_of
from plant_models.bench_cases import cases
from plant_models.photo_scene import another_view, draw_scene
from plant_models.photograph import photograph

Cell = dict[str, Any]
PLANTS = ("syringe-mid", "pneumatic", "melt", "pellet")
MOST = 0.05
FIRST = 20_000
"""The scenes' first seed: none of those that the measuring was designed with."""


@dataclasses.dataclass
class Camera:
    """Photographs every print of a session, from elsewhere each time, and keeps how wrong the widths are."""

    seed: int
    errors: list[float] = dataclasses.field(default_factory=list)

    def measured(self, now: Session, places: Floats, area: Floats) -> Series:
        """Return the widths that the photograph of a print shows."""
        strip, sheet = strip_of(now, places, area), sheet_of(now.setup.printout.layout, now.setup.nozzle)
        own = FIRST + 100 * self.seed
        image = photograph(strip, sheet, another_view(draw_scene(own), own + len(self.errors)))
        found = widths_in(now, [(f"photograph {len(self.errors)}", image)])
        error = (found.width - np.interp(found.s, strip.s, strip.width)) / strip.nominal
        self.errors.append(float(np.sqrt(np.nanmean(error**2))))
        return Series(
            "s,width", found.s, found.width, source=f"photograph {len(self.errors)}", notes=found.notes, by="photo"
        )


def measure(seeds: Sequence[int], quick: bool) -> list[Cell]:
    """Return a cell a plant and seed; quick: the first plant."""
    return [_cell(plant, seed) for plant in (PLANTS[:1] if quick else PLANTS) for seed in seeds]


def targets(cells: Sequence[Cell]) -> list[Cell]:
    """Return the row of the target."""
    errors = [error for cell in cells for error in cell["widths"]]
    middle = float(np.median(errors)) if errors else float("inf")
    return [
        {"name": "sessions by photographs: width, rms over the nominal width, median over photographs", "value": middle,
         "unit": "of 1", "target": f"<= {MOST:g}", "met": middle <= MOST, "worst": max(errors, default=None),
         "within": float(np.mean(np.array(errors) <= MOST)) if errors else 0.0, "photographs": len(errors),
         "rmse_of_trial_0": {f"{cell['plant']} {cell['seed']}": cell["ratio"] for cell in cells}},
        _weighed(cells),
    ]  # fmt: skip


def _weighed(cells: Sequence[Cell]) -> Cell:
    """Return the row of what weighing is worth: rmse on parts over that of the same session not weighed."""
    good = [cell for cell in cells if None not in (cell["rmse"], cell["rmse_weighed"], cell["rmse_weighed_once"])]
    share = {name: [cell[name] / cell["rmse"] for cell in good] for name in ("rmse_weighed", "rmse_weighed_once")}
    middle = {name: float(np.median(values)) if values else float("inf") for name, values in share.items()}
    return {
        "name": "sessions by photographs, weighed: rmse on unseen parts over that of the same not weighed, median",
        "value": middle["rmse_weighed"], "unit": "x", "target": "< 1", "met": middle["rmse_weighed"] < 1.0,
        "only_the_first_weighed": middle["rmse_weighed_once"], "failed": len(cells) - len(good),
    }  # fmt: skip


def _cell(plant: str, seed: int) -> Cell:
    mine = [one for one in cases((plant,), CAP, None) if one.part in PARTS]
    camera = Camera(seed)
    course = run_session(mine[0], seed, camera.measured)
    weighed, once = (run_session(mine[0], seed, Camera(seed).measured, count) for count in (WEIGHED, 1))
    clean = run_session(mine[0], seed, with_noise(0.0, seed))
    return {
        "part": "photo-session", "plant": plant, "seed": seed, "widths": camera.errors, "trials": len(course.true),
        "best": course.best, "ratio": course.beads[course.best] / course.beads[0],
        "bound": min(clean.beads) / clean.beads[0],
        **{
            name: None if one.learned is None else rmse_on_parts(mine, one.learned, seed)
            for name, one in (("rmse", course), ("rmse_weighed", weighed), ("rmse_weighed_once", once),
                              ("rmse_clean", clean))
        },
    }  # fmt: skip
