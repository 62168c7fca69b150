"""Other hosts, each printing one file to one port within a time limit; none outlives its run.

    run_printcore(port, file, timeout)      Printrun's printcore, from Python
    run_pronsole(port, file, timeout)       Debian's pronsole, through a pipe
    run_octoprint(port, file, timeout)      OctoPrint, by REST (one server for many jobs: octoprint_host.OctoPrint)
    run_marlin_host(port, file, timeout)    marlin-host, numbered lines
    run_mecode(port, file, timeout)         mecode, writing directly

`tools/peers.sh` installs them into build/peers; `missing()` says what is not there.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PEERS = ROOT / "build" / "peers"
PYTHON = PEERS / "bin" / "python"
DRIVERS = Path(__file__).resolve().parent / "drivers"
FINISHED, HANG = "finished", "hang"


@dataclass(frozen=True)
class Outcome:
    """How a peer's job ended: `finished`, `hang` (the time limit came first), or what the peer said of it."""

    peer: str
    ended: str
    seconds: float
    """From the peer's start to its end, its own start-up included."""
    printing_s: float | None = None
    """From the first line to the last, where the peer tells."""
    errors: tuple[str, ...] = ()
    """What the peer complained of on the way."""


def missing() -> list[str]:
    """What `tools/peers.sh` would install and is not there."""
    return [
        name
        for name, there in (
            ("build/peers", (PEERS / ".made-of").exists()),
            ("pronsole", bool(shutil.which("pronsole"))),
        )
        if not there
    ]


def run_printcore(port: str | Path, file: Path, timeout: float) -> Outcome:
    """Print `file` with Printrun's printcore."""
    return _drive("printcore", port, file, timeout)


def run_marlin_host(port: str | Path, file: Path, timeout: float) -> Outcome:
    """Print `file` with marlin-host."""
    return _drive("marlin_host", port, file, timeout)


def run_mecode(port: str | Path, file: Path, timeout: float) -> Outcome:
    """Print `file` with mecode's direct mode."""
    return _drive("mecode", port, file, timeout)


def run_octoprint(port: str | Path, file: Path, timeout: float) -> Outcome:
    """Print `file` with an OctoPrint of its own; its start takes some seconds that `printing_s` leaves out."""
    from link_bench.octoprint_host import OctoPrint

    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder, OctoPrint(Path(folder), ports=[str(port)]) as octoprint:
        outcome = octoprint.run(port, file, timeout)
    return Outcome("octoprint", outcome.ended, time.monotonic() - begun, outcome.printing_s, outcome.errors)


def run_pronsole(port: str | Path, file: Path, timeout: float) -> Outcome:
    """Print `file` with Debian's pronsole, driven through a pipe."""
    from link_bench.pronsole_host import run

    begun = time.monotonic()
    ended, errors = run(str(port), file, timeout)
    return Outcome("pronsole", ended, time.monotonic() - begun, errors=errors)


def _drive(name: str, port: str | Path, file: Path, timeout: float) -> Outcome:
    """Run a driver with the peers' Python; its last lines tell how it went."""
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as home:
        process = subprocess.Popen(
            [PYTHON, DRIVERS / f"drive_{name}.py", str(port), str(file)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, env=environment(home),
        )  # fmt: skip
        try:
            out, err = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            end(process)
            return Outcome(name, HANG, time.monotonic() - begun)
    told = {}
    for line in out.splitlines():
        if line.startswith("{"):
            told.update(json.loads(line))
    ended = told.get("ended") or (err.strip().splitlines() or [f"ended with status {process.returncode}"])[-1]
    return Outcome(name, ended, time.monotonic() - begun, told.get("printing_s"), tuple(told.get("errors", ())))


def environment(home: str) -> dict[str, str]:
    """The environment peers run in: a home of their own, and no way out but loopback for what heeds a proxy."""
    nowhere = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
    kept = {name: value for name, value in os.environ.items() if name in ("PATH", "LANG", "LC_ALL", "TMPDIR")}
    return {**kept, **nowhere, "no_proxy": "127.0.0.1,localhost", "HOME": home, "PYTHONUNBUFFERED": "1"}


def end(process: subprocess.Popen[str]) -> None:
    """End a peer and all that it started; it must have been started in a session of its own."""
    for sign in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, sign)
        except ProcessLookupError:
            break
        try:
            process.wait(3)
            break
        except subprocess.TimeoutExpired:
            continue
    process.communicate()
