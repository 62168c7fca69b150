"""Control: from how the last layers cooled to when, and how fast, the next one is to be laid.

    fits of the last layers -> forecast -> surface, margin for alpha -> partitions -> plan of speeds
                               (this layer)      (chance constraints)

The forecast is of the layer that lies on top now: its curves begin where and when it was laid, which the printer knows,
and the next one is laid on it. A stretch that a later road touches is heated again, by a share of the way from what it
is to what comes out of the nozzle; the share is learned from the layers before, since what it is changes with the plan.

    T |\\    share = (T0 - T) / (T_dep - T)
      | '. | T0       T by the curve from where it was laid, T0 fitted behind the jump
      |  T'|'-.__
      +----+------ t
      laid heated

Source: Fathizadan, dissertation (Arizona State University, 2022), sections 3.2, 4.2; the share is ours.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from gcodectl.columns import Floats
from gcodectl.thermal.chance import margin
from gcodectl.thermal.cooling import Cooling
from gcodectl.thermal.forecast import DEPTH, forecast
from gcodectl.thermal.partitions import Partitions, partition
from gcodectl.thermal.problem import Weights
from gcodectl.thermal.speed import WEIGHTS, SpeedsPlan, plan_speeds
from gcodectl.thermal.surface import Band, Head, Surface

ALPHA = 0.05
"""Probability with which a location may be colder than the band, and hotter, each."""
TOUCHED = 1e-6
"""s after it was laid from which a curve is one of a location that was heated again."""


@dataclasses.dataclass(frozen=True)
class Past:
    """A layer that was seen to cool; its curves begin where it was laid, or later, where it was heated again."""

    cooling: Cooling
    laid: Floats
    """s, one a location."""

    def share(self, band: Band) -> Floats:
        """Return by which share of the way to the deposition temperature each location was heated again; 0: was not."""
        before = _from_nozzle(self.cooling, self.laid, band).at(self.cooling.t0, band.ambient)
        share = (self.cooling.temp0 - before) / np.maximum(band.deposition - before, 1.0)
        return np.where(self.cooling.t0 - self.laid > TOUCHED, np.clip(share, 0.0, 1.0), 0.0)


@dataclasses.dataclass(frozen=True)
class LayerPlan:
    """A plan, and what it was made from."""

    plan: SpeedsPlan
    partitions: Partitions
    cooling: Cooling
    """The forecast."""


def expected(
    past: Sequence[Past], laid: Floats, heated: Floats, band: Band, *, depth: int = DEPTH, ewma: bool = False
) -> Cooling:
    """Return how the layer on top will cool, by the last ones (oldest first).

    `laid`: s, when each location was laid; `heated`: when it was heated last, `laid` itself where it was not again.
    """
    cooling = forecast([one.cooling for one in past], depth=depth, ewma=ewma)
    share = np.mean([one.share(band) for one in past[-depth:]], axis=0)
    before = _from_nozzle(cooling, laid, band).at(heated, band.ambient)
    again = heated - laid > TOUCHED
    temp0 = np.where(again, before + share * (band.deposition - before), cooling.temp0)
    return dataclasses.replace(cooling, t0=np.asarray(heated, dtype=np.float64), temp0=temp0)


def plan_layer(
    past: Sequence[Past], s: Floats, laid: Floats, heated: Floats, head: Head, band: Band, *, earliest: float,
    alpha: float = ALPHA, weights: Weights = WEIGHTS, depth: int = DEPTH, ewma: bool = False,
) -> LayerPlan:  # fmt: skip
    """Plan the layer that is laid on the one on top; arguments as of `expected`, `s`: where its locations are.

    Raises as `plan_speeds` does.
    """
    cooling = expected(past, laid, heated, band, depth=depth, ewma=ewma)
    surface = cooling.surface(s)
    partitions = partition(surface, head, band)
    narrow = margin(cooling, band, alpha)
    plan = plan_speeds(surface, partitions, head, band, weights, earliest=earliest, margin=narrow)
    return LayerPlan(plan, partitions, cooling)


def _from_nozzle(cooling: Cooling, laid: Floats, band: Band) -> Surface:
    """The curves that locations follow from where they are laid."""
    hot = np.full(len(cooling), band.deposition)
    return Surface(s=np.zeros(len(cooling)), b0=cooling.b0, b1=cooling.b1, t0=laid, temp0=hot)
