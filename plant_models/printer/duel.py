"""A host against a virtual printer under a virtual clock: no port, no waiting, the same every time.

    host --- bytes, `latency` s later ---> printer
         <--- bytes, `latency` s later ---

Both have the same four verbs; here is who calls them: whatever comes next, an arrival or a deadline, happens next.
"""

from __future__ import annotations

import math
from collections import deque
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
    host: Player, printer: VirtualPrinter, *, latency: float = 0.0005, limit: float = DAY, after: float = 5.0
) -> float:
    """Run until the host has ended, and the printer `after` s longer; returns when the host ended, s.

    inf where it had not by `limit`. A port that the printer closes is gone for the host at once, and back at once.
    """
    now, ended_at, gone = 0.0, math.inf, False
    down: deque[tuple[float, bytes]] = deque()
    up: deque[tuple[float, bytes]] = deque()
    while now <= limit and now <= ended_at + after:
        if data := host.transmit():
            down.append((now + latency, data))
        if data := printer.transmit():
            up.append((now + latency, data))
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
        now = _next(host, printer, down, up, now)
        if now == math.inf:
            break
        while down and down[0][0] <= now:
            printer.receive(down.popleft()[1], now)
        while up and up[0][0] <= now:
            host.receive(up.popleft()[1], now)
        if host.deadline() <= now:
            host.advance(now)
        if printer.deadline() <= now:
            printer.advance(now)
    return ended_at


def _next(
    host: Player, printer: VirtualPrinter, down: deque[tuple[float, bytes]], up: deque[tuple[float, bytes]], now: float
) -> float:
    """Return when the next thing happens."""
    times = [host.deadline(), printer.deadline()]
    if down:
        times.append(down[0][0])
    if up:
        times.append(up[0][0])
    return max(now, min(times))
