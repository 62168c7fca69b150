"""A host against a virtual printer under a virtual clock: no port, no waiting, the same every time.

    host --- bytes, `latency` s later ---> printer
         <--- bytes, `latency` s later ---

Both have the same four verbs; here is who calls them: whatever comes next, an arrival or a deadline, happens next.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from plant_models.printer.virtual import VirtualPrinter

DAY = 86_400.0


class Player(Protocol):
    """The host, as far as a duel needs it (`gcodectl.link.host.Host`)."""

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes."""

    def advance(self, now: float) -> None:
        """Let time pass."""

    def transmit(self) -> bytes:
        """Return what is to be sent."""

    def deadline(self) -> float:
        """Return when something happens by itself."""

    @property
    def ended(self) -> bool:
        """Whether it is over."""

    def disconnected(self, why: str, now: float) -> None:
        """Learn that the port is gone."""

    def reconnected(self, now: float) -> None:
        """Learn that it is back."""


def duel(
    host: Player,
    printer: VirtualPrinter,
    *,
    latency: float = 0.0005,
    baud: float = math.inf,
    limit: float = DAY,
    after: float = 5.0,
    cut: Callable[[bytes], Sequence[bytes]] = lambda data: [data],
) -> float:
    """Run until the host has ended, and the printer `after` s longer; returns when the host ended, s.

    inf where it had not by `limit`. Bytes take `latency` s, and 10 / `baud` s each; `cut` says in what pieces they
    arrive. A port that the printer closes is gone for the host at once, and back at once.
    """
    now, ended_at, gone = 0.0, math.inf, False
    down, up = _Way(latency, baud, cut), _Way(latency, baud, cut)
    while now <= limit and now <= ended_at + after:
        if data := host.transmit():
            down.send(data, now)
        if data := printer.transmit():
            up.send(data, now)
        if printer.closed != gone:
            gone = printer.closed
            down.clear()
            up.clear()
            if gone:
                host.disconnected("the port was closed", now)
            else:
                host.reconnected(now)
            continue
        if host.ended and ended_at == math.inf:
            ended_at = now
            continue
        now = max(now, min(host.deadline(), printer.deadline(), down.next, up.next))
        if now == math.inf:
            break
        for data in down.arrived(now):
            printer.receive(data, now)
        for data in up.arrived(now):
            host.receive(data, now)
        if host.deadline() <= now:
            host.advance(now)
        if printer.deadline() <= now:
            printer.advance(now)
    return ended_at


class _Way:
    """One direction of a line."""

    def __init__(self, latency: float, baud: float, cut: Callable[[bytes], Sequence[bytes]]) -> None:
        self._latency, self._seconds, self._cut = latency, 10.0 / baud, cut
        self._free = 0.0
        self._under_way: deque[tuple[float, bytes]] = deque()

    @property
    def next(self) -> float:
        return self._under_way[0][0] if self._under_way else math.inf

    def send(self, data: bytes, now: float) -> None:
        self._free = max(self._free, now)
        for piece in self._cut(data):
            self._free += len(piece) * self._seconds
            self._under_way.append((self._free + self._latency, piece))

    def arrived(self, now: float) -> Iterator[bytes]:
        while self._under_way and self._under_way[0][0] <= now:
            yield self._under_way.popleft()[1]

    def clear(self) -> None:
        self._under_way.clear()
