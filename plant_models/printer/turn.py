"""A command's turn: what the one that is carried out waits for, what holds it up, and when it says that it is busy."""

from __future__ import annotations

import math

from gcodectl.link.receiver import Queued
from plant_models.printer.codes import Wait
from plant_models.printer.motion import Motion


class Turn:
    """The command in progress, if there is one; one turn after the other. Times s."""

    def __init__(self) -> None:
        self.command: Queued | None = None
        self.wait = Wait.NO
        self.busy_at = math.inf
        """When it is to be said next that it is busy."""
        self._delayed = self._silent = -math.inf

    def prepare(self) -> None:
        """A command comes: nothing holds it up so far."""
        self._delayed = self._silent = -math.inf

    def delay(self, until: float, silent: bool) -> None:
        """Hold the command up, silently or not."""
        self._delayed = max(self._delayed, until)
        if silent:
            self._silent = self._delayed

    def begin(self, command: Queued, busy_at: float) -> None:
        """Begin the command; set `wait` to what it waits for."""
        self.command, self.busy_at = command, busy_at

    def end(self) -> None:
        """It is over."""
        self.command = None

    def over(self, now: float, motion: Motion, heat_until: float) -> bool:
        """Whether all that the command waits for is over."""
        if self.wait is Wait.MOTION:
            if not motion.ready():
                return False
        elif self.wait is Wait.HEAT and now < heat_until:
            return False
        return now >= self._delayed

    def due(self, now: float, heat_until: float) -> float:
        """Return when it may be over, as far as time alone decides, or is to say that it is busy."""
        over = max(heat_until if self.wait is Wait.HEAT else -math.inf, self._delayed)
        return min(over, self.busy_at) if over > now else self.busy_at

    def silent(self, now: float) -> bool:
        """Whether nothing is said."""
        return now < self._silent

    def speaks_at(self, at: float) -> float:
        """Return when what is to be said at `at` can be said."""
        return max(at, self._silent) if self.command is not None else at
