"""An assisted operator: every print's grades go back to the store, and what `suggest` makes of them is printed next.

The same operator, road, grades and noise as by hand (`operator`); the knobs alone are the suggestion's, conditioned on
the prints made so far (`gcodectl.calibrate.refine`). It is told the grades of both ends, no more. The plunger's rate
is the operator's own matter, as by hand: by what the thickness is off.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters
from gcodectl.calibrate.evaluation import known_of
from gcodectl.calibrate.refine import Wanted, refined
from gcodectl.calibrate.suggestion import guess_one, wanted
from learning_bench.materials import Material, Road
from learning_bench.operator import MOST, Look, Session, look_at

EXACT = 0.03
"""Share of the thickness that nobody can read off."""


def before(known: Sequence[Calibration], attributes: Attributes) -> Wanted:
    """Return what a material may want before its first print."""
    learned = known_of(known)
    found = wanted(learned, {name: guess_one(one, attributes) for name, one in learned.items()}, attributes)
    assert found is not None, "simulated calibrations tell all knobs"
    return found


def calibrate_assisted(
    material: Material, road: Road, begin: Parameters, may_want: Wanted, rng: np.random.Generator
) -> Session:  # fmt: skip
    """Print from `begin` on as suggested, until both ends are ok or MOST prints are made."""
    plant = material.plant()
    looks: list[Look] = []
    prints: list[Calibration] = []
    now = begin
    while True:
        look = look_at(plant, road, now, rng)
        looks.append(look)
        graded = dataclasses.replace(road.attributes(material), start_error=look.start, stop_error=look.stop)
        prints.append(Calibration(graded, now, str(len(prints))))
        if look.good or len(looks) == MOST:
            return Session(tuple(looks), prints[-1])
        now, _ = refined(may_want, prints)
        assert now.inputspeed is not None, "a print has a rate"
        if abs(look.thickness - 1.0) > EXACT:
            factor = float(np.clip(1.0 / max(look.thickness, 0.05), 0.5, 1.5))
            now = dataclasses.replace(now, inputspeed=now.inputspeed * factor)
