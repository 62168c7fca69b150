"""What a printer has said and has yet to say.

say       bytes that go out now or are held back for later; what is said after them waits for them
announce  bytes that are to be said at a time of their own, whatever is said until then
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from heapq import heappop, heappush


class Outlet:
    """Bytes on their way out; none overtakes what was said before it."""

    def __init__(self) -> None:
        self._out: list[bytes] = []
        self._held: deque[tuple[float, bytes]] = deque()
        self._announced: list[tuple[float, bytes]] = []

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
        """Forget what was held back, and what is to be said some day."""
        self._held.clear()
        self._announced.clear()

    def announce(self, data: bytes, due: float) -> None:
        """Have bytes said at `due`, s."""
        heappush(self._announced, (due, data))

    def announced(self, now: float) -> Iterator[bytes]:
        """Yield what is to be said by now, once."""
        while self._announced and self._announced[0][0] <= now:
            yield heappop(self._announced)[1]

    @property
    def announces_at(self) -> float:
        """When the next of what is to be said some day is; inf: nothing is."""
        return self._announced[0][0] if self._announced else math.inf

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
