"""Margin: how far beyond a road's ends its flow should reach, where it cannot begin and end at once.

A plunger at its cap ramps the flow, and learning, which counts every error alike, lays half of that ramp on the road
and half beside it. People do not count alike: a thin first millimetre is a gap, the same volume spread over a travel a
hair. A print is scored by both (bins on the road, volume off it), so the ramps are moved apart until their sum is
least:

    flow |      :  ________________  :             begins `start` seconds sooner, ends `stop` seconds later
         |     /:_/                \\_:\\            rmse of the bins + off_path is least
         |____/ :                    : \\____
               road                 end

Moving a signal in time moves the flow it makes by the same time, whatever the extruder: so the flow that the best trial
measured is moved, and nothing about the extruder is assumed. The sum counts for a road of ROAD nozzle diameters; bins
are as in the score, 1 mm, or 0.4 mm for nozzles under 0.6 mm.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.library import BasisSet
from gcodectl.learn.reference import Routine
from gcodectl.records import TaskKind

ROAD = 25.0
MOST = 0.4
"""The largest margin considered, s."""


@dataclasses.dataclass(frozen=True)
class Margin:
    """Seconds by which the Start begins sooner and the Stop ends later."""

    start: float
    stop: float


def find_margin(q: Floats, routine: Routine, nozzle: float) -> Margin:
    """Find the margins for the measured flow `q` (n samples, mm^3/s) of the best trial of a routine; nozzle in mm."""
    width = 0.4 if nozzle < 0.6 else 1.0
    bins = max(2.0, ROAD * nozzle / width)
    target = routine.flow / routine.speed * width
    shifts = np.arange(0, round(MOST / routine.dt) + 1)
    start = [_edge(q, routine, int(shift), width, target) for shift in shifts]
    mirrored = dataclasses.replace(
        routine, start=routine.duration - routine.stop, stop=routine.duration - routine.start,
        corner=(routine.duration - routine.corner[1], routine.duration - routine.corner[0]),
    )  # fmt: skip
    stop = [_edge(q[::-1], mirrored, int(shift), width, target) for shift in shifts]

    def cost(sooner: int, later: int) -> float:
        (error0, off0), (error1, off1) = start[sooner], stop[later]
        return float(np.sqrt((error0 + error1) / bins) + (off0 + off1) / (bins * target))

    best = min((cost(*pair), *pair) for pair in itertools.product(range(len(shifts)), repeat=2))
    return Margin(round(best[1] * routine.dt, 6), round(best[2] * routine.dt, 6))


def _edge(q: Floats, routine: Routine, shift: int, width: float, target: float) -> tuple[float, float]:
    """Squared errors of the bins after a road's begin, and the volume before it, the flow `shift` samples sooner."""
    moved = np.concatenate([q[shift:], np.full(shift, q[-1])])
    volume = np.concatenate([[0.0], np.cumsum(np.maximum(moved, 0.0) * routine.dt)])
    path = np.concatenate([[0.0], np.cumsum(routine.v * routine.dt)])
    begin = round(routine.start / routine.dt)
    middle = (begin + round(routine.corner[0] / routine.dt)) // 2
    edges = np.arange(0.0, path[middle], width)
    laid = np.diff(np.interp(edges, path[begin : middle + 1], volume[begin : middle + 1]))
    return float(np.sum((laid / target - 1.0) ** 2)), float(volume[begin])


def with_margin(one: BasisSet, margin: Margin) -> BasisSet:
    """Return the set with its Start sooner and its Stop later by the margin, which its record names."""
    signals = dict(one.signals)
    for kind, seconds in ((TaskKind.START, margin.start), (TaskKind.STOP, -margin.stop)):
        signals[kind] = dataclasses.replace(signals[kind], lead=round(signals[kind].lead + seconds, 6))
    training = {**one.training, "margin": {"start": margin.start, "stop": margin.stop}}
    return dataclasses.replace(one, signals=signals, training=training)
