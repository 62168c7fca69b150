"""A firmware's own reading of a line: its words, the modal state, and what the machine is to do.

    line -> words {letter: number} -> state (modes, position, feed, flow, tool, limits) -> Motion | Halt | nothing

It knows nothing of gcodectl.gcode: a reader that shared its mistakes would prove nothing. Where they differ by design:
- position and feed are never unknown: 0 and `default_feed` at boot, 0 after G28; E is absolute until M83 (Marlin's
  defaults), and G90 and G91 set E's mode too (gcode.h, set_relative_mode)
- M203, M201 Z E, M204 R and M205 E are obeyed; M900 K from 0 to 10 too, as Marlin with LIN_ADVANCE
- a tool change keeps the logical E; M221 T sets the flow of that tool

Source: Marlin gcode/parser.cpp, gcode/motion/*, feature/fwretract.cpp, module/motion.cpp.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from gcodectl.config import Machine
from plant_models.gantry import Firmware
from plant_models.printer.chords import Point, centre, chords, sweep_of
from plant_models.printer.limits import Limits

_COMMAND = re.compile(r"\s*([GMT])\s*(\d+)(\.\d+)?")
_WORD = re.compile(r"([A-Z])\s*((?:[-+]?(?:\d+\.?\d*|\.\d+))?)")
_PARENTHESES = re.compile(r"\([^)]*\)?")
WAITING = frozenset(("M0", "M1", "M25", "M76", "M109", "M116", "M125", "M190", "M191", "M226", "M303", "M600"))
"""Commands that stop the queue elsewhere: a planner that runs dry behind one of them is not starved."""
INCH = 25.4

Words = dict[str, float | None]


class Motion(NamedTuple):
    """Straight pieces that follow each other, E shared evenly; one piece that may have no path."""

    start: Point
    ends: list[Point]
    e: float
    """mm of E, the flow factor applied."""
    e_start: float
    e_end: float
    """Logical E before and after it, mm."""
    feed: float
    """mm/s, the speed factor applied."""


class Halt(NamedTuple):
    """Come to rest with nothing left in the buffer, then stand still."""

    seconds: float


Order = Motion | Halt | None


def words_of(text: str) -> Words:
    """Return the words of a line by letter, None where one has no number; the last one counts."""
    return {letter: float(number) if number else None for letter, number in _WORD.findall(text)}


class State:
    """The modal state; `read` carries out one line."""

    def __init__(self, machine: Machine, firmware: Firmware) -> None:
        self.limits = Limits(machine, firmware)
        self.at: Point = (0.0, 0.0, 0.0)
        self.e = 0.0
        """Logical, mm (mm^3 where volumetric)."""
        self.feed = firmware.default_feed
        self.tool = 0
        self.area = machine.area
        self.advance = 0.0
        """Linear advance (M900), s."""
        self.rest = self.broken = self.waits = False
        """Marks for whoever reads: rest before the next piece; no road reaches over it; the queue waits elsewhere."""
        self._machine, self._chord = machine, firmware.chord
        self._unit, self._absolute, self._e_absolute, self._plane = 1.0, True, True, 0
        self._speed, self._speed_saved = 1.0, 1.0
        self._flow: dict[int, float] = {}
        stroke, speed = firmware.retract_volume / machine.area, firmware.retract_speed
        self._retract, self._recover = (stroke, speed), (0.0, speed)
        self._retracted = self._volumetric = False
        self._does = self._table()
        self._names: dict[str, Callable[[Words], Order] | None] = {}

    def _table(self) -> dict[str, Callable[[Words], Order]]:
        names = "G4 G10 G11 G17 G18 G19 G20 G21 G28 G90 G91 G92 M82 M83 M200 M201 M203 M204 M205 M207 M208"
        table: dict[str, Callable[[Words], Order]] = {
            name: getattr(self, f"_{name.lower()}") for name in (*names.split(), "M220", "M221", "M900")
        }
        table |= dict.fromkeys(("G0", "G1"), self._line) | {"G2": self._clockwise, "G3": self._counter_clockwise}
        return table | dict.fromkeys(("M400", "M84", "M18"), self._halt) | dict.fromkeys(WAITING, self._waits)

    def read(self, text: bytes) -> Order:
        """Carry out one line: what the machine is to do, None where it does not move."""
        line = text.decode("latin-1").partition(";")[0].upper()
        if "(" in line:
            line = _PARENTHESES.sub("", line)
        found = _COMMAND.match(line)
        if found is None:
            return None
        letter, number, more = found.groups()
        if more:
            return None
        if letter == "T":
            return self._change(int(number))
        name = letter + number
        if name not in self._names:
            self._names[name] = self._does.get(f"{letter}{int(number)}")
        does = self._names[name]
        return does(words_of(line[found.end() :])) if does else None

    def lengths(self, words: Words, letters: str) -> dict[str, float]:
        """Return those of the words that have a number, in mm."""
        return {letter: word * self._unit for letter in letters if (word := words.get(letter)) is not None}

    # Motion

    def _target(self, words: Words) -> tuple[Point, float, float]:
        """Set the feed; return where the words lead, E's way with flow applied, and the logical E there, mm."""
        feed = words.get("F")
        if feed and feed > 0:
            self.feed = feed * self._unit / 60
        x, y, z = self.at
        unit, absolute = self._unit, self._absolute
        if (word := words.get("X")) is not None:
            x = word * unit if absolute else x + word * unit
        if (word := words.get("Y")) is not None:
            y = word * unit if absolute else y + word * unit
        if (word := words.get("Z")) is not None:
            z = word * unit if absolute else z + word * unit
        if (word := words.get("E")) is None:
            return (x, y, z), 0.0, self.e
        pushed = word * (unit**3 if self._volumetric else unit)
        after = pushed if self._e_absolute else self.e + pushed
        way = after - self.e if self._e_absolute else pushed
        return (x, y, z), way * self._flow.get(self.tool, 1.0), after

    def _go(self, ends: list[Point], e: float, e_end: float, feed: float) -> Motion:
        motion = Motion(self.at, ends, e, self.e, e_end, feed)
        self.at, self.e = ends[-1], e_end
        return motion

    def _line(self, words: Words) -> Order:
        end, e, e_end = self._target(words)
        return self._go([end], e, e_end, self.feed * self._speed)

    def _clockwise(self, words: Words) -> Order:
        return self._arc(words, False)

    def _counter_clockwise(self, words: Words) -> Order:
        return self._arc(words, True)

    def _arc(self, words: Words, ccw: bool) -> Order:
        """Cut an arc into chords; one that has no centre moves nothing, as in Marlin."""
        end, e, e_end = self._target(words)
        about = centre(self.at, end, self._plane, ccw, self.lengths(words, "IJKR"))
        if about is None:
            return None
        sweep = sweep_of(self.at, end, self._plane, ccw, about, max(int(words.get("P") or 0), 0))
        ends = chords(self.at, end, self._plane, about, sweep, self._chord)
        return self._go(ends, e, e_end, self.feed * self._speed)

    def _g10(self, words: Words) -> Order:
        return None if any(letter in words for letter in "PRLXYZ") else self._swap(True)

    def _g11(self, _words: Words) -> Order:
        return self._swap(False)

    def _swap(self, wanted: bool) -> Order:
        """Retract or recover; E's logical value stays, as in fwretract.cpp, and so does Z's."""
        self.broken = True
        if wanted == self._retracted:
            return None
        self._retracted = wanted
        stroke, speed = self._retract
        extra, back = self._recover
        area = self._machine.area / self.area
        e = (-stroke if wanted else stroke + extra) * area
        return self._go([self.at], e, self.e, speed if wanted else back)

    # Rest

    def _g4(self, words: Words) -> Order:
        self.rest = True
        seconds = words.get("S")
        return Halt(max((words.get("P") or 0.0) / 1000 if seconds is None else seconds, 0.0))

    def _halt(self, _words: Words) -> Order:
        self.rest = self.broken = True
        return Halt(0.0)

    def _waits(self, _words: Words) -> Order:
        self.waits = True
        return None

    def _g28(self, words: Words) -> Order:
        axes = [axis for axis, letter in enumerate("XYZ") if letter in words] or [0, 1, 2]
        x, y, z = (0.0 if axis in axes else self.at[axis] for axis in range(3))
        self.at = (x, y, z)
        return self._halt(words)

    def _change(self, tool: int) -> Order:
        self.rest = self.broken = True
        if tool == self.tool:
            return None
        self.tool = tool
        return Halt(self._machine.switch_dwell)

    # Modes and settings

    def _g17(self, _words: Words) -> None:
        self._plane = 0

    def _g18(self, _words: Words) -> None:
        self._plane = 1

    def _g19(self, _words: Words) -> None:
        self._plane = 2

    def _g20(self, _words: Words) -> None:
        self._unit = INCH

    def _g21(self, _words: Words) -> None:
        self._unit = 1.0

    def _g90(self, _words: Words) -> None:
        self._absolute = self._e_absolute = True

    def _g91(self, _words: Words) -> None:
        self._absolute = self._e_absolute = False

    def _m82(self, _words: Words) -> None:
        self._e_absolute = True

    def _m83(self, _words: Words) -> None:
        self._e_absolute = False

    def _g92(self, words: Words) -> None:
        """Set the position; what has a road no longer lies where it did."""
        here = self.lengths(words, "XYZE")
        self.e = here.pop("E", self.e)
        if here:
            x, y, z = (here.get(letter, self.at[axis]) for axis, letter in enumerate("XYZ"))
            self.at = (x, y, z)
            self.rest = self.broken = True

    def _m200(self, words: Words) -> None:
        size = words.get("S", words.get("D"))
        if size is not None:
            self._volumetric = size > 0
            self.area = 1.0 if self._volumetric else self._machine.area

    def _m201(self, words: Words) -> None:
        caps = [word for letter in "XY" if (word := words.get(letter))]
        self.limits.accel_cap = min(caps, default=self.limits.accel_cap)
        self.limits.z_accel = words.get("Z") or self.limits.z_accel
        self.limits.e_accel = words.get("E") or self.limits.e_accel

    def _m203(self, words: Words) -> None:
        for axis, letter in enumerate("XYZ"):
            self.limits.max_speed[axis] = words.get(letter) or self.limits.max_speed[axis]
        self.limits.e_speed = words.get("E") or self.limits.e_speed

    def _m204(self, words: Words) -> None:
        limits, both = self.limits, words.get("S")
        limits.accel = words.get("P") or both or limits.accel
        limits.travel_accel = words.get("T") or both or limits.travel_accel
        limits.e_alone_accel = words.get("R") or limits.e_alone_accel

    def _m205(self, words: Words) -> None:
        steps = [word for letter in "XY" if (word := words.get(letter))]
        self.limits.corner_speed = min(steps, default=self.limits.corner_speed)
        self.limits.e_corner_speed = words.get("E") or self.limits.e_corner_speed
        if deviation := words.get("J"):
            self.limits.set_junction_deviation(deviation)

    def _m207(self, words: Words) -> None:
        stroke, speed = self._retract
        feed, given = words.get("F"), words.get("S")
        self._retract = (stroke if given is None else given * self._unit, feed / 60 if feed else speed)

    def _m208(self, words: Words) -> None:
        extra, speed = self._recover
        feed, given = words.get("F"), words.get("S")
        self._recover = (extra if given is None else given * self._unit, feed / 60 if feed else speed)

    def _m220(self, words: Words) -> None:
        if "B" in words:
            self._speed_saved = self._speed
        if "R" in words:
            self._speed = self._speed_saved
        self._speed = (words.get("S") or 100 * self._speed) / 100

    def _m221(self, words: Words) -> None:
        flow, tool = words.get("S"), words.get("T")
        if flow is not None and flow >= 0:
            self._flow[self.tool if tool is None else int(tool)] = flow / 100

    def _m900(self, words: Words) -> None:
        k = words.get("K")
        if k is not None and 0 <= k <= 10:
            self.advance = k
