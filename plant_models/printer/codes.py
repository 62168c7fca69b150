"""What the printer's commands have in common: their head, their numbers, and what they wait for."""

from __future__ import annotations

import re
from enum import Enum, auto

MOST = 2.0**31 - 1
_HEAD = re.compile(rb" *([A-Z]) *(\d+)")
_WORDS = {letter: re.compile(rb"[ \d]%c ?(-?\d*\.?\d+)" % letter) for letter in b"SRTPINK"}


class Wait(Enum):
    """What a command that was begun waits for."""

    NO = auto()
    MOTION = auto()
    HEAT = auto()


def head(text: bytes) -> bytes:
    """Return letter and number that a command begins with, such as G1 for ` G01X5`; nothing where it has none."""
    match = _HEAD.match(text)
    return b"%s%d" % (match[1], int(match[2][-9:])) if match else b""


def word(text: bytes, letter: str) -> float | None:
    """Return the number that follows a letter in a command, within 32 bit; None where there is none."""
    match = _WORDS[ord(letter)].search(text)
    return min(max(float(match[1]), -MOST), MOST) if match else None
