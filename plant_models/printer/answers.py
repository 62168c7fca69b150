"""What the firmware does and says for each command; what moves goes to the motion.

Texts as Marlin 2.1 has them: gcode/temp/M105.cpp, gcode/host/M114.cpp, M115.cpp, M118.cpp, gcode/config/M220.cpp,
gcode/parser.cpp (unknown_command_warning).
"""

from __future__ import annotations

import re
from collections.abc import Callable

from gcodectl.config import Machine
from gcodectl.link.receiver import Dialect, Receiver
from plant_models.printer.codes import Wait, head, word
from plant_models.printer.motion import Motion
from plant_models.printer.thermals import Thermals

VERSION = "Marlin 2.1.2 (gcodectl virtual printer)"


MOVES = frozenset(
    b"G0 G1 G2 G3 G4 G5 G10 G11 G17 G18 G19 G20 G21 G28 G29 G90 G91 G92 "
    b"M0 M1 M17 M18 M82 M83 M84 M125 M200 M201 M202 M203 M204 M205 M207 M208 M220 M221 M226 M400 M600 M900".split()
)
"""What the motion is given. Nobody is there whom M0 could wait for, and no probe for G29: done when motion is."""
QUIET = b"M73 M75 M76 M77 M85 M92 M106 M107 M117 M301 M302 M304 M486 M500 M501 M502 M851 M876".split()
"""What nobody hears of."""
REPORTED = frozenset((b"G28", b"G92"))
"""The position is said when these end."""
_CAPABILITIES = (
    "SERIAL_XON_XOFF:0", "BINARY_FILE_TRANSFER:0", "EEPROM:0", "VOLUMETRIC:0", "AUTOREPORT_POS:0", "AUTOREPORT_TEMP:1",
    "PROGRESS:0", "PRINT_JOB:0", "AUTOLEVEL:0", "RUNOUT:0", "Z_PROBE:0", "LEVELING_DATA:0", "BUILD_PERCENT:0",
    "SOFTWARE_POWER:0", "TOGGLE_LIGHTS:0", "CASE_LIGHT_BRIGHTNESS:0", "EMERGENCY_PARSER:{emergency}",
    "HOST_ACTION_COMMANDS:1", "PROMPT_SUPPORT:0", "SDCARD:0", "AUTOREPORT_SD_STATUS:0", "LONG_FILENAME:0",
    "THERMAL_PROTECTION:1", "MOTION_MODES:0", "ARCS:1", "BABYSTEPPING:0", "CHAMBER_TEMPERATURE:0",
    "COOLER_TEMPERATURE:0", "MEATPACK:0",
)  # fmt: skip


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
        self.thermals = Thermals(dialect.extruders, say)
        self.keepalive = dialect.keepalive
        """s between `echo:busy: processing`; 0: never."""
        self.own_ok = b""
        """The ok of the command just carried out, where it is not the usual one."""
        self._text, self._code, self._now = b"", b"", 0.0
        self._percent = {b"M220": 100.0, b"M221": 100.0, b"M900": 0.0}

    def begin(self, text: bytes, now: float) -> Wait:
        """Begin a command; return what it waits for."""
        self._text, self._now = text, now
        code = text.partition(b" ")[0]
        if code not in KNOWN:
            code = head(text)
        self._code = code
        if code in MOVES:
            self.motion.take(text, now)
            if code in self._percent:
                self._scale(code)
            return Wait.MOTION
        if code in THERMAL:
            if code in WAITED:
                self.motion.take(text, now)
            return THERMAL[code](self.thermals, text, now) or Wait.NO
        handler = HANDLERS.get(code)
        if handler is not None:
            handler(self)
            return Wait.NO
        if code[:1] == b"T":
            return self._change_tool(int(code[1:]))
        self.say(b'echo:Unknown command: "%s"\n' % text)
        return Wait.NO

    def end(self, now: float) -> None:
        """End the command begun last: what it waited for is over."""
        if self._code in REPORTED:
            self.say(self.position())
        self.thermals.end_wait(now)

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

    def _m105(self) -> None:
        self.own_ok = self.thermals.temperatures(self._now, b"ok") + b"\n"

    def _m114(self) -> None:
        self.say(self.position())

    def _m115(self) -> None:
        name = self.machine.name.replace(" ", "_")
        lines = [
            f"FIRMWARE_NAME:{VERSION} PROTOCOL_VERSION:1.0 MACHINE_TYPE:{name} "
            f"EXTRUDER_COUNT:{len(self.thermals.hotends)}",
            *(f"Cap:{one}".format(emergency=int(self.dialect.emergency_parser)) for one in _CAPABILITIES),
        ]
        self.say("".join(f"{line}\n" for line in lines).encode("ascii", "replace"))

    def _m113(self) -> None:
        every = word(self._text, "S")
        if every is None:
            self.say(b"echo:M113 S%d\n" % self.keepalive)
        else:
            self.keepalive = min(max(int(every), 0), 60)

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
        if self._code == b"M23":
            self.say(b"open failed, File: %s.\n" % self._text[3:].strip())
        else:
            self.say(said.get(self._code, b"echo:No media\n"))

    def _quiet(self) -> None:
        """Do what nobody hears."""

    def _urgent(self) -> None:
        """Out of the queue: the emergency parser, where there is one, has acted already."""
        if not self.dialect.emergency_parser:
            self.act(self._code.decode())

    def _scale(self, code: bytes) -> None:
        letter = b"K" if code == b"M900" else b"S"
        match = re.search(rb" ?%s ?(-?\d*\.?\d+)" % letter, self._text[4:])
        if match:
            self._percent[code] = min(max(float(match[1]), 0.0), 32_767.0)
            return
        value = self._percent[code]
        told = {b"M220": b"FR:%d%%", b"M221": b"echo:E0 Flow: %d%%", b"M900": b"Advance K=%.2f"}[code]
        self.say(told % value + b"\n")

    def _change_tool(self, tool: int) -> Wait:
        if tool >= len(self.thermals.hotends):
            self.say(b"echo:T%d Invalid extruder\n" % tool)
            return Wait.NO
        self.thermals.tool = tool
        self.motion.take(self._text, self._now)
        return Wait.MOTION


Handler = Callable[[Commands], None]
HANDLERS: dict[bytes, Handler] = {
    b"M105": Commands._m105, b"M114": Commands._m114, b"M115": Commands._m115, b"M113": Commands._m113,
    b"M110": Commands._m110, b"M118": Commands._m118, b"M503": Commands._m503,
    **dict.fromkeys((b"M20", b"M21", b"M22", b"M23", b"M24", b"M25", b"M26", b"M27"), Commands._no_media),
    **dict.fromkeys(QUIET, Commands._quiet),
    **dict.fromkeys((b"M108", b"M112", b"M410", b"M524"), Commands._urgent),
}  # fmt: skip
THERMAL: dict[bytes, Callable[[Thermals, bytes, float], Wait | None]] = {
    b"M155": Thermals.m155, b"M104": Thermals.m104, b"M140": Thermals.m140, b"M109": Thermals.m109,
    b"M190": Thermals.m190,
}  # fmt: skip
WAITED = frozenset((b"M109", b"M190"))
"""The motion hears of these too: a planner that runs dry behind them is not starved."""
KNOWN = MOVES | HANDLERS.keys() | THERMAL.keys()
