"""Simulated materials: plants of `plant_models`, parameters drawn from their ranges, and what a person sees of them.

    plant      drawn                                     seen, as low, medium or high
    paste      K 0.85 to 1.1, tau 0.3 to 3 s             elasticity   the lag's third of 0.3 to 3 s
    syringe-*  n 0.35 to 0.6, P_y 60 to 250 kPa, and     flowing      the yield stress's third, upside down
               dead time, backlash or thixotropy         friction     backlash and dead time
    pneumatic  tau 0.05 to 0.4 s                         stability    how much it stiffens at rest

The tool is written down too: a syringe pump, or air pressure. A person sees thirds, not numbers, and is off by one in
every fifth judgement. That the seen goes with the hidden in this way is our assumption; what a guess saves rests on it.
The ranges are those of the plants' own files, and hold at 5 mm^3/s: at another road's flow the same material behaves as
its plant says.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from gcodectl.calibrate.calibration import LEVELS, Attributes
from plant_models.plant import Plant, load_plant
from plant_models.plunger import Plunger

KINDS = ("paste-a", "syringe", "syringe-dead", "syringe-backlash", "syringe-thixo", "pneumatic")
SLOWEST, FASTEST = 3.0, 0.3
"""s; the lags between which materials are drawn."""
NOMINAL = 5.0
"""mm^3/s"""
MISJUDGED = 0.2
MAX_FLOW, MAX_FLOW_SLEW = 25.0, 2000.0
"""The built-in syringe machine's plunger."""


@dataclasses.dataclass(frozen=True)
class Material:
    """A plant behind a name, with what is seen of it."""

    name: str
    kind: str
    parameters: dict[str, float]
    seen: dict[str, str]

    def plant(self) -> Plant:
        """Return the extruder that holds it, behind its plunger's limits."""
        parameters: dict[str, Any] = dict(self.parameters)
        return Plunger(load_plant(self.kind, flow=NOMINAL, **parameters), MAX_FLOW, MAX_FLOW_SLEW)


@dataclasses.dataclass(frozen=True)
class Road:
    """A road to be laid: nozzle, width and height in mm, speed in mm/s."""

    nozzle: float
    width: float
    height: float
    speed: float

    @property
    def flow(self) -> float:
        """What it asks for, mm^3/s."""
        return self.width * self.height * self.speed

    def attributes(self, material: Material) -> Attributes:
        """Return what is written down of it."""
        seen: dict[str, Any] = dict(material.seen)
        return Attributes(
            material.name, tool="air pressure" if material.kind == "pneumatic" else "syringe pump",
            nozzle_diameter=self.nozzle, path_width=self.width, path_height=self.height, **seen,
        )  # fmt: skip


def draw_materials(count: int, rng: np.random.Generator) -> list[Material]:
    """Return materials of all kinds in turn."""
    return [_draw(number, KINDS[number % len(KINDS)], rng) for number in range(count)]


def draw_road(rng: np.random.Generator) -> Road:
    """Return a road as one would ask of the nozzle at hand."""
    nozzle = float(rng.choice([0.6, 0.84, 1.0]))
    width = nozzle * float(rng.uniform(0.95, 1.2))
    return Road(nozzle, width, nozzle * float(rng.uniform(0.6, 0.75)), float(rng.uniform(8.0, 12.0)))


def _draw(number: int, kind: str, rng: np.random.Generator) -> Material:
    lag = FASTEST * (SLOWEST / FASTEST) ** rng.uniform()
    stiff = 60.0 * (250.0 / 60.0) ** rng.uniform()
    given: dict[str, float] = {"tau": lag}
    if kind == "paste-a":
        given["K"], stiff = float(rng.uniform(0.85, 1.1)), 0.0
    elif kind == "pneumatic":
        lag = given["tau"] = float(rng.uniform(0.05, 0.4))
        given["P_y"] = stiff
    else:
        given |= {"n": float(rng.uniform(0.35, 0.6)), "P_y": stiff, "P_over": float(rng.uniform(120.0, 250.0))}
    dead = float(rng.uniform(0.1, 0.3)) if kind == "syringe-dead" else 0.0
    backlash = float(rng.uniform(0.03, 0.1)) if kind == "syringe-backlash" else 0.0
    rise = float(rng.uniform(0.3, 0.7)) if kind == "syringe-thixo" else 0.0
    given |= {name: value for name, value in (("dead", dead), ("backlash", backlash), ("rise", rise)) if value}
    third = 3.0 * math.log(max(lag, FASTEST) / FASTEST) / math.log(SLOWEST / FASTEST)
    yields = 3.0 * math.log(max(stiff, 60.0) / 60.0) / math.log(250.0 / 60.0)
    seen = {
        "elasticity": _judged(third, rng), "flowing": _judged(2.999 - yields, rng),
        "friction": _judged(5.0 * (dead + 2.0 * backlash), rng), "stability": _judged(4.0 * rise, rng),
    }  # fmt: skip
    return Material(f"material {number}", kind, given, seen)


def _judged(third: float, rng: np.random.Generator) -> str:
    level = int(np.clip(math.floor(third), 0, 2))
    if rng.uniform() < MISJUDGED:
        level = int(np.clip(level + rng.choice([-1, 1]), 0, 2))
    return LEVELS[level]
