"""The numbered stream to a printer: what may be sent now, what was answered, and how to go back when asked.

        first        acked       cursor          store.next
    ------|------------|-----------|------------------|- - - - - ->   line numbers
          '---- kept for ever -----'-- to send again -'-- new ones --
                       '- flight --'

Rules:
1. A number, once given, stands for the same bytes for ever, so a line that comes twice is no other line.
2. A request to resend is followed within [acked + 1, store.next], and up to SLACK lines further back where the printer
   insists; nowhere else: a line further back was carried out. The requests of one damaged line come in bursts (one for
   each line behind it), and some firmware sends an `ok` after each and some does not: so after the first, nothing is
   sent until what the printer had taken before is answered and SETTLE has passed: what comes then is of that burst.
   A request that is not followed is no answer either: an `ok` right behind it counts for nothing.
3. An answer that stays away is asked after by an M105 with the next new number, and nothing is ever repeated unasked.
   If the line was lost, the printer asks for it now; if its ok was lost, the M105's answers it too.
4. While lines are sent again, the window is one.

Sources: Marlin gcode/queue.cpp (get_serial_commands, flush_and_request_resend, ok_to_send).
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from typing import NamedTuple

from gcodectl.link.flight import ASK, Flight
from gcodectl.link.job import BASE, Line
from gcodectl.link.replies import Reply
from gcodectl.link.settings import Settings
from gcodectl.link.store import Store
from gcodectl.link.wire import numbered

SETTLE = 0.05
"""s in which what belongs to a resend request has come."""
HOLD = 3.0
"""s without a sign of life after which what the printer took before the request is not waited for any more."""
SLACK = 8
"""Lines behind the last acknowledged one that may be asked for: acknowledgements can be counted wrong by a few."""


class _Waiting(NamedTuple):
    """A new command, numbered and not yet sent."""

    number: int
    fresh: Line
    line: bytes


class Again(enum.Enum):
    """What became of a request to resend."""

    FOLLOWED = enum.auto()
    ODD = enum.auto()
    """For a line that was answered, or never sent: not followed."""
    TOO_OFTEN = enum.auto()


class Outbox:
    """Numbered lines to one printer."""

    def __init__(self, settings: Settings) -> None:
        self.store = Store(BASE + 1)
        self.flight = Flight()
        self.acked = BASE
        """The highest number that was answered."""
        self.sent_at = -math.inf
        self.resent = 0
        self.probes = 0
        """Questions after a missing answer since the last answer."""
        self._settings = settings
        self._cursor = self.store.next
        self._waiting: _Waiting | None = None
        self._held_until: float | None = None
        self._odd_until = -math.inf
        self._places = 1
        self._times: dict[int, int] = {}

    @property
    def idle(self) -> bool:
        """Whether all that was numbered is answered."""
        return not (self.flight or self._waiting or self.holding) and self._cursor == self.store.next

    @property
    def holding(self) -> bool:
        """Whether a request to resend is being waited out."""
        return self._held_until is not None

    @property
    def deadline(self) -> float:
        """When `advance` has something to do."""
        return math.inf if self._held_until is None else self._held_until

    def discard(self) -> None:
        """Forget the command that was fetched and not yet sent."""
        self._waiting = None

    def prepare(self, fetch: Callable[[], Line | None]) -> bool:
        """Number the next new command ahead of time; returns whether there is one."""
        waiting, number = self._waiting, self.store.next
        if waiting is None:
            fresh = fetch()
            if fresh is None:
                return False
        elif waiting.number == number:
            return True
        else:
            fresh = waiting.fresh
        self._waiting = _Waiting(number, fresh, numbered(number, fresh.command))
        return True

    def transmit(self, fetch: Callable[[], Line | None], now: float, *, fresh: bool = True) -> bytes:
        """Return the lines that may be sent now; `fetch` gives the next new command, None for none.

        Without `fresh` only what is to be sent again.
        """
        out, flight = b"", self.flight
        while self._held_until is None:
            number = self._cursor
            if number < self.store.next:
                if flight.count:
                    break
                line = self.store.line(number)
                command = line[line.index(b" ") + 1 : line.rindex(b"*")]
            else:
                full = flight.count and flight.count >= (self._settings.window or self._places)
                if full or not fresh or not self.prepare(fetch):
                    break
                waiting = self._waiting
                assert waiting is not None
                _, (source, command), line = waiting
                if flight.count and not self._fits(len(line)):
                    break
                self.store.append(line, source)
                self._waiting = None
            self._send(number, line, command, now)
            out += line
        return out

    def _send(self, number: int, line: bytes, command: bytes, now: float) -> None:
        self._cursor = number + 1
        self.flight.add(number, len(line), command)
        self.sent_at = now

    def _fits(self, size: int) -> bool:
        """Whether the printer's buffer has room: the oldest command has left it to be carried out."""
        oldest = self.flight.oldest
        return self.flight.size - (oldest.size if oldest else 0) + size <= self._settings.rx_bytes

    def probe(self, now: float) -> bytes:
        """Return an M105 with the next new number, whatever the window: to learn what became of the lines before it."""
        self.probes += 1
        number = self.store.next
        line = numbered(number, ASK)
        self.store.append(line)
        if self._cursor == number:  # else lines before it wait to be sent again, and it follows them
            self._send(number, line, ASK, now)
        return line

    def emergency(self) -> bytes:
        """Return a numbered M112."""
        line = numbered(self.store.next, b"M112")
        self.store.append(line)
        return line

    def answered(self, reply: Reply, now: float) -> bool:
        """Take an ok; returns whether it answered anything."""
        if now < self._odd_until:
            self._odd_until = -math.inf
            return False
        if reply.queue is not None:
            self._places = max(self._places, reply.queue)
        number = self.flight.answered(reply, probing=self.probes > 0)
        if self._held_until is not None and not self.flight.count:
            # the request's own ok ends the wait; that of the last line before it begins the short one
            self._held_until = None if number is None else now + SETTLE
        if number is None:
            return False
        self.probes = 0
        if number > self.acked:
            self.acked = number
            if self._times:
                self._times = {one: times for one, times in self._times.items() if one > number}
        return True

    def again(self, number: int, now: float, *, insists: bool = False) -> Again:
        """Go back to line `number`, as the printer asks; `insists`: it has asked for it when it was asked, too."""
        oldest = self.acked + 1 - (SLACK if insists else 0)
        if not max(self.store.first, oldest) <= number <= self.store.next:
            self._odd_until = now + SETTLE
            return Again.ODD
        if self.holding and number == self._cursor:
            return Again.FOLLOWED  # of the same burst
        if number < self._cursor:
            self._times[number] = self._times.get(number, 0) + 1
            self.resent += 1
            if self._times[number] > self._settings.resends:
                return Again.TOO_OFTEN
        self._cursor = number
        self.flight.drop(number)
        self._held_until = now + (HOLD if self.flight else SETTLE)
        return Again.FOLLOWED

    def alive(self, now: float) -> None:
        """Take a sign of life: what was sent before a request to resend is still being carried out."""
        if self._held_until is not None and self.flight:
            self._held_until = now + HOLD

    def advance(self, now: float) -> None:
        """End the wait after a request to resend, where it is over."""
        if self._held_until is not None and now >= self._held_until:
            self.flight.clear()
            self._held_until = None
