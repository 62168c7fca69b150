"""Recorded: a file printed on the virtual machine, and the flow that a plant lays along a path in it.

What a trial of learning leaves on the bed, as a camera or calipers would find it: the file is executed as any other
(planner, plunger, plant, from the datum on), and what flows while the head is on the path belongs to the places there.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.errors import InputError
from plant_models.firmware import Execution, execute
from plant_models.plant import Plant
from plant_models.plunger import Plunger
from plant_models.printing import DT
from plant_models.reading import read_moves

NEAR = 2e-3
"""mm; the path begins where a segment begins that lies so near."""


@dataclasses.dataclass(frozen=True)
class Recording:
    """What happened along a path."""

    t: Floats
    """Since the path's begin, s: the edges of n samples, shape (n + 1,)."""
    s: Floats
    """Where the head was on the path at these times, mm."""
    q: Floats
    """The flow in between, mm^3/s, shape (n,)."""

    def areas(self, step: float) -> tuple[Floats, Floats]:
        """Return places every `step` mm, and the bead's mean cross-section about each, mm^2."""
        count = int(self.s[-1] / step)
        edges: Floats = np.arange(count + 1, dtype=np.float64) * step
        volume = np.concatenate([[0.0], np.cumsum(np.maximum(self.q, 0.0) * np.diff(self.t))])
        return edges[:-1] + step / 2.0, np.diff(np.interp(edges, self.s, volume)) / step

    def means(self, step: float) -> tuple[Floats, Floats]:
        """Return times every `step` s, and the mean flow about each, mm^3/s."""
        edges = np.arange(round(self.t[-1] / step) + 1) * step
        volume = np.concatenate([[0.0], np.cumsum(self.q * np.diff(self.t))])
        return edges[:-1] + step / 2.0, np.diff(np.interp(edges, self.t, volume)) / step


def laid(data: bytes, machine: Machine, plant: Plant) -> float:
    """Print a file and return all that flowed until it ended, mm^3: what a scale weighs of it."""
    _, q = _flow(data, machine, plant)
    return float(np.maximum(q, 0.0).sum() * DT)


def record(data: bytes, machine: Machine, plant: Plant, path: Floats) -> Recording:
    """Print a file and return what flowed along `path`, its corners, mm, shape (n, 2).

    The plunger keeps the machine's limits; the plant is at rest when the file begins. Raises InputError where the file
    does not go along the path.
    """
    execution, q = _flow(data, machine, plant)
    begin = _begin(execution, path)
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    edges: Floats = np.arange(int((execution.duration - begin) / DT), dtype=np.float64) * DT
    s = np.concatenate([[0.0], np.cumsum(execution.speed(begin + edges[:-1] + DT / 2.0) * DT)])
    there = edges[: int(np.searchsorted(s, length)) + 1]
    volume = np.concatenate([[0.0], np.cumsum(q) * DT])
    flow = np.diff(np.interp(begin + there, np.arange(len(volume)) * DT, volume)) / DT
    return Recording(there, np.minimum(s[: len(there)], length), flow)


def _flow(data: bytes, machine: Machine, plant: Plant) -> tuple[Execution, Floats]:
    """Return what the machine does, and what flows meanwhile, mm^3/s, samples of DT s."""
    execution = execute([read_moves(data, machine, source="the trial")], machine)
    behind = Plunger(plant, machine.max_flow, machine.max_flow_slew)
    _, q = behind.run(behind.initial(), execution.command(DT).values[0], DT)
    return execution, q


def _begin(execution: Execution, path: Floats) -> float:
    """Return when the head is at the path's begin for the first time with a segment that begins there, s."""
    near = np.hypot(*(execution.segments.p0[:, :2] - path[0]).T) < NEAR
    if not near.any():
        raise InputError("does not go where its session says; it is not the file that the session wrote")
    return float(execution.begins()[np.flatnonzero(near)[0]])
