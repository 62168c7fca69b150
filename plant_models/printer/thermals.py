"""The heaters' commands: targets, waiting for them, and what is said of temperatures.

Texts as Marlin 2.1 has them: gcode/temp/M105.cpp, M155.cpp, module/temperature.cpp (print_heater_states,
wait_for_hotend: a line a second while it waits).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from plant_models.printer.codes import Wait, word
from plant_models.printer.heaters import BED, HOTEND, Heater


class Thermals:
    """Hot ends and bed."""

    def __init__(self, extruders: int, say: Callable[[bytes], None]) -> None:
        self.hotends = [Heater(HOTEND) for _ in range(extruders)]
        self.bed = Heater(BED)
        self.tool = 0
        self.heat_until = -math.inf
        """When the wait for a heater ends."""
        self.report_at = math.inf
        """When temperatures are to be said next."""
        self._say = say
        self._awaited: Heater | None = None
        self._every, self._next_report, self._next_heat = 0.0, math.inf, math.inf

    def end_wait(self, now: float) -> None:
        """End the wait for a heater, if there is one."""
        if self._awaited is not None:
            self._awaited, self._next_heat = None, math.inf
            self._plan_reports()
            self._say(self.temperatures(now, b"") + b"\n")

    def temperatures(self, now: float, lead: bytes) -> bytes:
        """Return what M105 says, without its end."""
        hot = self.hotends[self.tool]
        parts = [lead, b" T:%.2f /%.2f" % (hot.temperature(now), hot.target)]
        parts.append(b" B:%.2f /%.2f" % (self.bed.temperature(now), self.bed.target))
        if len(self.hotends) > 1:
            parts += [b" T%d:%.2f /%.2f" % (k, one.temperature(now), one.target) for k, one in enumerate(self.hotends)]
        parts.append(b" @:%d B@:%d" % (_power(hot, now), _power(self.bed, now)))
        return b"".join(parts)

    def report(self, now: float, quiet: bool) -> None:
        """Say the temperatures that are due at `now`; quiet: let them pass."""
        if now < self.report_at:
            return
        if now >= self._next_heat and self._awaited is not None:
            left = self.heat_until - now
            shown = b"?" if now < self._awaited.there else b"%d" % math.ceil(left)
            if not quiet:
                self._say(self.temperatures(now, b"") + b" W:%s\n" % shown)
            self._next_heat = now + 1.0
        if now >= self._next_report:
            if not quiet:
                self._say(self.temperatures(now, b"") + b"\n")
            self._next_report = now + self._every
        self._plan_reports()

    def heaters_off(self, now: float) -> None:
        """Turn all heaters off."""
        for heater in (*self.hotends, self.bed):
            heater.set(0.0, now)

    def _plan_reports(self) -> None:
        self.report_at = min(self._next_report, self._next_heat)

    def m155(self, text: bytes, now: float) -> None:
        """Say temperatures every S seconds."""
        every = word(text, "S")
        if every is not None:
            self._every = min(max(int(every), 0), 60)
            self._next_report = now + self._every if self._every else math.inf
            self._plan_reports()

    def _hotend(self, text: bytes) -> Heater | None:
        tool = word(text, "T")
        index = self.tool if tool is None else int(tool)
        if 0 <= index < len(self.hotends):
            return self.hotends[index]
        self._say(b"echo:%s Invalid extruder %d\n" % (text[:4], index))
        return None

    def m104(self, text: bytes, now: float) -> None:
        """Set a hot end's target."""
        heater, target = self._hotend(text), word(text, "S")
        if heater is not None and target is not None:
            heater.set(target, now)

    def m140(self, text: bytes, now: float) -> None:
        """Set the bed's target."""
        target = word(text, "S")
        if target is not None:
            self.bed.set(target, now)

    def m109(self, text: bytes, now: float) -> Wait:
        """Set a hot end's target and wait for it."""
        heater = self._hotend(text)
        return Wait.NO if heater is None else self._heat(heater, text, now)

    def m190(self, text: bytes, now: float) -> Wait:
        """Set the bed's target and wait for it."""
        return self._heat(self.bed, text, now)

    def _heat(self, heater: Heater, text: bytes, now: float) -> Wait:
        """Set a target and wait for it: S while it heats, R also while it cools."""
        either = word(text, "R")
        target = word(text, "S") if either is None else either
        if target is not None:
            heater.set(target, now)
        if not heater.target or (either is None and not heater.heating):
            return Wait.NO
        self._awaited, self.heat_until = heater, max(heater.settled(), now)
        self._next_heat = now + 1.0
        self._plan_reports()
        return Wait.HEAT


def _power(heater: Heater, now: float) -> int:
    """Return what a heater is driven with, 0 to 127."""
    if not heater.target or now < heater.there:
        return 127 if heater.target and heater.heating else 0
    kind = heater.kind
    return round(127 * max(heater.target - kind.ambient, 0.0) / (kind.hottest - kind.ambient))
