"""When, by the motion plan, each line of a job is done: what time left is counted from."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gcodectl.columns import Floats, Ints
    from gcodectl.config import Machine
    from gcodectl.records import Moves


@dataclasses.dataclass(frozen=True)
class Timeline:
    """Lines of a job, in order, when each is done (s from the start), and the layer it lies on."""

    line: Ints
    done: Floats
    layer: Ints

    @property
    def total(self) -> float:
        """Seconds the whole job takes; heating, homing and waiting aside."""
        return float(self.done[-1]) if len(self.done) else 0.0

    @property
    def layers(self) -> int:
        """How many layers there are."""
        return int(self.layer.max()) + 1 if len(self.layer) else 0

    def left(self, line: int) -> float:
        """Return the seconds of motion after `line`."""
        index = int(np.searchsorted(self.line, line, side="right"))
        return self.total - (float(self.done[index - 1]) if index else 0.0)

    def at(self, line: int) -> int:
        """Return the layer that `line` lies on, from 1; 0 before the first."""
        index = int(np.searchsorted(self.line, line, side="right"))
        return int(self.layer[index - 1]) + 1 if index else 0


def timeline_of(moves: Iterable[Moves], machine: Machine) -> tuple[Timeline, float]:
    """Plan a file's motion; returns its timeline and its deepest retraction, mm of E."""
    from gcodectl.pipeline import time_moves

    lines, done, layers, deepest = [], [], [], 0.0
    for rows, _, phases in time_moves(moves, machine):
        if not len(rows):
            continue
        ends = np.full(len(rows), -np.inf)
        np.maximum.at(ends, phases.row - rows.row[0], phases.t + phases.duration)
        lines.append(rows.line)
        done.append(ends)
        layers.append(rows.layer)
        deepest = max(deepest, -float(np.nanmin(rows.e, initial=0.0)))
    if not lines:
        return Timeline(np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64)), 0.0
    ends = np.maximum.accumulate(np.maximum(np.concatenate(done), 0.0))
    return Timeline(np.concatenate(lines), ends, np.concatenate(layers).astype(np.int64)), deepest
