"""What the firmware does and says for each command; what moves goes to the motion.

Texts as Marlin 2.1 has them: gcode/temp/M105.cpp, gcode/host/M114.cpp, M115.cpp, M118.cpp, gcode/config/M220.cpp,
module/temperature.cpp (print_heater_states, wait_for_hotend), gcode/parser.cpp (unknown_command_warning).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from enum import Enum, auto

from gcodectl.config import Machine
from gcodectl.link.receiver import Dialect, Receiver
from plant_models.printer.heaters import BED, HOTEND, Heater
from plant_models.printer.motion import Motion

VERSION = "Marlin 2.1.2 (gcodectl virtual printer)"


class Wait(Enum):
    """What a command that was begun waits for."""

    NO = auto()
    MOTION = auto()
    HEAT = auto()


MOVES = frozenset(
    b"G0 G1 G2 G3 G4 G5 G10 G11 G17 G18 G19 G20 G21 G28 G29 G90 G91 G92 M17 M18 M82 M83 M84 M201 M202 M203 M204 M205 "
    b"M207 M208 M220 M221 M400 M566 M900".split()
)
"""What the motion is given. G29 among them: a probing that it may do without."""
REPORTED = frozenset((b"G28", b"G92"))
"""The position is said when these end."""
_HEAD = re.compile(rb" *([A-Z]) *(\d*)")
_WORDS = {letter: re.compile(rb"[ \d]%c ?(-?\d*\.?\d+)" % letter) for letter in b"SRTPIN"}
_CAPABILITIES = (
    "SERIAL_XON_XOFF:0", "BINARY_FILE_TRANSFER:0", "EEPROM:0", "VOLUMETRIC:0", "AUTOREPORT_POS:0", "AUTOREPORT_TEMP:1",
    "PROGRESS:0", "PRINT_JOB:0", "AUTOLEVEL:0", "RUNOUT:0", "Z_PROBE:0", "LEVELING_DATA:0", "BUILD_PERCENT:0",
    "SOFTWARE_POWER:0", "TOGGLE_LIGHTS:0", "CASE_LIGHT_BRIGHTNESS:0", "EMERGENCY_PARSER:{emergency}",
    "HOST_ACTION_COMMANDS:1", "PROMPT_SUPPORT:0", "SDCARD:0", "AUTOREPORT_SD_STATUS:0", "LONG_FILENAME:0",
    "THERMAL_PROTECTION:1", "MOTION_MODES:0", "ARCS:1", "BABYSTEPPING:0", "CHAMBER_TEMPERATURE:0",
    "COOLER_TEMPERATURE:0", "MEATPACK:0",
)  # fmt: skip


def word(text: bytes, letter: str) -> float | None:
    """Return the number that follows a letter in a command; None where there is none."""
    match = _WORDS[ord(letter)].search(text)
    return float(match[1]) if match else None


class Commands:
    """The firmware's commands: `begin` one, `end` it when what it waits for is over."""

    def __init__(
        self,
        machine: Machine,
        dialect: Dialect,
        motion: Motion,
        receiver: Receiver,
        say: Callable[[bytes], None],
        act: Callable[[str], None],
        score: Callable[[], str],
    ) -> None:
        self.machine, self.dialect, self.motion, self.receiver = machine, dialect, motion, receiver
        self.say, self.act, self.score = say, act, score
        self.hotends = [Heater(HOTEND) for _ in range(dialect.extruders)]
        self.bed = Heater(BED)
        self.tool = 0
        self.keepalive = dialect.keepalive
        """s between `echo:busy: processing`; 0: never."""
        self.heat_until = -math.inf
        self.report_at = math.inf
        """When temperatures are to be said next."""
        self.own_ok = b""
        """The ok of the command just carried out, where it is not the usual one."""
        self._awaited: Heater | None = None
        self._every, self._next_report, self._next_heat = 0.0, math.inf, math.inf
        self._text, self._now = b"", 0.0
        self._percent = {b"M220": 100.0, b"M221": 100.0, b"M900": 0.0}

    def begin(self, text: bytes, now: float) -> Wait:
        """Begin a command; return what it waits for."""
        self._text, self._now = text, now
        head = text.partition(b" ")[0]
        if head not in KNOWN:
            match = _HEAD.match(text)
            head = b"%s%d" % (match[1], int(match[2])) if match and match[2] else b""
        if head in MOVES:
            self.motion.take(text, now)
            if head in self._percent:
                self._scale(head)
            return Wait.MOTION
        handler = HANDLERS.get(head)
        if handler is not None:
            return handler(self) or Wait.NO
        if head[:1] == b"T":
            return self._change_tool(int(head[1:]))
        self.say(b'echo:Unknown command: "%s"\n' % text)
        return Wait.NO

    def end(self, text: bytes, now: float) -> None:
        """End a command whose wait is over."""
        if self._awaited is not None:
            self._awaited, self._next_heat = None, math.inf
            self._plan_reports()
            self.say(self.temperatures(now, b"") + b"\n")
        elif text[:3] in REPORTED and not text[3:4].isdigit():
            self.say(self.position())

    # temperatures

    def temperatures(self, now: float, lead: bytes) -> bytes:
        """Return what M105 says, without its end."""
        hot = self.hotends[self.tool]
        parts = [lead, b" T:%.2f /%.2f" % (hot.temperature(now), hot.target)]
        parts.append(b" B:%.2f /%.2f" % (self.bed.temperature(now), self.bed.target))
        if len(self.hotends) > 1:
            parts += [b" T%d:%.2f /%.2f" % (k, one.temperature(now), one.target) for k, one in enumerate(self.hotends)]
        parts.append(b" @:%d B@:%d" % (_power(hot, now), _power(self.bed, now)))
        return b"".join(parts)

    def report(self, now: float, quiet: bool) -> None:
        """Say the temperatures that are due at `now`; quiet: let them pass."""
        if now < self.report_at:
            return
        if now >= self._next_heat and self._awaited is not None:
            left = self.heat_until - now
            shown = b"?" if now < self._awaited.there else b"%d" % math.ceil(left)
            if not quiet:
                self.say(self.temperatures(now, b"") + b" W:%s\n" % shown)
            self._next_heat = now + 1.0
        if now >= self._next_report:
            if not quiet:
                self.say(self.temperatures(now, b"") + b"\n")
            self._next_report = now + self._every
        self._plan_reports()

    def heaters_off(self, now: float) -> None:
        """Turn all heaters off."""
        for heater in (*self.hotends, self.bed):
            heater.set(0.0, now)

    def _plan_reports(self) -> None:
        self.report_at = min(self._next_report, self._next_heat)

    def _m105(self) -> None:
        self.own_ok = self.temperatures(self._now, b"ok") + b"\n"

    def _m155(self) -> None:
        every = word(self._text, "S")
        if every is not None:
            self._every = min(max(every, 0.0), 60.0)
            self._next_report = self._now + self._every if self._every else math.inf
            self._plan_reports()

    def _hotend(self) -> Heater | None:
        tool = word(self._text, "T")
        index = self.tool if tool is None else int(tool)
        if 0 <= index < len(self.hotends):
            return self.hotends[index]
        self.say(b"echo:%s Invalid extruder %d\n" % (self._text[:4], index))
        return None

    def _m104(self) -> None:
        heater, target = self._hotend(), word(self._text, "S")
        if heater is not None and target is not None:
            heater.set(target, self._now)

    def _m140(self) -> None:
        target = word(self._text, "S")
        if target is not None:
            self.bed.set(target, self._now)

    def _m109(self) -> Wait:
        heater = self._hotend()
        return Wait.NO if heater is None else self._heat(heater)

    def _m190(self) -> Wait:
        return self._heat(self.bed)

    def _heat(self, heater: Heater) -> Wait:
        """Set a target and wait for it: S while it heats, R also while it cools."""
        either = word(self._text, "R")
        target = word(self._text, "S") if either is None else either
        if target is not None:
            heater.set(target, self._now)
        if not heater.target or (either is None and not heater.heating):
            return Wait.NO
        self._awaited, self.heat_until = heater, max(heater.settled(), self._now)
        self._next_heat = self._now + 1.0
        self._plan_reports()
        return Wait.HEAT

    # what is asked and said

    def greeting(self) -> bytes:
        """Return what is said after power on."""
        name = self.machine.name.encode("ascii", "replace")
        return b"start\n%s\necho: Machine: %s\necho: Free Memory: 4096  PlannerBufferBytes: 1488\n" % (
            VERSION.encode(), name,
        )  # fmt: skip

    def position(self) -> bytes:
        """Return what M114 says."""
        x, y, z, e = self.motion.position()
        steps = self.machine.steps_per_mm
        counts = (round(x * steps[0]), round(y * steps[1]), round(z * steps[2]))
        return b"X:%.2f Y:%.2f Z:%.2f E:%.2f Count X:%d Y:%d Z:%d\n" % (x, y, z, e, *counts)

    def _m114(self) -> None:
        self.say(self.position())

    def _m115(self) -> None:
        name = self.machine.name.replace(" ", "_")
        lines = [
            f"FIRMWARE_NAME:{VERSION} PROTOCOL_VERSION:1.0 MACHINE_TYPE:{name} EXTRUDER_COUNT:{len(self.hotends)}",
            *(f"Cap:{one}".format(emergency=int(self.dialect.emergency_parser)) for one in _CAPABILITIES),
        ]
        self.say("".join(f"{line}\n" for line in lines).encode("ascii", "replace"))

    def _m113(self) -> None:
        every = word(self._text, "S")
        if every is None:
            self.say(b"echo:M113 S%d\n" % self.keepalive)
        else:
            self.keepalive = min(max(every, 0.0), 60.0)

    def _m110(self) -> None:
        number = word(self._text, "N")
        if number is not None:
            self.receiver.last = int(number)

    def _m118(self) -> None:
        words = self._text[4:].split()
        lead = b""
        while words and re.fullmatch(rb"[EA]1|P\d+", words[0]):
            lead += {b"E": b"echo:", b"A": b"//"}.get(words[0][:1], b"")
            words.pop(0)
        said = b" ".join(words)
        self.say(b"%s%s\n" % (lead, said))
        if said == b"SCORE":
            self.say(b"echo:%s\n" % self.score().encode("ascii", "replace"))

    def _m503(self) -> None:
        machine, e = self.machine, self.machine.e_limits
        speed, steps = machine.max_speed, machine.steps_per_mm
        lines = (
            "; Steps per unit:", f" M92 X{steps[0]:.2f} Y{steps[1]:.2f} Z{steps[2]:.2f} E{machine.e_steps_per_mm:.2f}",
            "; Max feedrates (units/s):", f" M203 X{speed[0]:.2f} Y{speed[1]:.2f} Z{speed[2]:.2f} E{e.max_speed:.2f}",
            "; Acceleration (units/s2) (P<print-accel> R<retract-accel> T<travel-accel>):",
            f" M204 P{machine.accel:.2f} R{machine.e_accel:.2f} T{machine.travel_accel:.2f}",
            "; Linear Advance:", f" M900 K{self._percent[b'M900']:.2f}",
        )  # fmt: skip
        self.say("".join(f"echo:{line}\n" for line in lines).encode())

    def _no_media(self) -> None:
        said = {b"M20": b"Begin file list\nEnd file list\n", b"M27": b"Not SD printing\n"}
        if self._text[:3] == b"M23":
            self.say(b"open failed, File: %s.\n" % self._text[3:].strip())
        else:
            self.say(said.get(self._text[:3], b"echo:No media\n"))

    def _quiet(self) -> None:
        """Do what nobody hears."""

    def _urgent(self) -> None:
        """Out of the queue: the emergency parser, where there is one, has acted already."""
        if not self.dialect.emergency_parser:
            self.act(self._text[:4].decode())

    def _scale(self, head: bytes) -> None:
        letter = b"K" if head == b"M900" else b"S"
        match = re.search(rb" ?%s ?(-?\d*\.?\d+)" % letter, self._text[4:])
        if match:
            self._percent[head] = float(match[1])
            return
        value = self._percent[head]
        told = {b"M220": b"FR:%d%%", b"M221": b"echo:E0 Flow: %d%%", b"M900": b"Advance K=%.2f"}[head]
        self.say(told % value + b"\n")

    def _change_tool(self, tool: int) -> Wait:
        if tool >= len(self.hotends):
            self.say(b"echo:T%d Invalid extruder\n" % tool)
            return Wait.NO
        self.tool = tool
        self.motion.take(self._text, self._now)
        return Wait.MOTION


def _power(heater: Heater, now: float) -> int:
    """Return what a heater is driven with, 0 to 127."""
    if not heater.target or now < heater.there:
        return 127 if heater.target and heater.heating else 0
    kind = heater.kind
    return round(127 * max(heater.target - kind.ambient, 0.0) / (kind.hottest - kind.ambient))


Handler = Callable[[Commands], Wait | None]
HANDLERS: dict[bytes, Handler] = {
    b"M105": Commands._m105, b"M155": Commands._m155, b"M104": Commands._m104, b"M140": Commands._m140,
    b"M109": Commands._m109, b"M190": Commands._m190, b"M114": Commands._m114, b"M115": Commands._m115,
    b"M113": Commands._m113, b"M110": Commands._m110, b"M118": Commands._m118, b"M503": Commands._m503,
    **dict.fromkeys((b"M20", b"M21", b"M22", b"M23", b"M24", b"M25", b"M26", b"M27"), Commands._no_media),
    **dict.fromkeys((b"M106", b"M107", b"M117", b"M73", b"M75", b"M76", b"M77", b"M486", b"M876"), Commands._quiet),
    **dict.fromkeys((b"M108", b"M112", b"M410", b"M524"), Commands._urgent),
}  # fmt: skip
KNOWN = MOVES | HANDLERS.keys()
