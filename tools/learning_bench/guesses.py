"""What a guess saves: every simulated material calibrated from four starts, all others known.

    by hand   the paper's example values, and the flow that the road asks for
    mean      what the other materials needed on average
    suggested what `calibrate suggest` makes of the others and of what is seen of this one
    its own   what this very material needed on other roads, on average: what no guess for a new one can beat

The others' calibrations were found by hand, on other roads, by the same operator; what never came to ok at both ends
is not among them. Each start is another print run of the same road: the noise is drawn anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters
from gcodectl.calibrate.evaluation import known_of
from gcodectl.calibrate.features import decoded
from gcodectl.calibrate.suggestion import suggest
from learning_bench.materials import Material, Road, draw_materials, draw_road
from learning_bench.operator import MOST, by_hand, calibrate, set_up

Cell = dict[str, Any]
EACH = 3
"""Roads of each material that were calibrated by hand."""
STARTS = ("by hand", "mean", "suggested", "its own")


def measure(count: int, seed: int) -> list[Cell]:
    """Return a cell a material: prints to ok at both ends and what the first one was like, by start."""
    rng = np.random.default_rng(seed)
    materials = draw_materials(count, rng)
    known = hand_calibrated(materials, rng)
    return [_cell(material, draw_road(rng), known, seed, rng) for material in materials]


def hand_calibrated(materials: Sequence[Material], rng: np.random.Generator) -> list[Calibration]:
    """Return what an operator found by hand, EACH roads a material; what never came to ok is left out."""
    known: list[Calibration] = []
    for material in materials:
        for _ in range(EACH):
            road = draw_road(rng)
            session = calibrate(material, road, by_hand(road), rng)
            if session.looks[-1].good:
                known.append(session.calibration)
    return known


def targets(cells: Sequence[Cell]) -> list[Cell]:
    """Return the rows of the targets; the paper's figures beside ours are of another operator."""
    if not cells:
        return []
    prints = {start: [cell["starts"][start]["prints"] for cell in cells] for start in STARTS}
    extrudes = float(np.mean([cell["starts"]["suggested"]["extrudes"] for cell in cells]))
    middle = {start: float(np.median(values)) for start, values in prints.items()}
    paper = {"paper": {"by hand": 11.9, "assisted": 4.0}}
    return [
        _row("simulated: first try extrudes, share of materials", extrudes, "of 1", ">= 0.9", extrudes >= 0.9,
             {start: float(np.mean([cell["starts"][start]["extrudes"] for cell in cells])) for start in STARTS}),
        _row("simulated: prints to ok at both ends from a suggestion, median", middle["suggested"], "prints", "<= 4",
             middle["suggested"] <= 4, {"median": middle, "mean": {s: float(np.mean(v)) for s, v in prints.items()},
             "never": {start: sum(one > MOST for one in values) for start, values in prints.items()}, **paper}),
    ]  # fmt: skip


def _row(name: str, value: float, unit: str, target: str, met: bool, beside: Cell) -> Cell:
    return {"name": name, "value": value, "unit": unit, "target": target, "met": bool(met), "beside": beside}


def _cell(
    material: Material, road: Road, known: Sequence[Calibration], seed: int, rng: np.random.Generator
) -> Cell:  # fmt: skip
    others = [one for one in known if one.material != material.name]
    own = [one for one in known if one.material == material.name]
    attributes = road.attributes(material)
    starts = {
        "by hand": by_hand(road), "mean": _on(road, _mean(others, attributes)),
        "suggested": _on(road, suggest(others, attributes).parameters),
        "its own": _on(road, _mean(own or others, attributes)),
    }  # fmt: skip
    cell: Cell = {"part": "operator", "material": material.name, "plant": material.kind, "seed": seed, "starts": {}}
    for name, begin in starts.items():
        session = calibrate(material, road, begin, rng)
        first = session.looks[0]
        cell["starts"][name] = {
            "prints": session.iterations, "extrudes": first.extrudes, "start": first.start, "stop": first.stop
        }  # fmt: skip
    return cell


def _mean(others: Sequence[Calibration], attributes: Attributes) -> Parameters:
    return decoded({name: float(one.y.mean()) for name, one in known_of(others).items()}, attributes)


def _on(road: Road, guess: Parameters) -> Parameters:
    """Return a guess at the speed that is asked for: the plunger in proportion."""
    told = {name: getattr(guess, name) for name in ("inputspeed", "outputspeed", "acceldelay", "pushouttime",
            "deceldelay", "pullbacktime")}  # fmt: skip
    assert all(value is not None for value in told.values()), "simulated calibrations know them all"
    rate = told["inputspeed"] * road.speed / told["outputspeed"]
    return set_up(
        road.speed, rate, (told["acceldelay"], told["pushouttime"]), (told["deceldelay"], told["pullbacktime"])
    )
