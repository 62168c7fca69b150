"""Does the printer's planner ever run dry while a file is filtered on the way to it?

The host pulls the filtered lines as `gcodectl stream --filter` does, a few ahead; a virtual clock carries bytes at the
baud rate and replies late, the printer plans in a ring of 16 blocks. What filtering takes is measured here, by the real
clock, and passes on the virtual one: a line is ready no sooner than this machine would have had it.

    filter --(seconds measured)--> at most AHEAD lines --> host --(baud)--> queue of 4 --> ring of 16 --> motion
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from gcodectl.cli.jobs import AHEAD, PIECE
from gcodectl.config import load_machine
from gcodectl.flow.library import builtin_libraries, load_library
from gcodectl.gcode.lines import read_chunks
from gcodectl.link.host import Host
from gcodectl.link.job import Line, read_lines
from gcodectl.link.sender import HUNGRY
from gcodectl.link.settings import Settings
from gcodectl.pipeline import Options, filter_stream
from plant_models.gantry import Firmware
from plant_models.printer.duel import duel
from plant_models.printer.live import Live
from plant_models.printer.virtual import VirtualPrinter


class Paced:
    """A source whose items are ready when making them, as measured, would have been done."""

    def __init__(self, source: Iterator[Line], most: int, now: Callable[[], float]) -> None:
        self._source, self._most, self._now = source, most, now
        self._ready: deque[tuple[float, Line]] = deque()
        self._maker = 0.0
        self._ended = False
        self.seconds = 0.0
        """That making them all took."""
        self.longest = 0.0

    def __iter__(self) -> Iterator[Line | None]:
        return self

    def __next__(self) -> Line | None:
        now = self._now()
        while len(self._ready) < self._most and not self._ended:
            began = time.perf_counter()
            item = next(self._source, None)
            took = time.perf_counter() - began
            self.seconds, self.longest = self.seconds + took, max(self.longest, took)
            if item is None:
                self._ended = True
            else:
                full = len(self._ready) == self._most - 1
                self._maker = max(self._maker, now if full else 0.0) + took
                self._ready.append((self._maker, item))
        if not self._ready:
            raise StopIteration
        return self._ready.popleft()[1] if self._ready[0][0] <= now else None


class Hungry(Host):
    """A host that comes back for a line that was not ready, as the sender does."""

    def deadline(self) -> float:
        """Return when to come back."""
        return min(super().deadline(), self.now + HUNGRY if self.hungry else math.inf)


def measured_starving(
    file: Path, machine: str, material: str, *, baud: float, latency: float, window: int
) -> dict[str, Any]:
    """Stream a file through the filter to a virtual printer; returns what its planner had in hand at the least."""
    profile = load_machine(machine)
    options = Options(profile, (load_library(builtin_libraries()[material]).find(material, profile.nozzle),))
    data = filter_stream(_opened(file), options)
    paced: Paced

    def lines() -> Iterator[Line | None]:
        yield from paced

    host = Hungry(lines(), dataclasses.replace(Settings(), window=window))
    paced = Paced(read_lines(data, str(file)), AHEAD, lambda: host.now)
    live = Live(profile, Firmware())
    printer = VirtualPrinter(profile, motion=live)
    duel(host, printer, baud=baud, latency=latency)
    if host.failure is not None:
        raise host.failure
    motion = live.execution().duration
    return {
        "file": file.name, "machine": machine, "material": material, "baud": baud, "latency_s": latency,
        "window": window, "lines": len(printer.executed), "motion_s": motion,
        "starved": len(live.starved), "starved_s": sum(seconds for _, seconds in live.starved),
        "least_buffered_s": live.least_buffered, "filter_s": paced.seconds, "longest_piece_s": paced.longest,
    }  # fmt: skip


def _opened(file: Path) -> Iterator[bytes]:
    with file.open("rb") as stream:
        yield from read_chunks(stream, PIECE)
