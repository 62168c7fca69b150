"""What a file asks for and what a printer did, made comparable.

Rule: a file's commands are its lines without comments, blanks at the ends and empty lines. Hosts add commands of their
own (they ask for temperatures and abilities, number anew, wait for the end, switch heaters off as they leave); these,
by code, are left out on both sides. Everything else must be there once, in order, and nothing else.
"""

from __future__ import annotations

import re
from pathlib import Path

OWN = frozenset({"M20", "M21", "M27", "M105", "M110", "M113", "M115", "M154", "M155", "M400"})
"""Codes that hosts send by themselves."""
_CODE = re.compile(rb"[A-Z]\d+")


def commands(file: Path) -> list[bytes]:
    """A file's commands."""
    lines = (line.partition(b";")[0].strip() for line in file.read_bytes().splitlines())
    return [line for line in lines if line]


def without_own(lines: list[bytes], also: tuple[bytes, ...] = ()) -> list[bytes]:
    """Leave out what hosts send by themselves, and whole commands that this host is known to add."""
    return [line for line in lines if code(line) not in OWN and line not in also]


def code(line: bytes) -> str:
    """A command's letter and number."""
    match = _CODE.match(line)
    return match[0].decode() if match else ""


def write_zigzag(file: Path, count: int, long_at: int = 0) -> None:
    """Write a job of `count` commands, no two alike; command `long_at` is longer than Marlin's 96 bytes.

    The moves are hundredths of a millimetre: in real time too, the job is the host's time and not the printer's.
    """
    lines = [f"G1 X{10 + k % 2 / 100:.2f} Y{10 + k / 100:.2f} E{k / 1000:.3f} F3000" for k in range(1, count + 1)]
    if long_at:
        lines[long_at - 1] = "M117 " + "a message that is far too long " * 4
    file.write_text("\n".join(lines) + "\n")
