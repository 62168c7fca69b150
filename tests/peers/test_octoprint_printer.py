"""Our streamer prints through OctoPrint's VirtualPrinter class, its default faults included.

That class is no oracle for exactly-once: it swallows line 105 after it has asked for it again. So what is checked is
what it was sent: every line of the job, in order, first time each.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from link_bench.jobs import commands
from link_bench import peers as installed

JOB = "paste_testmodel_prusaslicer.gcode"
"""359 commands without waits: past all four faults (lines 100 to 115) in a few seconds."""
LIMIT_S = 90


@contextmanager
def octoprint_virtual(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Serve the class on a pty while the block runs; yields the port and the log of what arrives."""
    port, log = folder / "tty", folder / "arrived"
    with subprocess.Popen(
        [installed.PYTHON, Path(__file__).with_name("octoprint_virtual.py"), port, log, folder / "basedir"],
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


def test_every_line_of_a_job_arrives(peers: None, corpus: Path, tmp_path: Path):
    with octoprint_virtual(tmp_path) as (port, log):
        done = subprocess.run(
            [sys.executable, "-m", "gcodectl.cli.main", "stream", corpus / JOB, "--port", port, "--json"],
            capture_output=True, text=True, timeout=LIMIT_S, check=False,
        )  # fmt: skip
    if "No such command" in done.stderr:
        pytest.skip("gcodectl has no stream command yet")
    assert done.returncode == 0, done.stderr
    assert all(isinstance(json.loads(line), dict) for line in done.stdout.splitlines())
    arrived = first_of_each(log)
    job = commands(corpus / JOB)
    sent = [arrived[number] for number in sorted(arrived)]
    assert [one for one in sent if one in set(job)] == job
    resent = log.read_bytes().splitlines()
    assert len(resent) > len(set(resent)), "none of the simulated errors came about"
