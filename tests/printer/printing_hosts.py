"""What the tests of the virtual printer share: a motion of fixed blocks, and hosts that send line by line."""

from __future__ import annotations

import math
from collections import deque

from gcodectl.config import Machine, load_machine
from gcodectl.link.dialect import Dialect
from gcodectl.link.wire import numbered
from plant_models.printer.faults import parse_faults
from plant_models.printer.virtual import VirtualPrinter

MACHINE: Machine = load_machine("syringe")


class Blocks:
    """A motion double: every G1 is a block of 1 s, 16 are buffered; G4 P, M400 and G28 wait as they should."""

    def __init__(self) -> None:
        self.ends: deque[float] = deque()
        self.pending = self.sync = False
        self.until = 0.0
        self.taken: list[bytes] = []
        self.x = 0.0

    @property
    def idle(self) -> bool:
        return not self.ends and self.ready()

    def take(self, text: bytes, now: float) -> None:
        assert self.ready()
        self.taken.append(text)
        if text.startswith(b"G1 "):
            self.pending = True
            if b"X" in text:
                self.x = float(text.split(b"X")[1].split()[0])
        elif text.startswith(b"G4 P"):
            self.until = now + float(text[4:]) / 1000
        self.sync = text in (b"M400", b"G28")
        self._go(now)

    def _go(self, now: float) -> None:
        while self.ends and self.ends[0] <= now:
            self.ends.popleft()
        if self.pending and len(self.ends) < 16:
            self.ends.append(max(self.ends[-1] if self.ends else now, now) + 1.0)
            self.pending = False
        if self.until <= now:
            self.until = 0.0
        if not self.ends:
            self.sync = False

    def ready(self) -> bool:
        return not (self.pending or self.sync or self.until)

    def advance(self, now: float) -> None:
        self._go(now)

    def deadline(self) -> float:
        return min(self.ends[0] if self.ends else math.inf, self.until or math.inf)

    def free(self) -> int:
        return 16 - len(self.ends)

    def position(self) -> tuple[float, float, float, float]:
        return self.x, 0.0, 0.0, 0.0

    def quickstop(self, now: float) -> None:
        self._go(now)
        self.ends.clear()
        self.pending = self.sync = False
        self.until = 0.0


def printer(faults: str = "", seed: int = 0, greeting: bool = False, **dialect: object) -> VirtualPrinter:
    """A printer with the motion double; silent at boot unless told otherwise."""
    return VirtualPrinter(
        MACHINE, dialect=Dialect(greeting=greeting, **dialect), faults=parse_faults(faults), seed=seed, motion=Blocks()
    )  # type: ignore[arg-type]


def ask(one: VirtualPrinter, *lines: bytes, now: float | None = None) -> bytes:
    """Send bare lines now; return what is said at once."""
    one.receive(b"".join(line + b"\n" for line in lines), one.now if now is None else now)
    return one.transmit()


def wait(one: VirtualPrinter, seconds: float) -> bytes:
    """Let time pass; return what is said."""
    one.advance(one.now + seconds)
    return one.transmit()


def send(one: VirtualPrinter, number: int, text: bytes) -> bytes:
    """Send a numbered line; return what is said at once."""
    one.receive(numbered(number, text), one.now)
    return one.transmit()


def job(one: VirtualPrinter, count: int, patience: float = 30.0) -> list[bytes]:
    """Send lines 1 to `count` one by one, each until it is acknowledged; return the lines that the printer said.

    A plain host: it sends again what `Resend` asks for, and asks with M110 after `patience` s without a word.
    """
    said: list[bytes] = []
    number = 1
    while number <= count:
        one.receive(numbered(number, b"G4 P%d" % number), one.now)
        heard = one.transmit()
        deadline = one.now + patience
        while b"ok" not in heard and one.now < deadline and one.alive:
            one.advance(min(max(one.deadline(), one.now), deadline))
            heard += one.transmit()
        said += heard.splitlines()
        if not one.alive:
            break
        asked = [line for line in heard.splitlines() if line.startswith(b"Resend: ")]
        number = int(asked[-1][8:]) if asked else number + 1
    return said
