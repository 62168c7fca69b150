"""Our virtual printer as a process of its own, for a host to print to."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
START_S = 240.0
"""A first start compiles kernels."""


@dataclass(frozen=True)
class Printer:
    """Where it is, and where it leaves what it did."""

    port: Path
    log: Path
    """Every line each way, with times."""
    report: Path

    def executed(self) -> list[bytes]:
        """Every command carried out, once or more, in order; there when the printer has ended."""
        return (self.report / "executed.gcode").read_bytes().splitlines()


@contextmanager
def virtual_printer(folder: Path, *options: str, machine: str = "syringe", speed: str = "max") -> Iterator[Printer]:
    """Run `gcodectl virtual-printer` at `folder`/tty while the block runs; RuntimeError where it fails."""
    printer = Printer(folder / "tty", folder / "wire.log", folder / "report")
    said = folder / "printer.err"
    with said.open("w") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "gcodectl.cli.main", "virtual-printer", "--machine", machine, "--link", printer.port,
             "--speed", speed, "--log", printer.log, "--report", printer.report, *options],
            stderr=errors, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
    try:
        until = time.monotonic() + START_S
        while "a printer is at" not in said.read_text():
            if process.poll() is not None or time.monotonic() > until:
                raise RuntimeError(f"the virtual printer did not start: {said.read_text().strip()[-500:]}")
            time.sleep(0.02)
        yield printer
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise RuntimeError(f"the virtual printer does not end: {said.read_text().strip()[-500:]}") from None
    if process.returncode:
        raise RuntimeError(f"the virtual printer failed: {said.read_text().strip()[-2000:]}")
