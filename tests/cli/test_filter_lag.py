"""From a pipe that stays open: lines leave within LAG seconds of motion of the last that came, never by file size."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from streaming import PATIENCE

from gcodectl.cli.filter import LAG
from gcodectl.columns import Floats
from gcodectl.config import load_machine
from gcodectl.pipeline import Options, read_moves, time_moves

ROOT = Path(__file__).parents[2]
MARK = re.compile(rb";at (\d+)")


def part(layers: int) -> list[bytes]:
    """Squares of 20 mm, a layer each, with a travel between; after every line a comment that says which it was."""
    moves = [b"G21", b"G90", b"M83", b"G28", b"G1 X0 Y0 Z0.5 F3000"]
    for layer in range(layers):
        corners = ((20, 0), (20, 20), (0, 20), (0, 1))
        moves += [b"G1 X%d Y%d E0.04 F900" % one for one in corners]
        moves += [b"G1 E-0.01 F600", b"G1 X0 Y0 Z%.1f F3000" % (1.0 + 0.5 * layer), b"G1 E0.01 F600"]
    return [b"%s\n;at %d\n" % (move, number) for number, move in enumerate(moves)]


def times(lines: list[bytes]) -> Floats:
    """When the motion plan has done each line, s."""
    done = np.zeros(2 * len(lines) + 1)
    machine = load_machine("syringe")
    for moves, _, phases in time_moves(read_moves([b"".join(lines)], Options(machine)), machine):
        np.maximum.at(done, moves.line[phases.row - moves.row[0]], phases.t + phases.duration)
    return np.maximum.accumulate(done)[1::2]


@pytest.mark.parametrize("material", ["neutral", "clay"])
def test_lines_leave_while_the_pipe_is_open(material: str) -> None:
    lines = part(60)
    done = times(lines)
    assert done[-1] > 8 * LAG, "much longer than what may be held back"
    process = subprocess.Popen(
        [sys.executable, "-m", "gcodectl.cli.main", "filter", "--material", material],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])},
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    late = threading.Timer(PATIENCE, process.kill)
    late.start()
    fed, left = 0, -1
    for share in (0.15, 0.16, 0.5, 0.9):
        there = int(share * len(lines))
        process.stdin.write(b"".join(lines[fed:there]))
        process.stdin.flush()
        fed = there
        due = int(np.searchsorted(done, done[fed - 1] - LAG)) - 1
        while left < due:
            text = process.stdout.readline()
            assert text, f"it ended, or held back more than {LAG} s: {left} of {due} lines after {fed}"
            left = int(found.group(1)) if (found := MARK.search(text)) else left
        assert left < fed, "the pipe is open"
    process.stdin.close()
    process.stdin = None
    rest, _ = process.communicate()
    late.cancel()
    assert process.returncode == 0
    assert int(MARK.findall(rest)[-1]) == fed - 1
