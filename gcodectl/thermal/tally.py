"""Tally: what the heat of a file's surfaces is, as sliced and as planned, layer by layer and in all."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.thermal.beneath import B0, B1, SLICED, T
from gcodectl.thermal.pieces import Piece
from gcodectl.thermal.surface import Band, temperature

TOLERANCE = 0.05
"""degC outside the band that are rounding."""


@dataclasses.dataclass
class Count:
    """Locations by the temperature beneath them when their road comes."""

    hot: int = 0
    cold: int = 0
    hot_by: float = 0.0
    cold_by: float = 0.0
    """How far the worst lies outside the band, degC."""
    total: float = 0.0
    """Sum of temperatures, degC."""

    def add(self, found: Floats, band: Band) -> None:
        """Count some more."""
        if len(found):
            self.hot += int((found > band.high + TOLERANCE).sum())
            self.cold += int((found < band.low - TOLERANCE).sum())
            self.hot_by = max(self.hot_by, float(found.max()) - band.high)
            self.cold_by = max(self.cold_by, band.low - float(found.min()))
            self.total += float(found.sum())

    def table(self, locations: int) -> dict[str, Any]:
        """For JSON."""
        return {
            "too_hot": self.hot, "too_hot_by": self.hot_by, "too_cold": self.cold, "too_cold_by": self.cold_by,
            "mean": self.total / locations if locations else None,
        }  # fmt: skip


@dataclasses.dataclass
class Tally:
    """What has been found so far; `rows` has one dict a layer that lies on another."""

    band: Band
    bead: float = 0.0
    """mm that a road is taken to be wide."""
    slowest: float = 0.0
    """mm/s that the profile lets the head be slowed to; 0 where it says nothing of the head."""
    fastest: float = 0.0
    """mm/s; the file's own speed, where it lays the fastest."""
    locations: int = 0
    beneath: int = 0
    """Locations that lie on something."""
    sliced: Count = dataclasses.field(default_factory=Count)
    planned: Count = dataclasses.field(default_factory=Count)
    waits: int = 0
    wait_s: float = 0.0
    stuck: int = 0
    """Locations too hot in layers that have no place to wait at."""
    slowed: int = 0
    """Layers."""
    slowed_s: float = 0.0
    rows: list[dict[str, Any]] = dataclasses.field(default_factory=list)

    def add(
        self, piece: Piece, ground: Floats, places: Floats, as_sliced: float, lasts: float, wait: float | None
    ) -> None:
        """Take note of a piece: what lies beneath it, its own locations; s that it lasts, without the wait.

        `wait`: None where it has no place to wait at.
        """
        lies = np.isfinite(ground[:, T])
        some, band = ground[lies], self.band
        now, before = (
            temperature(places[lies, k] - some[:, k], some[:, B0], some[:, B1], band.ambient, band.deposition)
            for k in (T, SLICED)
        )
        self.locations, self.beneath = self.locations + len(places), self.beneath + len(some)
        if wait is None:
            wait, self.stuck = 0.0, self.stuck + int((now > band.high + TOLERANCE).sum())
        self.planned.add(now, band)
        self.sliced.add(before, band)
        self.waits, self.wait_s = self.waits + (wait > 0.0), self.wait_s + wait
        self.slowed, self.slowed_s = self.slowed + (lasts > as_sliced), self.slowed_s + max(lasts - as_sliced, 0.0)
        laid = piece.moves.deposits
        if len(some):
            self.rows.append({
                "line": int(piece.moves.line[laid][0]), "layer": int(piece.moves.layer[laid][0]),
                "z": float(piece.moves.p1[laid][0, 2]), "time_s": lasts + wait, "sliced_s": as_sliced, "wait_s": wait,
                "coolest": float(now.min()), "mean": float(now.mean()), "hottest": float(now.max()),
                "sliced_mean": float(before.mean()),
            })  # fmt: skip

    def table(self) -> dict[str, Any]:
        """For JSON; degC and s."""
        return {
            "bead": self.bead, "locations": self.locations, "beneath": self.beneath,
            "as_sliced": self.sliced.table(self.beneath), "planned": self.planned.table(self.beneath),
            "waits": self.waits, "wait_s": self.wait_s, "slowed_layers": self.slowed, "slowed_s": self.slowed_s,
            "layers": self.rows,
        }  # fmt: skip
