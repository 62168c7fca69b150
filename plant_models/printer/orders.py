"""What a line makes the machine do: move, stand still, or nothing."""

from __future__ import annotations

from typing import NamedTuple

from plant_models.printer.chords import Point


class Motion(NamedTuple):
    """Straight pieces that follow each other, E shared evenly; one piece that may have no path."""

    start: Point
    ends: list[Point]
    e: float
    """mm of E, the flow factor applied."""
    e_start: float
    e_end: float
    """Logical E before and after it, mm."""
    feed: float
    """mm/s, the speed factor applied."""


class Halt(NamedTuple):
    """Come to rest with nothing left in the buffer, then stand still."""

    seconds: float


Order = Motion | Halt | None
