"""Lines a second over a pty: our sender beside a bare pyserial loop that does nothing but write a line and read its ok.

Both send the same job to the same answering process (`responder`), in turns; figures are ratios of the same round,
medians over rounds. The bare loop sends lines without numbers: what numbering, checksums and keeping every line cost
is part of ours.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import serial

from gcodectl.link.host import Host
from gcodectl.link.job import Line
from gcodectl.link.sender import Sender
from gcodectl.link.settings import Settings
from gcodectl.link.transport import open_port

RESPONDER = Path(__file__).parent / "responder.py"


def job(count: int) -> list[Line]:
    """Make a job of `count` moves as a slicer writes them."""
    return [Line(i + 1, b"G1 X%.3f Y%.3f E%.5f" % (50 + i % 40, 60 + i % 30, i * 0.01)) for i in range(count)]


@contextmanager
def responder(latency: float, rate: float = 0.0) -> Iterator[str]:
    """Start an answering process; gives the name of its port."""
    command = [sys.executable, str(RESPONDER), str(latency), str(rate)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def bare(port: str, lines: list[Line]) -> float:
    """Send a line, read its ok, and so on; returns lines a second."""
    with serial.Serial(port, 115200, timeout=10) as link:
        began = time.perf_counter()
        for line in lines:
            link.write(line.command + b"\n")
            link.readline()
        return len(lines) / (time.perf_counter() - began)


def ours(port: str, lines: list[Line], window: int) -> float:
    """Send the job as `gcodectl stream` does; returns lines a second from its first line to its last answer."""
    times: list[float] = []

    def timed() -> Iterator[Line]:
        times.append(time.perf_counter())
        yield from lines

    host = Host(timed(), Settings(window=window), time.monotonic())
    Sender(host, lambda: open_port(port, 115200)).run()
    if host.failure is not None:
        raise host.failure
    return len(lines) / (time.perf_counter() - times[0])


def measured_throughput(rounds: int, count: int) -> list[dict[str, Any]]:
    """Return a cell a setting: the ratio of ours to the bare loop, each round's and the median."""
    cells = []
    for latency, windows, number in ((0.0, (1, 4), count), (0.004, (1, 4), max(count // 40, 100))):
        lines = job(number)
        ratios: dict[int, list[float]] = {window: [] for window in windows}
        plain = []
        for _ in range(rounds):
            with responder(latency) as port:
                plain.append(bare(port, lines))
            for window in windows:
                with responder(latency) as port:
                    ratios[window].append(ours(port, lines, window) / plain[-1])
        for window in windows:
            cells.append({
                "name": f"throughput, window {window}, replies {latency * 1000:g} ms late",
                "ratio": float(np.median(ratios[window])), "least": min(ratios[window]), "most": max(ratios[window]),
                "bare_lines_s": float(np.median(plain)), "lines": number,
            })  # fmt: skip
    return cells


def measured_load(seconds: float, rate: float = 500.0) -> dict[str, Any]:
    """Return the share of a core that a stream at `rate` lines a second takes."""
    lines = job(round(seconds * rate))
    with responder(0.0, rate) as port:
        before, began = os.times(), time.perf_counter()
        reached = ours(port, lines, 1)
        after, took = os.times(), time.perf_counter() - began
    used = after.user - before.user + after.system - before.system
    return {"name": f"load at {rate:g} lines/s", "share": used / took, "lines_s": reached, "seconds": took}
