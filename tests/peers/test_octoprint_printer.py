"""Our streamer prints through OctoPrint's VirtualPrinter class, its default faults included.

That class is no oracle for exactly-once: it swallows line 105 after it has asked for it again. So what is checked is
what it was sent: every line of the job, in order, first time each.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from link_bench import peers as installed
from link_bench.jobs import commands, without_own

from gcodectl.link.job import BASE

ROOT = Path(__file__).resolve().parents[2]
JOB = "paste_testmodel_prusaslicer.gcode"
"""359 commands without waits: past all four faults (lines 100 to 115) in a few seconds."""
LIMIT_S = 200
"""A first run compiles the motion plan's kernels."""


@contextmanager
def octoprint_virtual(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Serve the class on a pty while the block runs; yields the port and the log of what arrives."""
    port, log = folder / "tty", folder / "arrived"
    with subprocess.Popen(
        [installed.PYTHON, Path(__file__).with_name("octoprint_virtual.py"), port, log, folder / "basedir",
         str(BASE)],
        stdout=subprocess.PIPE, stderr=(folder / "stderr").open("w"), text=True, start_new_session=True,
        env=installed.environment(str(folder)),
    ) as process:  # fmt: skip
        try:
            assert process.stdout
            assert process.stdout.readline() == "ready\n", (folder / "stderr").read_text()
            yield port, log
        finally:
            installed.end(process)


def first_of_each(log: Path) -> dict[int, bytes]:
    """The commands that came numbered, as they came first; M110 begins anew."""
    found: dict[int, bytes] = {}
    for line in log.read_bytes().splitlines():
        match = re.fullmatch(rb"N(\d+) ?(.*)\*(\d+)", line)
        if match and b"M110" not in line:
            found.setdefault(int(match[1]), match[2].strip())
    return found


@pytest.mark.usefixtures("peers")
@pytest.mark.parametrize("more", [(), ("--window", "4")])
def test_every_line_of_a_job_arrives(corpus: Path, tmp_path: Path, more: tuple[str, ...]):
    with octoprint_virtual(tmp_path) as (port, log):
        done = subprocess.run(
            [sys.executable, "-m", "gcodectl.cli.main", "stream", corpus / JOB, "--port", port, "--json", *more],
            capture_output=True, text=True, timeout=LIMIT_S, check=False, env={**os.environ, "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    end = json.loads(done.stdout.splitlines()[-1])
    assert (end["event"], end["ok"]) == ("end", True)
    assert end["resent"] >= 4, "not all of the four simulated errors came about"
    arrived = first_of_each(log)
    sent = without_own([arrived[number] for number in sorted(arrived)])
    job = without_own(commands(corpus / JOB))
    assert sent == job
