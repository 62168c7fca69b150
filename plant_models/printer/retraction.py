"""Firmware retraction: G10 and G11, with what M207 and M208 set.

    G10: E back by the stroke     G11: E on by the stroke, and by what M208 adds     one that is done already: nothing

Source: Marlin feature/fwretract.cpp, gcode/feature/fwretract/M207-M209.cpp. Units: mm, s.
"""

from __future__ import annotations

from gcodectl.config import Machine
from plant_models.gantry import Firmware
from plant_models.printer.limits import LEAST_SPEED, MOST
from plant_models.printer.words import Words, held


class Retraction:
    """Whether E is retracted, how far, and how fast it goes each way."""

    def __init__(self, machine: Machine, firmware: Firmware) -> None:
        stroke, speed = firmware.retract_volume / machine.area, firmware.retract_speed
        self._back, self._on = (stroke, speed), (0.0, speed)
        self._retracted = False

    def swap(self, wanted: bool) -> tuple[float, float] | None:
        """Retract or recover: return the way of E, mm of the machine's area, and the speed; None: it is already."""
        if wanted == self._retracted:
            return None
        self._retracted = wanted
        stroke, speed = self._back
        extra, on = self._on
        return (-stroke, speed) if wanted else (stroke + extra, on)

    def m207(self, words: Words, unit: float) -> None:
        """Set how E goes back."""
        self._back = _set(words, unit, self._back)

    def m208(self, words: Words, unit: float) -> None:
        """Set how far E goes on beyond where it was, and how fast."""
        self._on = _set(words, unit, self._on)


def _set(words: Words, unit: float, before: tuple[float, float]) -> tuple[float, float]:
    """Return a way and a speed, as S and F set them."""
    way, feed = words.get("S"), words.get("F")
    speed = min(max(feed * unit / 60, LEAST_SPEED), MOST) if feed is not None and feed > 0 else before[1]
    return before[0] if way is None else held(way * unit), speed
