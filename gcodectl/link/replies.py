"""What a printer says, read line by line.

    ok                      ok N12 P15 B3            ok T:200.1 /200.0 B:60.0 /60.0
    Error:checksum mismatch, Last Line: 41           Resend: 42        rs N42
    echo:busy: processing   wait   start             //action:pause
    T:200.1 /200.0          Cap:EMERGENCY_PARSER:1   !! Move out of range   fatal: ...

Sources: Marlin core/language.h, gcode/queue.cpp, gcode/host/M115.cpp; RepRap wiki, G-code, "Replies from the RepRap
machine to the host computer"; Klipper's `!!`.
"""

from __future__ import annotations

import dataclasses
import enum
import re


class Kind(enum.IntEnum):
    """What a line from the printer means to a host; an int, because a table is looked up by it for every line."""

    OK = enum.auto()
    RESEND = enum.auto()
    LINE_ERROR = enum.auto()
    """A numbered line came damaged or out of turn; a resend request follows."""
    FATAL = enum.auto()
    """It has stopped, or will not go on."""
    ERROR = enum.auto()
    """An error that is neither: a damaged LINE_ERROR, or something new."""
    BUSY = enum.auto()
    WAIT = enum.auto()
    """Idle: its queue is empty."""
    START = enum.auto()
    """It has just been reset."""
    TEMPERATURE = enum.auto()
    ACTION = enum.auto()
    """It asks the host for something: `text` is the word after `//action:`."""
    CAPABILITY = enum.auto()
    KEEPALIVE = enum.auto()
    """The answer to M113: `number` is the seconds between its `busy`, 0 for never."""
    OTHER = enum.auto()


@dataclasses.dataclass(frozen=True, slots=True)
class Heat:
    """A heater's temperature and target, degC."""

    now: float
    target: float | None = None

    @property
    def cold(self) -> bool:
        """Whether it has no target; `T:0`, without any, is said by firmware that has no heater at all (M105.cpp)."""
        return self.now == 0 if self.target is None else self.target <= 0


@dataclasses.dataclass(frozen=True, slots=True)
class Reply:
    """One line, or one of the `ok`s of a line."""

    kind: Kind
    text: str = ""
    number: int | None = None
    """Of RESEND: the line that it wants. Of OK: the line that it has taken, where it says so (ADVANCED_OK)."""
    planner: int | None = None
    """Free places in its planner (ADVANCED_OK)."""
    queue: int | None = None
    """Free places in its command queue (ADVANCED_OK)."""
    heats: dict[str, Heat] | None = None
    """By heater as it calls them: T, T0, B, C ..."""


OK = Reply(Kind.OK)
_OKS = re.compile(rb"(?:ok[: ]*(?=ok))*ok(?![a-z])")
_ADVANCED = re.compile(rb"(?: N?(\d+))?(?: P(-?\d+))?(?: B(\d+))?(?= |$)")
_RESEND = re.compile(rb"(?:resend|rs)\b:? *N?:?(\d+)", re.IGNORECASE)
_HEAT = re.compile(rb"(?<![\w@:])([TBC]\d?): *(-?\d+(?:\.\d+)?)(?: */ *(-?\d+(?:\.\d+)?))?")
_LINE_ERROR = re.compile(rb"checksum|line number|last line", re.IGNORECASE)
_HALTED = re.compile(
    rb"halt|kill|stopped|thermal|mintemp|maxtemp|heating failed|runaway|emergency|probing failed|homing failed", re.I
)
_HARMLESS = re.compile(rb"\bSD\b|media|volume|workdir|open failed|file", re.IGNORECASE)
_KEEPALIVE = re.compile(rb"(?:echo: *)?M113 S(\d+)")
_NO_SENSORS = b"error:no thermistors"
"""Marlin 1's answer to M105 where it has no heater, and no `ok` with it; Marlin 2 says `ok T:0` then."""
_STOPPED = b"Printer stopped due to errors"
"""What Marlin, once stopped, says to each move, which it answers with `ok` and does not make (queue.cpp)."""
_START = re.compile(rb"[^ -~]*start")
"""A reset often leaves stray bytes before it."""


def read_replies(line: bytes) -> tuple[Reply, ...]:
    """Read one line, its end taken off; never fails: what nobody knows is OTHER."""
    if line == b"ok":
        return (OK,)
    line = line.strip()
    if found := _OKS.match(line):
        return (*[OK] * (found[0].count(b"ok") - 1), _ok(line, line[found.end() :]))
    if line.lower().startswith(_NO_SENSORS):
        return (_ok(line, b" T:0"),)
    text = line.decode("ascii", errors="replace")
    kind, number = _kind(line)
    if kind is Kind.ACTION:
        text = text.partition("action:")[2].strip()
    heats = _heats(line) if kind is Kind.TEMPERATURE else None
    return (Reply(kind, text, number, heats=heats),)


def _ok(line: bytes, rest: bytes) -> Reply:
    advanced = _ADVANCED.match(rest)
    number, planner, queue = (
        (None if one is None else int(one) for one in advanced.groups()) if advanced else (None,) * 3
    )
    return Reply(Kind.OK, line.decode("ascii", errors="replace"), number, planner, queue, _heats(rest) or None)


def _heats(line: bytes) -> dict[str, Heat]:
    return {
        name.decode(): Heat(float(now), float(target) if target else None) for name, now, target in _HEAT.findall(line)
    }


def _kind(line: bytes) -> tuple[Kind, int | None]:
    """Return the kind of a line that is no `ok`, and its number where it has one."""
    if found := _RESEND.match(line):
        return Kind.RESEND, int(found[1])
    if line.startswith(b"//"):
        return (Kind.ACTION if line[2:].lstrip().startswith(b"action:") else Kind.OTHER), None
    if line.startswith((b"!!", b"fatal:", _STOPPED)):
        return Kind.FATAL, None
    if line[:6].lower() == b"error:":
        return _error(line), None
    if line.removeprefix(b"echo:").lstrip().startswith(b"busy:"):
        return Kind.BUSY, None
    if line == b"wait":
        return Kind.WAIT, None
    if _START.fullmatch(line):
        return Kind.START, None
    if line.startswith(b"Cap:"):
        return Kind.CAPABILITY, None
    if found := _KEEPALIVE.match(line):
        return Kind.KEEPALIVE, int(found[1])
    return (Kind.TEMPERATURE if _HEAT.match(line) else Kind.OTHER), None


def _error(line: bytes) -> Kind:
    if _HALTED.search(line):
        return Kind.FATAL
    if _LINE_ERROR.search(line):
        return Kind.LINE_ERROR
    return Kind.OTHER if _HARMLESS.search(line) else Kind.ERROR
