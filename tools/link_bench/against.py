"""The table against the hosts that were there first: one fault at line 150 of 300, each host to the same printer.

Ours numbers from BASE, so its faults strike that much further on; all else is the same job, port and time limit.
Faults that take time are felt in real time (`--speed 1`); the job's motion takes none to speak of.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from gcodectl.link.job import BASE
from link_bench.octoprint_host import OctoPrint
from link_bench.peer_faults import LONG_LINE, PEERS, strike
from link_bench.peers import FINISHED, HANG, ROOT, Outcome

FAULTS = (
    "lost-ok", "garble-out", "lost-line", "checksum", "checksum-no-ok", "missing-checksum", "duplicate-resend",
    "bogus-resend", "future-resend", "garble-in", "reset", "close=2", LONG_LINE,
)  # fmt: skip
HOSTS = ("printcore", "octoprint", "marlin-host")
LIMIT_S = 40.0
OURS = "gcodectl"
OWN_LINES = 4
"""The link's own numbered lines before the job's first."""


def run_gcodectl(port: str | Path, file: Path, timeout: float) -> Outcome:
    """Print `file` with `gcodectl stream`."""
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as state:
        try:
            done = subprocess.run(
                [sys.executable, "-m", "gcodectl.cli.main", "stream", str(file), "--port", str(port)],
                capture_output=True, text=True, timeout=timeout, check=False,
                env={**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": state},
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return Outcome(OURS, HANG, time.monotonic() - begun)
    said = done.stderr.strip().splitlines() or [""]
    ended = FINISHED if done.returncode == 0 else f"exit {done.returncode}: {said[-1].removeprefix('gcodectl: ')}"
    return Outcome(OURS, ended, time.monotonic() - begun)


def measured_peers() -> list[dict[str, Any]]:
    """Return a cell a host and fault; installs the hosts where they are missing."""
    subprocess.run([str(ROOT / "tools" / "peers.sh")], check=True, env={**os.environ, "PYTHON": sys.executable})
    PEERS[OURS] = run_gcodectl
    cells = []
    with tempfile.TemporaryDirectory() as name:
        base = Path(name)
        with OctoPrint(base, ports=[f"{name}/*/tty"]) as octoprint:
            for fault in FAULTS:
                for host in (OURS, *HOSTS):
                    cells.append(_cell(host, fault, base, octoprint))
    return cells


def _cell(host: str, fault: str, base: Path, octoprint: OctoPrint) -> dict[str, Any]:
    folder = base / f"{host}-{fault}"
    folder.mkdir()
    shift = BASE + OWN_LINES if host == OURS else 0
    spec = f"{fault}={140 + shift}" if fault == "bogus-resend" else fault
    server = octoprint if host == "octoprint" else None
    row = strike(host, spec, folder, timeout=LIMIT_S, octoprint=server, shift=shift)
    return {
        "peer": host, "fault": fault, "verdict": row.verdict, "seconds": row.seconds, "missing": row.missing,
        "repeated": row.repeated, "exact": row.exact, "ended": row.ended,
    }  # fmt: skip
