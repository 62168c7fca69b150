"""Weights: what a scale shows of all that a print laid, in the benches of the learning loop.

The scale is as fine as `learn start` asks for: the next power of ten below a hundredth of the print.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.session.measured import Series
from gcodectl.session.record import Session, Weight
from gcodectl.session.steps import take
from gcodectl.session.weights import FINE, read_weight
from plant_models.plant import Plant
from plant_models.recorded import laid
from plant_models.scale import weigh

DENSITY = 1.2
"""g/cm^3, of everything."""


def taken(now: Session, series: Series, weight: Weight) -> Session:
    """Return the session with a print that is measured and weighed; not weighed where that is refused."""
    made = take(now, None, [series], anyway=True, weights=[weight], density=DENSITY)
    told = made.trials[len(now.measured)].prints[0].faults
    return take(now, None, [series], anyway=True) if any(one.startswith("weight:") for one in told) else made


def weight_of(now: Session, plant: Plant, seed: int) -> Weight:
    """Return the weight of the session's last trial, printed on a plant."""
    trial, printout = now.trials[-1], now.setup.printout
    volume = laid(printout.gcode("weighed", trial.u, now.setup.routine.dt), printout.machine, plant)
    step = 10.0 ** math.floor(math.log10(DENSITY * volume / 1e3 / FINE))
    return read_weight(weigh(volume, DENSITY, step, np.random.default_rng([seed, trial.number, 17])))
