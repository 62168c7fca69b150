"""Read one G-code file with a peer, in the peer's own Python: `peer_drive.py NAME FILE`."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path


def gcodeparser(path: str) -> None:
    """gcodeparser: every line to an object."""
    module = import_module("gcodeparser")
    assert module.GcodeParser(Path(path).read_text(), include_comments=True).lines


def printrun(path: str) -> None:
    """Printrun's gcoder: lines, layers, times."""
    module = import_module("printrun.gcoder")
    with Path(path).open() as file:
        assert module.GCode(file).lines


def octoprint(path: str) -> None:
    """OctoPrint's interpreter: extents, filament, time."""
    module = import_module("octoprint.util.gcodeInterpreter")
    found = module.gcode()
    found.load(path)
    assert found.totalMoveTimeMinute > 0


def copy(path: str) -> None:
    """Python, reading lines and writing them as they are."""
    with Path(path).open("rb") as file:
        for line in file:
            sys.stdout.buffer.write(line)


if __name__ == "__main__":
    {"gcodeparser": gcodeparser, "printrun": printrun, "octoprint": octoprint, "copy": copy}[sys.argv[1]](sys.argv[2])
