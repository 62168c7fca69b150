"""Photographs: how well a strip's width is measured in them, by nozzle.

A plant prints the training routine, open loop, as a strip of parallel lanes at constant speed; its flow is the strip's
width; that is photographed (a scene a seed: colours, lamps, lens, tilt, how the sheet lies) and measured. The error is
measured minus true, over the nominal width, rms over the strip; `relative` is over the true width, where that is more
than a quarter of the nominal. What is refused is counted, and is in no rms.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.learn.reference import training_routine, with_levels
from gcodectl.vision.sheet import sheet_around
from gcodectl.vision.widths import Widths, measure_widths
from plant_models.photo_scene import Scene, draw_scene
from plant_models.photograph import Strip, photograph
from plant_models.plant import load_plant

Cell = dict[str, Any]
MOST = 0.05
HIGH = 0.7
"""A bead's height, in nozzle diameters."""
THIN = 0.25
DRAWS = 1000
FIRST = 10_000
"""The scenes' first seed: none of those that the measuring was designed with."""


@dataclasses.dataclass(frozen=True)
class Print:
    """What is printed through one nozzle; mm, mm^3/s, s."""

    nozzle: float
    plants: tuple[str, ...]
    flow: float
    lag: float
    pitch: float
    lane: float
    """The longest lane."""

    @property
    def speed(self) -> float:
        """mm/s, for a bead as wide as the nozzle."""
        return self.flow / (HIGH * self.nozzle**2)


PRINTS = (
    Print(0.84, ("paste-a", "syringe", "syringe-slow", "syringe-thixo"), 5.0, 3.0, 7.0, 150.0),
    Print(0.4, ("melt", "melt-bowden"), 2.0, 0.5, 5.0, 140.0),
    Print(5.0, ("pellet",), 1500.0, 2.0, 32.0, 1000.0),
)


def measure(count: int, seed: int, quick: bool) -> list[Cell]:
    """Return a cell a photograph: `count` of each nozzle (quick: of the first)."""
    prints = PRINTS[:1] if quick else PRINTS
    return [_cell(one, seed + k) for one, k in itertools.product(prints, range(count))]


def targets(cells: Sequence[Cell]) -> list[Cell]:
    """Return two rows a nozzle."""
    rows = []
    for nozzle in dict.fromkeys(cell["nozzle"] for cell in cells):
        mine = [cell for cell in cells if cell["nozzle"] == nozzle]
        good = [cell for cell in mine if not cell["refused"]]
        for key, over in (("rms", "the nominal width"), ("relative", f"the true width where over {THIN:g} nominal")):
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
    strip = printed(one, plant, seed)
    sheet = sheet_around(np.concatenate([strip.path, strip.datum]), 0.8 * one.pitch + 2.0)
    cell: Cell = {
        "part": "photographs", "nozzle": one.nozzle, "plant": plant, "seed": seed, "material": scene.material,
        "ground": scene.ground, "refused": "",
    }  # fmt: skip
    step = 0.25 * max(1.0, one.nozzle)
    try:
        found = measure_widths(photograph(strip, sheet, scene), strip.path, strip.datum, sheet, step,
                               height=strip.height)  # fmt: skip
    except InputError as error:
        return {**cell, "refused": str(error)}
    return {**cell, **_errors(found, strip, scene)}


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


def printed(one: Print, plant: str, seed: int) -> Strip:
    """Return the strip that a plant lays of the training routine, and where."""
    routine = with_levels(training_routine(one.flow, lag=one.lag, speed=one.speed))
    model = load_plant(plant, seed=seed, flow=one.flow)
    _, flow = model.run(model.initial(), routine.q_ref, routine.dt)
    height = HIGH * one.nozzle
    width = np.maximum(flow, 0.0) / one.speed / height
    s = one.speed * (routine.t + 0.5 * routine.dt)
    path = serpentine(one.speed * routine.duration, one.lane, one.pitch)
    left = path[:, 0].min() - 2.0 * one.pitch
    datum = np.array([[left, -one.pitch], [left, path[:, 1].max() + one.pitch]])
    return Strip(path, s, width, datum, one.nozzle, height)


def serpentine(length: float, lane: float, pitch: float) -> Floats:
    """Return a path of a length in lanes of at most `lane` mm, joined by half circles, [n, 2] mm."""
    lanes = int(np.ceil((length + 0.5 * np.pi * pitch) / (lane + 0.5 * np.pi * pitch)))
    straight = (length - (lanes - 1) * 0.5 * np.pi * pitch) / lanes
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 65)
    pieces = []
    for k in range(lanes):
        ends = np.array([[0.0, k * pitch], [straight, k * pitch]])
        back = k % 2 == 1
        pieces.append(ends[::-1] if back else ends)
        if k < lanes - 1:
            bend = 0.5 * pitch * np.column_stack([-np.cos(angle) if back else np.cos(angle), np.sin(angle)])
            pieces.append(bend[1:-1] + np.array([0.0 if back else straight, (k + 0.5) * pitch]))
    return np.concatenate(pieces)
