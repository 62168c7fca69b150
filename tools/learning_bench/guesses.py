"""What a guess saves: every simulated material calibrated from four starts, all others known.

    by hand   the paper's example values, and the flow that the road asks for
    mean      what the other materials of its kind of drive needed on average
    suggested what `calibrate suggest` makes of the others and of what is seen of this one
    its own   what this very material needed on other roads, on average: what no guess for a new one can beat

All are turned by hand from there on. Where a suggestion is refused, for want of a known
material of the same kind of drive, one begins by hand.

The others' calibrations were found by hand, on other roads, by the same operator; what never came to ok at both ends
is not among them. Each start is another print run of the same road: the noise is drawn anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters
from gcodectl.calibrate.drives import same_drive
from gcodectl.calibrate.evaluation import known_of
from gcodectl.calibrate.features import decoded
from gcodectl.calibrate.suggestion import suggest
from gcodectl.columns import Floats
from gcodectl.errors import UnsafeError
from learning_bench.materials import Material, Road, draw_materials, draw_road
from learning_bench.operator import MOST, by_hand, calibrate, set_up

Cell = dict[str, Any]
DRAWS = 1000
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


def targets(cells: Sequence[Cell], seed: int = 0) -> list[Cell]:
    """Return the rows of the targets; the paper's figures beside ours are of another operator."""
    if not cells:
        return []
    prints = {start: np.array([cell["starts"][start]["prints"] for cell in cells], dtype=float) for start in STARTS}
    extrudes = float(np.mean([cell["starts"]["suggested"]["extrudes"] for cell in cells]))
    middle = {start: float(np.median(values)) for start, values in prints.items()}
    beside = {
        "median": middle, "interval": {start: interval(values, seed) for start, values in prints.items()},
        "mean": {start: float(values.mean()) for start, values in prints.items()},
        "never": {start: int((values > MOST).sum()) for start, values in prints.items()},
        "within 4": {start: float((values <= 4).mean()) for start, values in prints.items()},
        "refused": sum(cell["refused"] for cell in cells), "paper": {"by hand": 11.9, "assisted": 4.0},
    }  # fmt: skip
    return [
        _row("simulated: first try extrudes, share of materials", extrudes, "of 1", ">= 0.9", extrudes >= 0.9,
             {start: float(np.mean([cell["starts"][start]["extrudes"] for cell in cells])) for start in STARTS}),
        _row(f"simulated: prints to ok at both ends from a suggestion, median of {len(cells)} materials",
             middle["suggested"], "prints", "<= 4", middle["suggested"] <= 4, beside),
    ]  # fmt: skip


def interval(values: Floats, seed: int) -> list[float]:
    """Return between what the median lies with 95 %, by drawing materials again."""
    rng = np.random.default_rng(seed)
    low, high = np.quantile(np.median(rng.choice(values, (DRAWS, len(values))), axis=1), [0.025, 0.975])
    return [float(low), float(high)]


def _row(name: str, value: float, unit: str, target: str, met: bool, beside: Cell) -> Cell:
    return {"name": name, "value": value, "unit": unit, "target": target, "met": bool(met), "beside": beside}


def _cell(
    material: Material, road: Road, known: Sequence[Calibration], seed: int, rng: np.random.Generator
) -> Cell:  # fmt: skip
    attributes = road.attributes(material)
    others = [one for one in known if one.material != material.name]
    own = [one for one in known if one.material == material.name]
    hand = by_hand(road)
    try:
        kept, _ = same_drive(others, attributes)
        suggested, mean = _on(road, suggest(others, attributes).parameters), _on(road, _mean(kept, attributes))
    except UnsafeError:
        kept, suggested, mean = [], hand, hand
    begun = {
        "by hand": hand, "mean": mean, "suggested": suggested,
        "its own": _on(road, _mean(own or kept, attributes)) if own or kept else hand,
    }  # fmt: skip
    sessions = {name: calibrate(material, road, begin, rng) for name, begin in begun.items()}
    starts = {
        name: {"prints": sessions[name].iterations, "extrudes": sessions[name].looks[0].extrudes,
               "start": sessions[name].looks[0].start, "stop": sessions[name].looks[0].stop}
        for name in STARTS
    }  # fmt: skip
    return {"part": "operator", "material": material.name, "plant": material.kind, "seed": seed, "starts": starts,
            "refused": not kept}  # fmt: skip


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
