"""Course: when a piece's roads are laid by the motion plan: its phases of deposition, over path and over time.

time |            __--      slope: 1 / speed; a jump is a travel, a dwell, a retract
     |        |--'          dep(l): seconds of deposition up to l     fix(l): all other seconds up to there
     |   _.--'
     +----------------- path deposited, l
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from gcodectl.columns import Columns, Floats, column
from gcodectl.records import Moves, Profile, SpeedPlan


@dataclasses.dataclass(frozen=True)
class Course(Columns):
    """One row a phase that deposits, in order; times are counted from the piece's begin."""

    path: Floats = column(np.float64)
    """mm deposited before it."""
    t: Floats = column(np.float64)
    duration: Floats = column(np.float64)
    length: Floats = column(np.float64)
    """mm"""
    lasts: float = 0.0
    """Seconds of the whole piece."""

    @classmethod
    def of(cls, timed: Iterable[tuple[Moves, SpeedPlan, Profile]]) -> Course:
        """The course of a piece's timed moves."""
        path, lasts = 0.0, 0.0
        found = []
        for moves, _, phases in timed:
            laid = np.where(moves.deposits, moves.length, 0.0)
            before = path + np.cumsum(laid) - laid
            path += float(laid.sum())
            if not len(phases):
                continue
            lasts = float(phases.t[-1] + phases.duration[-1])
            rows = phases.row - moves.row[0]
            lays = moves.deposits[rows]
            some, d = phases[lays], phases.duration[lays]
            length = d * (some.v + d * (some.a / 2.0 + d * some.j / 6.0))
            found.append(np.stack([before[rows[lays]] + some.s, some.t, d, length]))
        table = np.concatenate(found, axis=1) if found else np.zeros((4, 0))
        path_at, t, duration, length = table[:, table[3] > 0.0]
        return cls(path_at, t, duration, length, lasts)

    @property
    def speed(self) -> Floats:
        """Mean speed of each phase, mm/s."""
        return np.asarray(self.length / self.duration)

    @property
    def end(self) -> float:
        """mm deposited in all."""
        return float(self.path[-1] + self.length[-1])

    def at(self, path: Floats) -> tuple[Floats, Floats]:
        """Seconds that deposit, and all others, from the piece's begin until so much has been deposited (mm)."""
        which = np.clip(np.searchsorted(self.path, path, side="right") - 1, 0, len(self) - 1)
        within = np.clip((path - self.path[which]) / self.length[which], 0.0, 1.0) * self.duration[which]
        before = np.cumsum(self.duration) - self.duration
        return before[which] + within, self.t[which] - before[which]

    def when(self, path: Floats) -> Floats:
        """When so much has been deposited (mm), s from the piece's begin."""
        deposited, other = self.at(path)
        return deposited + other

    def where(self, deposited: Floats) -> Floats:
        """How much has been deposited after so many seconds of deposition, mm."""
        ends = np.cumsum(self.duration)
        return np.asarray(np.interp(deposited, np.append(0.0, ends), np.append(self.path, self.end)))
