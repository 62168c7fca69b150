"""The printer's end of the line: bytes in, queued commands and answers out; no I/O, no clock.

    bytes --> rx --> line --> number, checksum --> queue (4 places) --> take() --> carried out --> done(): ok
               |                    \\--> Error: ... / Resend: n / ok
               +--> emergency parser --> urgent
    rx holds what comes while the queue is full, and loses what is beyond its size. A command keeps its place in the
    queue while it is carried out. After an error what rx holds is thrown away, as Marlin does: a host that has more
    than one line under way may see the rest of a line that was cut there taken as a line of its own. Lines are read as
    soon as there is a place for them: an error in one is said before the `ok` of those that are queued before it.

Tables: `transitions`. Source: Marlin, queue.cpp (GCodeQueue), parser.cpp (GCodeParser::parse), M110.cpp.
"""

from __future__ import annotations

import re
from collections import deque
from typing import NamedTuple

from gcodectl.link.dialect import Dialect, cleaned
from gcodectl.link.transitions import ACTS, EMERGENCY, ENDS, IGNORE, LINES, SAID, START, Deed, Place, Sum
from gcodectl.link.wire import UNENDED, checksum


class Queued(NamedTuple):
    """A command in the queue: the number it came with, and its text without number and checksum."""

    number: int | None
    text: bytes


class Resend(NamedTuple):
    """How one request to send again is made, where it is to differ from the dialect's way."""

    ok: bool
    times: int = 1


__all__ = ["Dialect", "Queued", "Receiver", "Resend"]

_LINE = re.compile(rb"[^\r\n]*[\r\n]")
_NUMBER = re.compile(rb"[ \t]*([+-]?\d{1,18})")
_PLAIN = re.compile(rb'[^;\\"(\x08]*')
_USUAL = re.compile(rb"(N(\d{1,9}) +([^ \t*;\\\"(\x08][^*;\\\"(\x08]*))\*(\d{1,3})")
"""A line as hosts send nearly all of them: whatever else there is goes the long way, with the same outcome."""
_DULL = re.compile(rb"(?:[ \r\n]*(?:N[-0-9 ]*)?[^NM \r\n0-9-][^\r\n]*[\r\n])+")
"""Whole lines that the emergency parser begins and ends at START: it need not look at their every byte."""
_LEADING = re.compile(rb"N[-\d]*[ \t]*")


class Receiver:
    """Marlin's serial queue: feed it with `receive`, take commands with `take`, say that one is done with `done`."""

    def __init__(self, dialect: Dialect | None = None) -> None:
        self.dialect = dialect or Dialect()
        self.last = 0
        """Number of the last line taken."""
        self.urgent: list[str] = []
        """What is urgent and was found as it came: M108, M112, M410, M524, M876S<digit>; clear it when done."""
        self.resends: dict[int, Resend] = {}
        """How the next request because of this line number is made; each is used once."""
        self.lost = 0
        """Bytes that rx had no room for."""
        self._queue: deque[Queued] = deque()
        self._taken: Queued | None = None
        self._rx, self._at = b"", 0
        self._begun = b""
        self._state = START
        self._out: list[bytes] = []

    def receive(self, data: bytes) -> None:
        """Take bytes that came; lines are read as far as the queue has places. `spill` afterwards bounds the rest."""
        if self.dialect.emergency_parser:
            self._watch(data)
        self._rx = self._rx[self._at :] + data if self._at < len(self._rx) else data
        self._at = 0
        self._read()

    def spill(self) -> None:
        """Lose the bytes that rx has no room for."""
        size = self.dialect.rx_bytes
        if size is not None and len(self._rx) - self._at > size:
            self.lost += len(self._rx) - self._at - size
            self._rx = self._rx[: self._at + size]

    def take(self) -> Queued | None:
        """Return the oldest command of the queue, to be carried out; it keeps its place until `done`."""
        assert self._taken is None, "one command at a time"
        if self._queue:
            self._taken = self._queue[0]
        return self._taken

    def done(self, free: int) -> bytes:
        """End the command that was taken and return its `ok`, which goes out before what `transmit` then has.

        `free`: places left in the planner's buffer, for ADVANCED_OK.
        """
        assert self._taken is not None, "no command was taken"
        ok = self._ok(self._taken, free)
        self._queue.popleft()
        self._taken = None
        self._read()
        return ok

    @property
    def pending(self) -> bool:
        """Whether there are answers to transmit."""
        return bool(self._out)

    def transmit(self) -> bytes:
        """Return the answers since the last call."""
        if not self._out:
            return b""
        out = b"".join(self._out)
        self._out.clear()
        return out

    def reset(self) -> None:
        """Begin anew, as after power on: everything received and queued is lost."""
        fresh = Receiver(self.dialect)
        fresh.lost = self.lost
        self.__dict__.update(fresh.__dict__)

    @property
    def idle(self) -> bool:
        """Whether nothing is queued and nothing waits to be read."""
        return not self._queue and self._at >= len(self._rx)

    @property
    def free(self) -> int:
        """Places left in the queue."""
        return self.dialect.places - len(self._queue)

    def _ok(self, command: Queued, free: int) -> bytes:
        if not self.dialect.advanced_ok:
            return b"ok\n"
        number = b"" if command.number is None else b" N%d" % command.number
        return b"ok%s P%d B%d\n" % (number, free, self.free)

    def _read(self) -> None:
        """Read lines out of rx while the queue has places."""
        queue, places = self._queue, self.dialect.places
        while self._at < len(self._rx) and len(queue) < places:
            match = _LINE.match(self._rx, self._at)
            if match is None:
                self._begun = (self._begun + self._rx[self._at :])[:UNENDED]
                self._rx, self._at = b"", 0
                return
            raw = self._begun + match[0][:-1]
            self._at = match.end()
            self._begun = b""
            if raw and not self._usual(raw):
                line = self._cleaned(raw)
                if line:
                    self._line(line)

    def _usual(self, raw: bytes) -> bool:
        """Queue a numbered line that is the next one and right; whether it was."""
        match = _USUAL.fullmatch(raw)
        if match is None or len(raw) > self.dialect.longest:
            return False
        covered, number, text, told = match.groups()
        if int(number) != self.last + 1 or b"M110" in text or checksum(covered) != int(told):
            return False
        self.last += 1
        self._queue.append(Queued(self.last, text.rstrip(b" ")))
        return True

    def _cleaned(self, raw: bytes) -> bytes:
        """Return what a line leaves in the buffer: no comment, no more than fits."""
        plain = _PLAIN.match(raw)
        assert plain is not None
        if plain.end() == len(raw):
            return raw[: self.dialect.longest]
        return cleaned(raw, self.dialect)

    def _line(self, line: bytes) -> None:
        """Do with a line as LINES has it."""
        command = line.lstrip(b" ")
        place, number = self._place(command)
        deed = Deed.QUEUE if place is Place.BARE else LINES[place, _sum(command)]
        if deed is Deed.QUEUE:
            if number is not None:
                self.last = number
            elif not self.dialect.emergency_parser and command[:4] in (b"M108", b"M112", b"M410"):
                self.urgent.append(command[:4].decode())
            self._queue.append(Queued(number, _text(command)))
        elif deed is not Deed.DROP:
            self._refuse(deed, number)

    def _place(self, command: bytes) -> tuple[Place, int | None]:
        if command[:1] != b"N":
            return Place.BARE, None
        at, place = 0, Place.ASTRAY
        if b"M110" in command:
            at, place = max(command.find(b"N", 4), 0), Place.SET
        match = _NUMBER.match(command, at + 1)
        number = int(match[1]) if match else 0
        if place is not Place.SET:
            if number == self.last + 1:
                place = Place.NEXT
            elif self.dialect.drop_repeats and self.last - 1 <= number <= self.last:
                place = Place.REPEAT
        return place, number

    def _refuse(self, deed: Deed, number: int | None) -> None:
        """Ask for the line after the last one again; what has come but was not read is thrown away."""
        way = self.resends.pop(number, None) if number is not None and self.resends else None
        asked = b"Resend: %d\n" % (self.last + 1)
        if way.ok if way else self.dialect.ok_after_resend:
            asked += b"ok\n"
        self._out.append(b"Error:%s%d\n%s" % (SAID[deed], self.last, asked * (way.times if way else 1)))
        if self.dialect.flush_on_error:
            self._rx, self._at = b"", 0

    def _watch(self, data: bytes) -> None:
        """Let the emergency parser see every byte."""
        state, at, end = self._state, 0, len(data)
        while at < end:
            if state == START and (match := _DULL.match(data, at)):
                at = match.end()
                continue
            if state == IGNORE:
                match = _LINE.match(data, at)
                if match is None:
                    break
                at, state = match.end(), START
                continue
            byte = data[at]
            at += 1
            if byte in ENDS and state != START:
                if state in ACTS:
                    self.urgent.append(state)
                state = START
            else:
                state = EMERGENCY.get((state, byte), IGNORE)
        self._state = state


def _sum(command: bytes) -> Sum:
    star = command.rfind(b"*")
    if star < 0:
        return Sum.NONE
    match = _NUMBER.match(command, star + 1)
    return Sum.RIGHT if (int(match[1]) if match else 0) == checksum(command[:star]) else Sum.WRONG


def _text(command: bytes) -> bytes:
    """Return the command itself, as GCodeParser::parse finds it: no number, nothing from the first * on."""
    number = _LEADING.match(command)
    return command[number.end() if number else 0 :].partition(b"*")[0].rstrip(b" ")
