"""What a printer has said and has yet to say: bytes that go out now, and bytes held back for later, in their order."""

from __future__ import annotations

import math
from collections import deque


class Outlet:
    """Bytes on their way out; none overtakes what was said before it."""

    def __init__(self) -> None:
        self._out: list[bytes] = []
        self._held: deque[tuple[float, bytes]] = deque()

    def say(self, data: bytes, due: float, now: float) -> None:
        """Send bytes at `due`, s, or when what is held back before them goes out."""
        if self._held:
            self._held.append((max(due, self._held[-1][0]), data))
        elif due > now:
            self._held.append((due, data))
        else:
            self._out.append(data)

    def release(self, now: float) -> None:
        """Send what was held back until `now`."""
        while self._held and self._held[0][0] <= now:
            self._out.append(self._held.popleft()[1])

    def flush(self) -> None:
        """Send all that was held back."""
        self.release(math.inf)

    def lose(self) -> None:
        """Forget all that has not been sent."""
        self._held.clear()
        self._out.clear()

    def hold_nothing(self) -> None:
        """Forget what was held back."""
        self._held.clear()

    @property
    def holds(self) -> bool:
        """Whether something is held back."""
        return bool(self._held)

    @property
    def due(self) -> float:
        """When the next of what is held back goes out, s; inf: nothing is."""
        return self._held[0][0] if self._held else math.inf

    def transmit(self) -> bytes:
        """Return what went out since the last call."""
        if not self._out:
            return b""
        out = b"".join(self._out)
        self._out.clear()
        return out
