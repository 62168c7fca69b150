"""Photographs: how well a strip's width is measured in them, by nozzle.

A plant prints the first trial of a session on the virtual printer; that is photographed (a scene a seed: colours,
lamps, lens, tilt, how the sheet lies) and measured. The error is measured minus true, over the nominal width, rms over
the strip; `relative` is over the true width, where that is more than a quarter of the nominal. What is refused is
counted, and is in no rms. `weighed`: the same with what the weight of that print corrects.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import load_machine
from gcodectl.errors import InputError
from gcodectl.session.measured import Series, width_of
from gcodectl.session.photographs import sheet_of, widths_in
from gcodectl.session.record import Session
from gcodectl.session.steps import begin
from gcodectl.session.weighing import corrections, shifted
from gcodectl.vision.widths import Widths
from learning_bench.weights import taken, weight_of
from plant_models.photo_scene import Scene, draw_scene
from plant_models.photograph import Strip, photograph
from plant_models.plant import load_plant
from plant_models.recorded import record

Cell = dict[str, Any]
MOST = 0.05
THIN = 0.25
DRAWS = 1000
FIRST = 10_000
"""The scenes' first seed: none of those that the measuring was designed with."""


@dataclasses.dataclass(frozen=True)
class Print:
    """What is printed through one nozzle, as a session lays it out."""

    machine: str
    plants: tuple[str, ...]
    flow: float
    """mm^3/s"""
    lag: float
    """s"""

    @property
    def nozzle(self) -> float:
        """mm"""
        return load_machine(self.machine).nozzle


PRINTS = (
    Print("syringe", ("paste-a", "syringe", "syringe-slow", "syringe-thixo"), 5.0, 3.0),
    Print("filament", ("melt", "melt-bowden"), 2.0, 0.5),
    Print("pellet", ("pellet",), 1500.0, 2.0),
)


def measure(count: int, seed: int, quick: bool) -> list[Cell]:
    """Return a cell a photograph: `count` of each nozzle (quick: of the first)."""
    prints = PRINTS[:1] if quick else PRINTS
    return [_cell(one, seed + k) for one, k in itertools.product(prints, range(count))]


def targets(cells: Sequence[Cell]) -> list[Cell]:
    """Return four rows a nozzle."""
    rows = []
    for nozzle in dict.fromkeys(cell["nozzle"] for cell in cells):
        mine = [cell for cell in cells if cell["nozzle"] == nozzle]
        good = [cell for cell in mine if not cell["refused"]]
        nominal, true = "the nominal width", f"the true width where over {THIN:g} nominal"
        for key, over in (
            ("rms", nominal), ("relative", true), ("rms_weighed", f"{nominal}, weighed"),
            ("relative_weighed", f"{true}, weighed"),
        ):  # fmt: skip
            values = np.array([cell[key] for cell in good])
            middle = float(np.median(values)) if len(values) else float("inf")
            rows.append({
                "name": f"photographs, nozzle {nozzle:g} mm: width, rms over {over}, median", "value": middle,
                "unit": "of 1", "target": f"<= {MOST:g}", "met": middle <= MOST, "interval": _interval(values),
                "worst": float(values.max()) if len(values) else float("inf"),
                "within": float(np.mean(values <= MOST)) if len(values) else 0.0,
                "photographs": len(mine), "refused": len(mine) - len(good),
            })  # fmt: skip
    return rows


def _interval(values: Floats) -> list[float]:
    """Return the median's 95 % interval, drawn from what there is."""
    if not len(values):
        return [float("inf")] * 2
    drawn = np.random.default_rng(0).choice(values, (DRAWS, len(values)))
    low, high = np.quantile(np.median(drawn, axis=1), [0.025, 0.975])
    return [float(low), float(high)]


def _cell(one: Print, seed: int) -> Cell:
    plant = one.plants[seed % len(one.plants)]
    scene = draw_scene(FIRST + seed)
    now, strip = printed(one, plant, seed)
    cell: Cell = {
        "part": "photographs", "nozzle": one.nozzle, "plant": plant, "seed": seed, "material": scene.material,
        "ground": scene.ground, "refused": "",
    }  # fmt: skip
    try:
        image = photograph(strip, sheet_of(now.setup.printout.layout, one.nozzle), scene)
        found = widths_in(now, [("photograph", image)])
    except InputError as error:
        return {**cell, "refused": str(error)}
    weight = weight_of(now, load_plant(plant, seed=seed, flow=one.flow), seed)
    series = Series("s,width", found.s, found.width, source="photograph", by="photo")
    known = corrections(taken(now, series, weight))
    offset = known[0, 0].offset if known else 0.0
    better = dataclasses.replace(found, width=shifted(found.width, offset, now.setup.printout.height))
    after = _errors(better, strip, scene)
    return {
        **cell, **_errors(found, strip, scene), "rms_weighed": after["rms"], "relative_weighed": after["relative"],
        "offset": offset / strip.nominal, "grams": weight.grams, "step": weight.readability,
        "weight_taken": bool(known),
    }  # fmt: skip


def _errors(found: Widths, strip: Strip, scene: Scene) -> Cell:
    true = np.interp(found.s, strip.s, strip.width)
    error = (found.width - true) / strip.nominal
    wide = (true > THIN * strip.nominal) & np.isfinite(error)
    return {
        "rms": float(np.sqrt(np.nanmean(error**2))),
        "relative": float(np.sqrt(np.mean((error[wide] * strip.nominal / true[wide]) ** 2))),
        "bias": float(np.mean(error[wide])), "seen": float(np.isfinite(error).mean()),
        "datum": found.nominal / strip.nominal, "turned": found.shift.degrees - scene.shift[2],
    }  # fmt: skip


def printed(one: Print, plant: str, seed: int) -> tuple[Session, Strip]:
    """Return a session, and the strip that a plant lays of its first trial on the virtual printer."""
    machine = load_machine(one.machine)
    now = begin(machine, material=plant, flow=one.flow, lag=one.lag, gcode=("G28", ""), date="2026-01-01")
    printout = now.setup.printout
    data = printout.gcode("trial 0", now.trials[0].u, now.setup.routine.dt)
    laid = record(data, machine, load_plant(plant, seed=seed, flow=one.flow), printout.layout.path)
    return now, strip_of(now, *laid.areas(0.25 * machine.nozzle))


def strip_of(now: Session, places: Floats, area: Floats) -> Strip:
    """Return what lies on a session's path, of whose bead the places, mm, and cross-sections there, mm^2, are given."""
    layout, height = now.setup.printout.layout, now.setup.printout.height
    nominal = float(width_of(np.array([now.setup.routine.flow / layout.speed]), height)[0])
    return Strip(layout.path, places, width_of(area, height), layout.datum, nominal, height)
