"""Words of one line, as a firmware's parser finds them: the command, then letters with numbers.

    b" g01 X10Y-.5 F600 ; outer wall"  ->  "G1", {"X": 10, "Y": -0.5, "F": 600}

Comments (`;`, parentheses) are blanks, small letters are capitals, a line that begins with no G, M or T says nothing.

Source: Marlin gcode/parser.cpp; a number ends where strtof's would without an exponent (parser.h, value_float).
"""

from __future__ import annotations

import re
from contextlib import suppress
from functools import lru_cache
from typing import TypeAlias

REACH = 2e7
"""mm: where 32 bit of steps end, at 100 a mm."""
_COMMAND = re.compile(r"([GMT])\s*(\d+)(\.\d+)?")
_WORD = re.compile(r"([A-Z])\s*((?:[-+]?(?:\d+\.?\d*|\.\d+))?)")
_PARENTHESES = re.compile(r"\([^)]*\)?")

Words: TypeAlias = dict[str, float | None]


def command_of(text: bytes) -> tuple[str, str]:
    """Return a line's command ("" where it has none) and the rest of it, in capitals, comments dropped."""
    line = text.decode("latin-1").upper()
    if ";" in line:
        line = line[: line.index(";")]
    if "(" in line:
        line = _PARENTHESES.sub("", line)
    first, _, rest = line.lstrip().partition(" ")
    name = _name(first) if len(first) < 6 else ""
    if name:
        return name, rest
    found = _COMMAND.match(line.lstrip())
    return (_name(found.group()), line.lstrip()[found.end() :]) if found else ("", "")


@lru_cache(256)
def _name(text: str) -> str:
    """Return how a command is written without needless zeros; "" for what is none, or has more behind it."""
    found = _COMMAND.fullmatch(text)
    return f"{found[1]}{int(found[2][-9:])}{found[3] or ''}" if found else ""


def words_of(text: str) -> Words:
    """Return the words of a line by letter, None where one has no number; the last one counts.

    Words with blanks between them, as slicers write them, are read without the pattern: in a third of the time. What
    Python would take for a number and no firmware does (an exponent, nan, inf, _) is left to the pattern.
    """
    if "N" not in text and "_" not in text and text.count("E") == text.count(" E") + text.startswith("E"):
        with suppress(ValueError):  # a word without a number, or no blank before the next: the pattern knows
            return {word[0]: float(word[1:]) for word in text.split()}
    return {letter: float(number) if number else None for letter, number in _WORD.findall(text)}


def held(length: float) -> float:
    """Return a length within what a firmware's counters hold, mm."""
    return min(max(length, -REACH), REACH)
