"""One process, measured: wall time, processor time, peak memory, how it ended."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LAST = 200
"""Characters of its last words that are kept."""


@dataclass(frozen=True)
class Ran:
    """How a process went."""

    wall_s: float
    cpu_s: float
    peak_mb: float
    """ru_maxrss of that process, MB (1e6 bytes)."""
    status: int
    lines_out: int
    """Counted only where that was asked for."""
    said: str
    """What it wrote to stderr."""
    timed_out: bool = False

    def failure(self, allowed: Sequence[int] = (0,)) -> str:
        """Return what went wrong in a few words; empty: nothing."""
        if self.timed_out:
            return f"ended after {self.wall_s:.0f} s, the time limit"
        return "" if self.status in allowed else f"status {self.status}: {self.said.strip()[-LAST:]}"


def gcodectl(*arguments: str) -> list[str]:
    """Return the command that runs gcodectl from this source tree with this Python."""
    return [sys.executable, "-m", "gcodectl.cli.main", *arguments]


def run(
    command: Sequence[str], timeout: float = 3600.0, count: bool = False, root: Path = ROOT,
    environment: Mapping[str, str] | None = None, stdin: Path | None = None,
) -> Ran:  # fmt: skip
    """Run `command`, its output to the null device, or counted by lines; `root` is where gcodectl's source stands.

    Its modules are compiled to bytecode once, as pip does when it installs them.
    """
    env = {**os.environ, "PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "", **(environment or {})}
    with tempfile.TemporaryFile() as words, Path(stdin or os.devnull).open("rb") as source:
        begun = time.perf_counter()
        process = subprocess.Popen(
            [*command], stdin=source, stdout=subprocess.PIPE if count else subprocess.DEVNULL, stderr=words,
            env=env, cwd=root,
        )  # fmt: skip
        late = threading.Event()
        timer = threading.Timer(timeout, _end, (process, late))
        timer.start()
        lines = 0
        if process.stdout is not None:
            with process.stdout as pipe:
                while piece := pipe.read(1 << 20):
                    lines += piece.count(b"\n")
        _, status, used = os.wait4(process.pid, 0)
        wall = time.perf_counter() - begun
        timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        words.seek(0)
        said = words.read().decode(errors="replace")
    peak = used.ru_maxrss * (1.0 if sys.platform == "darwin" else 1024.0) / 1e6
    return Ran(wall, used.ru_utime + used.ru_stime, peak, process.returncode, lines, said, late.is_set())


def _end(process: subprocess.Popen[bytes], late: threading.Event) -> None:
    late.set()
    process.kill()


def median(values: Sequence[float]) -> float:
    """Return the median."""
    return float(statistics.median(values))
