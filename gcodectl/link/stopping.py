"""What makes a printer safe: heaters off, the plunger's pressure released, and its own word that it is so.

In good order (cancelled): numbered, like the job, so that nothing arrives damaged.
Where the link or the firmware is in doubt: bare lines, which firmware takes whatever number it waits for, again and
again until an M105 shows no heater with a target, or the tries are used up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from gcodectl.link.replies import Heat

TRIES = 5
BETWEEN = 2.0
"""s from one try to the next."""
RELEASE_FEED = 300
"""mm/min of E."""


def heaters_off(heats: Mapping[str, Heat]) -> list[bytes]:
    """Return the commands that switch off every heater the printer has told of, the hotend in use and the bed."""
    tools = sorted({name[1:] for name in heats if name[0] == "T" and name[1:]})
    chamber = [b"M141 S0"] if "C" in heats else []
    return [b"M104 S0", *(b"M104 T%d S0" % int(tool) for tool in tools if tools != ["0"]), b"M140 S0", *chamber]


def release(pull_back: float) -> list[bytes]:
    """Return the commands that pull the plunger back by so many mm of E; none for 0."""
    return [b"M83", b"G1 E-%.4f F%d" % (pull_back, RELEASE_FEED)] if pull_back > 0 else []


class Stopping:
    """The stop in progress: numbered first or bare at once, until the printer says that it is safe or time is up."""

    def __init__(self, *, orderly: bool, within: float, now: float) -> None:
        self.orderly = orderly
        self.confirmed = False
        self._within = within
        self._until = now + within
        self._tries = 0
        self._next_try = math.inf if orderly else now

    def alive(self, now: float) -> None:
        """Take a sign of life: a printer that is at it is waited for."""
        self._until = now + self._within

    def hurry(self, now: float, tries: int = TRIES) -> None:
        """Go on with bare lines, from now."""
        self.orderly = False
        self._tries = TRIES - tries
        self._next_try = now

    def due(self, now: float) -> bool:
        """Whether another try with bare lines is due; counts it."""
        if self.orderly and now >= self._until:
            self.hurry(now)
        if now < self._next_try or self.over(now):
            return False
        self._tries += 1
        self._next_try = now + BETWEEN
        return True

    def over(self, now: float) -> bool:
        """Whether all tries were in vain."""
        return not self.orderly and self._tries >= TRIES and now >= self._next_try

    @property
    def deadline(self) -> float:
        """When it has to be looked at again."""
        return self._until if self.orderly else self._next_try
