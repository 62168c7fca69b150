"""What the tests of `gcodectl stream` share: a virtual printer on a pty, served in a thread, and the command itself."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gcodectl.config import load_machine
from gcodectl.link.dialect import Dialect
from plant_models.printer.faults import parse_faults
from plant_models.printer.pty_port import PtyPort
from plant_models.printer.serve import Server
from plant_models.printer.virtual import VirtualPrinter

PATIENCE = 300.0
"""s; far more than anything here takes, kernels that are to be compiled included."""
MACHINE = load_machine("syringe")


class Printer:
    """A printer that answers at `port` until the test ends; `moves` are the G1 it carried out."""

    def __init__(self, link: Path, faults: str = "", **dialect: Any) -> None:
        self.port = str(link)
        self.inner = VirtualPrinter(MACHINE, dialect=Dialect(**dialect), faults=parse_faults(faults), seed=1)
        self._server = Server(self.inner, PtyPort(link), speed=math.inf)
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._server.run, kwargs={"ready": self._ready.set})

    def __enter__(self) -> Printer:
        self._thread.start()
        assert self._ready.wait(PATIENCE)
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()

    def dies(self) -> bool:
        """Whether it halts; what was sent last may still be on its way."""
        waiting = threading.Event()
        return any(not self.inner.alive or waiting.wait(0.01) for _ in range(int(PATIENCE / 0.01)))

    @property
    def done(self) -> list[bytes]:
        return [one.text for one in self.inner.executed]

    @property
    def moves(self) -> list[bytes]:
        return [text for text in self.done if text.startswith(b"G1 X")]


class Ended:
    """How a run of the command ended."""

    def __init__(self, status: int, out: str, said: str) -> None:
        self.status, self.out, self.said = status, out, said

    @property
    def events(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.out.splitlines()]


Stream = Callable[..., Ended]
