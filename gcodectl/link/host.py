"""The host's side of the link: a job goes down it, every line exactly once and in order. No I/O, and no clock.

    receive(bytes, now)   what the printer said          transmit() -> bytes   what is to be written now
    advance(now)          let time pass                  deadline() -> when    to come back at the latest

Rules, beside those of `outbox` and `protocol`:
1. ok, busy and resend requests are signs of life. Reports that come by themselves are none, save while it heats.
2. The job is done when M400 is answered, and the M105 after it, which no surplus ok can answer.
3. What ends a job early ends in STOPPING (`stopping`), never in silence.

Sources: Marlin gcode/queue.cpp; feature/host_actions.cpp; gcode/host/M115.cpp; Configuration_adv.h.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from gcodectl.errors import CancelledError, DisconnectedError, FirmwareError, GcodectlError, NoAnswerError
from gcodectl.link import ending
from gcodectl.link.job import BASE, Line
from gcodectl.link.known import Known
from gcodectl.link.listening import HANDLERS
from gcodectl.link.outbox import Outbox
from gcodectl.link.patience import Patience
from gcodectl.link.protocol import Phase, Step, follow
from gcodectl.link.replies import read_replies
from gcodectl.link.settings import Settings
from gcodectl.link.stopping import Stopping
from gcodectl.link.wire import Splitter, numbered

NUMBERING = numbered(BASE, b"M110 N%d" % BASE)
ASKED = 2
"""Times a printer that said no more than its first `ok` is asked after before it is given up."""
GREET_EVERY = 2.0
"""s between two attempts to be heard."""


class Host:
    """One job, from the greeting to its end; `failure` says why it ended early.

    The job gives None where it has no line ready yet: it is asked again at the next `transmit`.
    """

    def __init__(self, job: Iterable[Line | None], settings: Settings | None = None, now: float = 0.0) -> None:
        self.settings = settings or Settings()
        self.outbox = Outbox(self.settings)
        self.phase = Phase.GREETING
        self.failure: GcodectlError | None = None
        self.stopping: Stopping | None = None
        self.printer = Known()
        self.reached = 0
        """The line of the file that was acknowledged last."""
        self.pulled = 0.0
        """mm of E that the stop pulled back."""
        self.notes: list[str] = []
        """What happened, for people; whoever shows them takes them out."""
        self._job: Iterator[Line | None] = iter(job)
        self.hungry = False
        """The job has no line ready yet."""
        self.own: list[bytes] = []
        self.urgent = bytearray()
        self._splitter = Splitter()
        self.now = self._began = self.greet_at = now
        self.patience = Patience(self.settings, now)
        self.doubt: tuple[float, str] | None = None
        self.odd = (0, 0)
        """The line that was asked for out of reason, and how often in a row."""
        self.heard = False
        """An `ok` came while greeting."""
        self.port_until = self.reopen_until = math.inf
        """The port is gone, and waited for until then; and how long it is at all, however often it goes."""

    # what the outside calls

    @property
    def ended(self) -> bool:
        """Whether all is over; what `transmit` still returns must be written all the same."""
        return self.phase is Phase.ENDED

    @property
    def bare(self) -> bool:
        """Whether it is stopping by lines without numbers: nothing of the numbered stream matters any more."""
        return self.stopping is not None and not self.stopping.orderly

    @property
    def safe(self) -> bool:
        """Whether the printer is in order: the job done, never begun, or the printer itself says that it is cold."""
        return self.failure is None or self.stopping is None or self.stopping.confirmed

    def receive(self, data: bytes, now: float) -> None:
        """Take what the printer said."""
        self.now = now
        if self.phase is Phase.ENDED:
            return
        for line in self._splitter.feed(data):
            for reply in read_replies(line):
                if handle := HANDLERS.get(reply.kind):
                    handle(self, reply)
        if self.phase is not Phase.PRINTING:
            self._move_on()

    def transmit(self) -> bytes:
        """Return what is to be written now."""
        urgent = b""
        if self.urgent:
            urgent = bytes(self.urgent)
            self.urgent.clear()
        phase = self.phase
        if self.doubt or self.bare or phase is Phase.GREETING or phase is Phase.ENDED:
            return urgent
        first = not self.outbox.flight.count
        data = self.outbox.transmit(self._fetch, self.now, fresh=phase is not Phase.PAUSED)
        if data and first:
            self.patience.life = self.now  # patience begins with the command
        return urgent + data

    def prepare(self) -> None:
        """Make the next line ready, while the printer is at the one before: nothing waits for it then."""
        if self.phase is Phase.PRINTING:
            self.outbox.prepare(self._fetch)

    def advance(self, now: float) -> None:
        """Let time pass until `now`."""
        self.now = now
        self.outbox.advance(now)
        if self.phase is Phase.GREETING:
            self._greet()
        elif self.doubt and now >= self.doubt[0]:
            self.fail(FirmwareError(f"the printer says: {self.doubt[1]}"))
        elif self.stopping and now >= min(self.stopping.deadline, self.port_until):
            ending.go_on(self)
        elif now >= self._ask_at():
            self._ask_after()
        self._move_on()

    def deadline(self) -> float:
        """Return when `advance` has to be called at the latest."""
        if self.phase is Phase.ENDED:
            return math.inf
        if self.phase is Phase.GREETING:
            return min(self.greet_at, self._began + self.settings.connect)
        if self.port_until < math.inf:
            return self.port_until
        times = [self.outbox.deadline, self._ask_at()]
        if self.doubt:
            times.append(self.doubt[0])
        if self.stopping:
            times.append(self.stopping.deadline)
        return min(times)

    def cancel(self, why: GcodectlError, now: float) -> None:
        """End the job in good order: nothing more of it is sent, pressure released, heaters off."""
        self.now = now
        ending.in_order(self, why)

    def emergency(self, why: str, now: float) -> None:
        """Send M112 past everything, bare and then numbered, and end."""
        self.now = now
        ending.at_once(self, CancelledError(why))

    def disconnected(self, why: str, now: float) -> None:
        """The port is gone; it may come back to make the printer safe."""
        self.now = now
        ending.lost(self, DisconnectedError(why))

    def reconnected(self, now: float) -> None:
        """The port is back."""
        self.now = now
        self._splitter = Splitter()
        ending.found(self)

    # the steps between phases

    def go(self, step: Step) -> bool:
        """Follow `step` where the table has it."""
        phase = follow(self.phase, step)
        if phase is None:
            return False
        self.phase = phase
        return True

    def _move_on(self) -> None:
        """Take the next phase where this one's work is done."""
        done = self.outbox.idle and not self.own
        if self.phase is Phase.ASKING and done:
            if self.printer.reports and self.settings.report > 0:
                self.own.append(b"M155 S%d" % max(1, round(self.settings.report)))
            self.go(Step.ASKED)
        elif self.phase is Phase.FINISHING and done:
            self.go(Step.FINISHED)
        elif self.stopping and self.stopping.orderly and done and self.phase is Phase.STOPPING:
            if self.printer.cold:
                self.end(confirmed=True)
            else:
                self.stopping.hurry(self.now)

    def _fetch(self) -> Line | None:
        """Return the next new command."""
        if self.own:
            return Line(0, self.own.pop(0))
        if self.phase is not Phase.PRINTING:
            return None
        try:
            line = next(self._job)
        except StopIteration:
            pass
        except GcodectlError as error:
            self.cancel(error, self.now)
            return None
        else:
            self.hungry = line is None
            return line
        self.hungry = False
        self.go(Step.DRAINED)
        self.own = [b"M400", *([b"M155 S0"] if self.printer.reports else []), b"M105"]
        return Line(0, self.own.pop(0))

    def fail(self, error: GcodectlError, *, halted: bool = False) -> None:
        """End the job with `error`; what is on its way is not waited for.

        `halted`: the printer has stopped by itself already.
        """
        ending.failed(self, error, halted=halted)

    def end(self, *, confirmed: bool = False) -> None:
        """Be done; `confirmed`: the printer has said that it is safe."""
        if self.stopping:
            self.stopping.confirmed = confirmed
        self.phase = Phase.ENDED

    # time

    def _greet(self) -> None:
        if self.now >= self._began + self.settings.connect:
            wait = self.settings.connect
            self.fail(NoAnswerError(f"no printer answers within {wait:g} s: is it the right port, and --baud?"))
        elif self.heard and self.now >= self.greet_at:
            self.go(Step.GREETED)
            self.own = [b"M115", b"M113", b"M105"]
        elif self.now >= self.greet_at:
            self.greet_at = self.now + GREET_EVERY
            self.urgent += b"\n" + NUMBERING  # the line end closes what a host before this one left half said

    def _ask_at(self) -> float:
        """When the printer has been silent long enough to be asked."""
        outbox = self.outbox
        return math.inf if self.bare or outbox.holding or not outbox.flight else self.patience.ask_at(outbox.probes)

    def _ask_after(self) -> None:
        """Ask after an answer that stays away, or give up."""
        quiet = self.now - self.patience.life
        unheard = self.phase is Phase.ASKING and self.outbox.probes >= ASKED
        if unheard or self.patience.over(self.outbox.probes, self.now):
            self.fail(NoAnswerError(f"the printer has not answered for {quiet:.0f} s"))
            return
        self.notes.append(f"no answer for {quiet:.0f} s: asking")
        self.urgent += self.outbox.probe(self.now)
