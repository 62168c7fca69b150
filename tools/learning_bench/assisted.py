"""An assisted operator: every print's grades go back to the store, and what `suggest` makes of them is printed next.

The same operator, road, grades and noise as by hand (`operator`), who tells the grades of place and amount of both
ends; the knobs alone are the suggestion's, conditioned on the prints made so far (`gcodectl.calibrate.refine`). The
plunger's rate is the operator's own matter, as by hand: by what the thickness is off, the middle one of all prints.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.calibrate.calibration import Calibration, Parameters
from gcodectl.calibrate.refine import Wanted, refined
from learning_bench.materials import Material, Road
from learning_bench.operator import MOST, Look, Session, look_at

THIN = 0.3
"""Of the thickness; below, what comes out says little of the rate."""


def calibrate_assisted(
    material: Material, road: Road, begin: Parameters, may_want: Wanted, rng: np.random.Generator
) -> Session:  # fmt: skip
    """Print from `begin` on as suggested, until both ends are ok or MOST prints are made."""
    plant = material.plant()
    looks: list[Look] = []
    prints: list[Calibration] = []
    rates: list[float] = []
    now = begin
    while True:
        look = look_at(plant, road, now, rng)
        looks.append(look)
        graded = dataclasses.replace(
            road.attributes(material), start_place=look.begins, start_amount=look.lacks,
            stop_place=look.ends, stop_amount=look.oozes,
        )  # fmt: skip
        prints.append(Calibration(graded, now, str(len(prints))))
        if look.good or len(looks) == MOST:
            return Session(tuple(looks), prints[-1])
        assert now.inputspeed is not None, "a print has a rate"
        rates.append(now.inputspeed / max(look.thickness, THIN))
        rate = float(np.clip(np.median(rates), 0.5 * now.inputspeed, 1.5 * now.inputspeed))
        now = dataclasses.replace(refined(may_want, prints)[0], inputspeed=rate)
