"""A firmware's own reading of a line: its words, the modal state, and what the machine is to do.

    line -> words {letter: number} -> state (modes, position, feed, flow, tool, limits) -> Motion | Halt | nothing

It knows nothing of gcodectl.gcode: a reader that shared its mistakes would prove nothing. Where they differ by design:
- position and feed are never unknown: 0 and `default_feed` at boot, 0 after G28; E is absolute until M83 (Marlin's
  defaults), and G90 and G91 set E's mode too (gcode.h, set_relative_mode)
- M203, M201 Z E, M204 R and M205 E are obeyed; M900 K from 0 to 10 too, as Marlin with LIN_ADVANCE
- numbers end where the firmware's do (`REACH`, `LONGEST`, factors in 16 bit): no word leads out of its arithmetic
- a tool change keeps the logical E; M221 sets the flow of one tool; a G10 or G11 that changes nothing stops nothing

Source: Marlin gcode/parser.cpp, gcode/motion/*, feature/fwretract.cpp, module/motion.cpp.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from gcodectl.config import Machine
from plant_models.gantry import Firmware
from plant_models.printer.chords import Point, centre, chords, sweep_of
from plant_models.printer.limits import LEAST_SPEED, MOST, Limits
from plant_models.printer.orders import Halt, Motion, Order
from plant_models.printer.retraction import Retraction
from plant_models.printer.words import REACH, Words, command_of, held, words_of

__all__ = ["Halt", "Motion", "State"]
WAITING = frozenset(("M0", "M1", "M25", "M76", "M109", "M116", "M125", "M190", "M191", "M226", "M303", "M600"))
"""Commands that stop the queue elsewhere: a planner that runs dry behind one of them is not starved."""
LONGEST = 2.0**31 / 1000
"""s: a dwell of 2^31 ms or more is over at once, as a clock of 32 bit has it (millis(), PENDING)."""
MOST_PERCENT = 32_767
"""M220 and M221: 16 bit."""
MOST_TURNS = 100
"""G2 P."""
_MODES: dict[str, dict[str, float]] = {
    "G17": {"plane": 0},
    "G18": {"plane": 1},
    "G19": {"plane": 2},
    "G20": {"unit": 25.4},
    "G21": {"unit": 1.0},
    "G90": {"absolute": True, "e_absolute": True},
    "G91": {"absolute": False, "e_absolute": False},
    "M82": {"e_absolute": True},
    "M83": {"e_absolute": False},
}
"""What each modal command puts in force."""


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
        self._modes: dict[str, float] = {**_MODES["G17"], **_MODES["G21"], **_MODES["G90"]}
        self._speed, self._speed_saved = 1.0, 1.0
        self._flow: dict[int, float] = {}
        self._retraction, self._volumetric = Retraction(machine, firmware), False
        self._does = self._table()

    def _table(self) -> dict[str, Callable[[Words], Order]]:
        names = "G4 G10 G11 G28 G92 M200 M207 M208"
        limits = self.limits
        table: dict[str, Callable[[Words], Order]] = {
            name: getattr(self, f"_{name.lower()}") for name in (*names.split(), "M220", "M221", "M900")
        }
        table |= dict.fromkeys(("G0", "G1"), self._line) | {"G2": self._clockwise, "G3": self._counter_clockwise}
        table |= {name: partial(self._put, modes) for name, modes in _MODES.items()}
        table |= {"M201": limits.m201, "M203": limits.m203, "M204": limits.m204, "M205": limits.m205}
        return table | dict.fromkeys(("M400", "M84", "M18"), self._halt) | dict.fromkeys(WAITING, self._waits)

    def read(self, text: bytes) -> Order:
        """Carry out one line: what the machine is to do, None where it does not move."""
        name, words = command_of(text)
        if name in self._does:
            return self._does[name](words_of(words))
        return self._change(int(name[1:])) if name[:1] == "T" and name[1:].isdigit() else None

    def lengths(self, words: Words, letters: str) -> dict[str, float]:
        """Return those of the words that have a number, in mm."""
        unit = self._modes["unit"]
        return {letter: held(word * unit) for letter in letters if (word := words.get(letter)) is not None}

    # Motion

    def _target(self, words: Words) -> tuple[Point, float, float]:
        """Set the feed; return where the words lead, E's way with flow applied, and the logical E there, mm."""
        feed = words.get("F")
        if feed and feed > 0:
            self.feed = min(max(feed * self._modes["unit"] / 60, LEAST_SPEED), MOST)
        x, y, z = self.at
        unit, absolute = self._modes["unit"], self._modes["absolute"]
        if (word := words.get("X")) is not None:
            x = word * unit if absolute else x + word * unit
        if (word := words.get("Y")) is not None:
            y = word * unit if absolute else y + word * unit
        if (word := words.get("Z")) is not None:
            z = word * unit if absolute else z + word * unit
        if not abs(x) + abs(y) + abs(z) < REACH:
            x, y, z = held(x), held(y), held(z)
        if (word := words.get("E")) is None:
            return (x, y, z), 0.0, self.e
        pushed = word * (unit**3 if self._volumetric else unit)
        if not -REACH < pushed < REACH:
            pushed = held(pushed)
        e_absolute = self._modes["e_absolute"]
        after = pushed if e_absolute else self.e + pushed
        way = (after - self.e if e_absolute else pushed) * self._flow.get(self.tool, 1.0)
        if not abs(way) + abs(after) < REACH:
            way, after = held(way), held(after)
        return (x, y, z), way, after

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
        plane = int(self._modes["plane"])
        about = centre(self.at, end, plane, ccw, self.lengths(words, "IJKR"))
        if about is None:
            return None
        turns = words.get("P") or 0.0
        sweep = sweep_of(self.at, end, plane, ccw, about, int(turns) if 0 <= turns <= MOST_TURNS else 0)
        ends = chords(self.at, end, plane, about, sweep, self._chord)
        return self._go(ends, e, e_end, self.feed * self._speed)

    def _g10(self, words: Words) -> Order:
        return None if any(letter in words for letter in "PRLXYZ") else self._swap(True)

    def _g11(self, _words: Words) -> Order:
        return self._swap(False)

    def _swap(self, wanted: bool) -> Order:
        """Retract or recover; E's logical value stays, as in fwretract.cpp, and so does Z's."""
        self.broken = True
        swap = self._retraction.swap(wanted)
        if swap is None:
            return None
        stroke, speed = swap
        return self._go([self.at], stroke * self._machine.area / self.area, self.e, speed)

    # Rest

    def _g4(self, words: Words) -> Order:
        self.rest = True
        seconds = words.get("S")
        if seconds is None:
            seconds = (words.get("P") or 0.0) / 1000
        return Halt(seconds if 0 < seconds < LONGEST else 0.0)

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

    def _put(self, modes: Mapping[str, float], _words: Words) -> None:
        self._modes |= modes

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

    def _m207(self, words: Words) -> None:
        self._retraction.m207(words, self._modes["unit"])

    def _m208(self, words: Words) -> None:
        self._retraction.m208(words, self._modes["unit"])

    def _m220(self, words: Words) -> None:
        if "B" in words:
            self._speed_saved = self._speed
        if "R" in words:
            self._speed = self._speed_saved
        percent = words.get("S")
        if percent is not None and percent >= 1:
            self._speed = min(percent, MOST_PERCENT) / 100

    def _m221(self, words: Words) -> None:
        flow, tool = words.get("S"), words.get("T")
        if flow is not None and flow >= 0:
            self._flow[self.tool if tool is None else round(held(tool))] = min(flow, MOST_PERCENT) / 100

    def _m900(self, words: Words) -> None:
        k = words.get("K")
        if k is not None and 0 <= k <= 10:
            self.advance = k
