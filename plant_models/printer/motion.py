"""What the virtual printer asks of whatever moves it, and a motion that takes no time."""

from __future__ import annotations

import math
from typing import Protocol


class Motion(Protocol):
    """What moves: one command at a time; its blocks go into a buffer that time empties. Times s, lengths mm."""

    @property
    def idle(self) -> bool:
        """Whether nothing moves and nothing is buffered."""

    def take(self, text: bytes, now: float) -> None:
        """Take a command, without number and checksum, that moves or changes how it moves."""

    def ready(self) -> bool:
        """Whether that command is done and the next may be taken."""

    def advance(self, now: float) -> None:
        """Let time pass."""

    def deadline(self) -> float:
        """Return when what is in progress ends; inf when idle."""

    def free(self) -> int:
        """Return the places left in the block buffer."""

    def position(self) -> tuple[float, float, float, float]:
        """Return X, Y, Z, E as commanded."""

    def quickstop(self, now: float) -> None:
        """Drop all blocks."""


class Still:
    """A motion that takes no time: every command is done at once, and nothing is where it was told to go."""

    @property
    def idle(self) -> bool:
        """It always is."""
        return True

    def take(self, text: bytes, now: float) -> None:
        """Take a command, and be done with it."""

    def ready(self) -> bool:
        """It always is."""
        return True

    def advance(self, now: float) -> None:
        """Nothing passes."""

    def deadline(self) -> float:
        """Nothing is ever in progress."""
        return math.inf

    def free(self) -> int:
        """Marlin's buffer of 16 holds 15."""
        return 15

    def position(self) -> tuple[float, float, float, float]:
        """It stays at home."""
        return 0.0, 0.0, 0.0, 0.0

    def quickstop(self, now: float) -> None:
        """There is nothing to stop."""
