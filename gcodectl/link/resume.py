"""Going on with a job that broke off: what a printer must be told before the next line means what it should.

    line 1 ........... acknowledged | next ..........
           state: heat, modes, tool, E, place, speeds --> a few lines --> go on

What was acknowledged may have been in the printer's buffer only: up to some 20 moves before the place are not laid.
Nothing is homed, since the part stands there: the printer must still know where it is.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator

from gcodectl.link.job import Line

_WORD = re.compile(rb"([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+))", re.IGNORECASE)
_KEPT = ("M106", "M107", "M201", "M203", "M204", "M205", "M220", "M221", "M566", "M572", "M900")
"""Settings whose last line is said again as it was."""


class State:
    """A printer's modes and places, as far as lines tell."""

    def __init__(self) -> None:
        self.inch = self.relative = self.relative_e = False
        self.feed = math.nan
        self.place = {"X": math.nan, "Y": math.nan, "Z": math.nan, "E": 0.0}
        self.tool = b""
        self.heat: dict[str, bytes] = {}
        self.kept: dict[str, bytes] = {}

    def take(self, command: bytes) -> None:
        """Follow one command."""
        words = {letter.upper().decode(): float(value) for letter, value in _WORD.findall(command)}
        name = _name(command)
        if name in ("G0", "G1", "G2", "G3"):
            self._move(words)
        elif name in ("G20", "G21"):
            self.inch = name == "G20"
        elif name in ("G90", "G91"):
            self.relative = self.relative_e = name == "G91"
        elif name in ("M82", "M83"):
            self.relative_e = name == "M83"
        elif name == "G92":
            self.place |= {axis: value for axis, value in words.items() if axis in self.place}
        elif name == "G28":
            homed = [axis for axis in "XYZ" if axis.encode() in command.upper()] or list("XYZ")
            self.place |= dict.fromkeys(homed, math.nan)
        elif name.startswith("T") and name[1:].isdigit():
            self.tool = command
        elif name in ("M104", "M109"):
            self.heat[f"tool {words.get('T', self.tool)}"] = b"M109" + command[4:]
        elif name in ("M140", "M190"):
            self.heat["bed"] = b"M190" + command[4:]
        elif name in ("M141", "M191"):
            self.heat["chamber"] = b"M191" + command[4:]
        elif name in _KEPT:
            self.kept["M106" if name == "M107" else name] = command

    def _move(self, words: dict[str, float]) -> None:
        self.feed = words.get("F", self.feed)
        for axis in "XYZE":
            if axis in words:
                relative = self.relative_e if axis == "E" else self.relative
                self.place[axis] = words[axis] + (self.place[axis] if relative else 0.0)

    def lines(self, pulled: float = 0.0) -> list[bytes]:
        """Return the commands that bring a printer that still knows its place to this state.

        `pulled`: mm of E to push forward again first, which a stop has pulled back.
        """
        out = [self.tool] if self.tool else []
        out += self.heat.values()
        if pulled > 0:
            out += [b"M83", _push(pulled)]
        out += [b"G20" if self.inch else b"G21", b"G90"]  # in Marlin G90 and G91 are E's mode too: M82, M83 come last
        known = [b"%s%.4f" % (axis.encode(), self.place[axis]) for axis in "XYZ" if not math.isnan(self.place[axis])]
        if known:
            out.append(b"G0 " + b" ".join(known))
        if not math.isnan(self.feed):
            out.append(b"G1 F%g" % self.feed)
        if not self.relative_e:
            out.append(b"G92 E%.5f" % self.place["E"])
        out += self.kept.values()
        return [*out, b"G91" if self.relative else b"G90", b"M83" if self.relative_e else b"M82"]


def _push(pulled: float) -> bytes:
    return b"G1 E%.4f F300" % pulled


def _name(command: bytes) -> str:
    match = re.match(rb"([GMT])0*(\d+)(?![.\d])", command, re.IGNORECASE)
    return (match[1].upper() + match[2]).decode() if match else ""


class Resumed:
    """The lines of a job after line `last`; before the first, what brings the printer back to where it was."""

    def __init__(self, lines: Iterable[Line | None], last: int, pulled: float) -> None:
        self.owed = pulled
        """mm of E that are still to be pushed forward."""
        self._lines, self._last = lines, last

    def __iter__(self) -> Iterator[Line | None]:
        state, restored = State(), False
        for line in self._lines:
            if line is not None and line.source <= self._last:
                state.take(line.command)
                continue
            if line is not None and not restored:
                restored = True
                yield from self._restore(state)
            yield line

    def _restore(self, state: State) -> Iterator[Line]:
        push = _push(self.owed)
        for command in state.lines(self.owed):
            yield Line(self._last, command)
            if command == push:
                self.owed = 0.0  # the line after it was asked for: it is on its way
