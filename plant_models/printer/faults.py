"""What goes wrong, on purpose: faults at a line or at a rate, seeded.

SPEC: name[=value]@line or name[=value]%rate, comma-separated     lost-ok@150,garble-in%0.001,busy=5@200
      @line: once, when the line of that number passes first      %rate: each time with this probability

host --> [LINE: lost-line checksum garble-in ...] --> receiver --> [COMMAND: busy reset kill ...] --> carried out
     <-- [OK: lost-ok garble-out split-ok slow-ok ...] <------------------------------------------------- ok
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from random import Random
from typing import NamedTuple

from gcodectl.errors import UsageError


class Stage(Enum):
    """Where on a line's way a fault strikes."""

    LINE = "as the line comes in"
    COMMAND = "as the command is begun"
    OK = "as its ok goes out"


class Kind(NamedTuple):
    """One kind of fault; value: None where it takes none, else what it is without one."""

    stage: Stage
    does: str
    value: float | None = None
    survivable: bool = True


KINDS: dict[str, Kind] = {
    "lost-line": Kind(Stage.LINE, "the line never arrives"),
    "checksum": Kind(Stage.LINE, "its checksum is found wrong; Resend as the firmware does it"),
    "checksum-ok": Kind(Stage.LINE, "its checksum is found wrong; Resend and ok"),
    "checksum-no-ok": Kind(Stage.LINE, "its checksum is found wrong; Resend without ok"),
    "missing-checksum": Kind(Stage.LINE, "No Checksum is claimed"),
    "duplicate-resend": Kind(Stage.LINE, "its checksum is found wrong; Resend comes twice"),
    "garble-in": Kind(Stage.LINE, "one bit of the line is flipped"),
    "bogus-resend": Kind(Stage.COMMAND, "Resend of line VALUE, that nobody misses", 1.0),
    "future-resend": Kind(Stage.COMMAND, "Resend of a line VALUE ahead", 1000.0),
    "busy": Kind(Stage.COMMAND, "takes VALUE s longer and says that it is busy", 5.0),
    "silence": Kind(Stage.COMMAND, "takes VALUE s longer and says nothing", 5.0),
    "dead": Kind(Stage.COMMAND, "never says or does anything again", survivable=False),
    "reset": Kind(Stage.COMMAND, "boots: `start`, queue and position lost"),
    "kill": Kind(Stage.COMMAND, "kill() called", survivable=False),
    "thermal": Kind(Stage.COMMAND, "thermal runaway, and kill()", survivable=False),
    "close": Kind(Stage.COMMAND, "the port is gone for VALUE s", 5.0),
    "pause": Kind(Stage.COMMAND, "says //action:pause, and VALUE s later //action:resume", 5.0),
    "resume": Kind(Stage.COMMAND, "says //action:resume"),
    "cancel": Kind(Stage.COMMAND, "says //action:cancel"),
    "noise": Kind(Stage.COMMAND, "VALUE random bytes between lines", 8.0),
    "lost-ok": Kind(Stage.OK, "the ok is lost"),
    "garble-out": Kind(Stage.OK, "one bit of the ok is flipped"),
    "split-ok": Kind(Stage.OK, "the ok comes in two parts, VALUE s apart", 0.05),
    "join-ok": Kind(Stage.OK, "the ok's line end is lost: it runs into what is said next"),
    "slow-ok": Kind(Stage.OK, "the ok, and what is said after it, comes VALUE s late", 0.5),
}


@dataclass(frozen=True)
class Fault:
    """One fault: at a line, or at a rate."""

    name: str
    value: float
    line: int | None = None
    rate: float = 0.0

    @property
    def survivable(self) -> bool:
        """Whether the printer is alive afterwards."""
        return KINDS[self.name].survivable

    @property
    def stage(self) -> Stage:
        """Where it strikes."""
        return KINDS[self.name].stage


Faults = tuple[Fault, ...]

_FAULT = re.compile(r"(?P<name>[a-z-]+)(?:=(?P<value>[0-9.eE+-]+))?(?:@(?P<line>\d+)|%(?P<rate>[0-9.eE+-]+))")


def parse_faults(spec: str) -> Faults:
    """Read SPEC; UsageError, saying what there is, where it is none."""
    return tuple(_fault(part.strip()) for part in spec.split(",") if part.strip())


def _fault(text: str) -> Fault:
    match = _FAULT.fullmatch(text)
    if match is None or match["name"] not in KINDS:
        raise UsageError(
            f"--faults {text}: write name[=value]@line or name[=value]%rate, such as lost-ok@150 or garble-in%0.001; "
            f"there are {', '.join(KINDS)}"
        )
    usual = KINDS[match["name"]].value
    if match["value"] is not None and usual is None:
        raise UsageError(f"--faults {text}: {match['name']} takes no value")
    value = _number(match["value"], text) if match["value"] else usual or 0.0
    rate = _number(match["rate"], text) if match["rate"] else 0.0
    if rate > 1 or (match["rate"] and not rate):
        raise UsageError(f"--faults {text}: a rate is a probability, more than 0 and at most 1")
    return Fault(match["name"], value, int(match["line"]) if match["line"] else None, rate)


def _number(text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < 1e9:
        raise UsageError(f"--faults {whole}: {text} is no number from 0 on")
    return value


class Strikes:
    """Decides which faults strike as lines pass a stage; @line faults once, the others by chance."""

    def __init__(self, faults: Faults, seed: int) -> None:
        self.random = Random(f"faults {seed}")
        self._at: dict[Stage, dict[int, list[Fault]]] = {stage: {} for stage in Stage}
        self._by_chance: dict[Stage, list[Fault]] = {stage: [] for stage in Stage}
        for fault in faults:
            if fault.line is None:
                self._by_chance[fault.stage].append(fault)
            else:
                self._at[fault.stage].setdefault(fault.line, []).append(fault)
        self.on_line, self.on_command, self.on_ok = (bool(self._at[s] or self._by_chance[s]) for s in Stage)

    def at(self, stage: Stage, number: int | None) -> list[Fault]:
        """Return the faults that strike the line of this number at this stage."""
        struck = self._at[stage].pop(number, []) if number is not None else []
        chance = self.random.random
        return struck + [fault for fault in self._by_chance[stage] if chance() < fault.rate]

    def flipped(self, data: bytes) -> bytes:
        """Return the bytes with one bit of them flipped."""
        if not data:
            return data
        changed = bytearray(data)
        changed[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
        return bytes(changed)
