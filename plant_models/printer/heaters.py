"""A heater that takes its time: first order towards full power or the room, and its target held once it is there.

    T
    | target - - - - -.-----------        heating: T -> hottest, until T = target
    |             .                       cooling: T -> ambient, until T = target
    |         .                           held: T = target
    +-----------------------------> t

In closed form, so that time may pass in any steps. Units: degC, s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class HeaterKind:
    """What a heater is like."""

    hottest: float
    """Where full power for ever would bring it."""
    limit: float
    """Targets above are taken as this (MAXTEMP less its margin)."""
    tau: float
    ambient: float = 21.0
    residency: float = 10.0
    """How long it must have been at its target before waiting ends (TEMP_RESIDENCY_TIME)."""


HOTEND = HeaterKind(hottest=420.0, limit=260.0, tau=90.0)
BED = HeaterKind(hottest=160.0, limit=110.0, tau=180.0)


class Heater:
    """One heater: set a target, ask for the temperature at a time that does not go back."""

    def __init__(self, kind: HeaterKind = HOTEND) -> None:
        self.kind = kind
        self.target = 0.0
        self._begin, self._from = 0.0, kind.ambient

    def set(self, target: float, now: float) -> None:
        """Go for another target, degC; 0: off."""
        self._from, self._begin = self.temperature(now), now
        self.target = min(max(target, 0.0), self.kind.limit)

    def temperature(self, now: float) -> float:
        """Return the temperature at `now`."""
        if now >= self.there:
            return self._goal
        drive = self._drive
        return drive + (self._from - drive) * math.exp(-(now - self._begin) / self.kind.tau)

    @property
    def heating(self) -> bool:
        """Whether the target lies above the temperature that it was set at."""
        return self._goal > self._from

    @property
    def there(self) -> float:
        """When the target is reached, s."""
        goal, drive = self._goal, self._drive
        if goal == self._from:
            return self._begin
        near = goal if self.heating else max(goal, drive + 0.5)  # the room is reached only for ever: half a degree is
        return self._begin + self.kind.tau * max(math.log((self._from - drive) / (near - drive)), 0.0)

    def settled(self) -> float:
        """Return when waiting for the target ends, s."""
        return self.there + self.kind.residency

    @property
    def _goal(self) -> float:
        return max(self.target, self.kind.ambient)

    @property
    def _drive(self) -> float:
        return self.kind.hottest if self.heating else self.kind.ambient
