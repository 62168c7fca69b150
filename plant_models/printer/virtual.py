"""The virtual printer: bytes and time in, bytes out; it carries out one command at a time, as Marlin's loop does.

    receive --> [faults: LINE] --> Receiver (queue of 4) --> begin --> Commands / Motion --> over? --> ok --> transmit
                                                               |                              |
                                                        [faults: COMMAND]        until then: blocked, echo:busy,
                                                                                 temperatures; still reads

An `ok` says that a command is done: its motion is in the planner's buffer (a G1 waits for a place there), a dwell or a
wait is over. Time passes only in `advance` and `receive`; what happens by itself happens at `deadline`, in order.
Sources: Marlin, MarlinCore.cpp (loop, idle, kill), gcode.cpp (process_parsed_command, host_keepalive), queue.cpp.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from gcodectl.config import Machine
from gcodectl.link.receiver import Dialect, Queued, Receiver
from plant_models.printer.answers import Commands
from plant_models.printer.faults import Faults, Stage, Strikes
from plant_models.printer.motion import Motion, Still
from plant_models.printer.outlet import Outlet
from plant_models.printer.turn import Turn
from plant_models.printer.upsets import incoming, outgoing, strike

__all__ = ["Executed", "Motion", "Still", "VirtualPrinter"]
STUCK = 100_000
"""Things that may happen at one moment; more is a mistake of ours. Very late, a block takes less than time can show."""


class Executed(NamedTuple):
    """A command that was carried out: the number it came with, its text without number and checksum, when it began."""

    number: int | None
    text: bytes
    t: float


class VirtualPrinter:
    """A printer without I/O and without a clock; see the module for how it works."""

    def __init__(
        self,
        machine: Machine,
        *,
        dialect: Dialect | None = None,
        faults: Faults | None = None,
        seed: int = 0,
        motion: Motion | None = None,
    ) -> None:
        self.machine, self.dialect = machine, dialect or Dialect()
        self.motion: Motion = motion or Still()
        self.receiver = Receiver(self.dialect)
        self.strikes = Strikes(faults or (), seed)
        self.executed: list[Executed] = []
        """Every command carried out, once or more, in order."""
        self.alive = True
        """False after a kill or a sudden death: nothing is answered any more."""
        self.on_score: Callable[[VirtualPrinter], str] | None = None
        """Called on `M118 P0 SCORE`; what it returns is said."""
        self.now = 0.0
        self.open_at = -math.inf
        """When the port comes back."""
        self.outlet = Outlet()
        self.partial = b""
        """What has come of a line that is not whole; used where faults strike lines."""
        self.turn = Turn()
        """Of the command that is carried out."""
        self.commands: Commands
        self.boot()

    # the four verbs

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that came at `now`."""
        self.advance(now)
        if not self.alive or self.closed:
            return
        if self.strikes.on_line:
            data = incoming(self, data)
        self.receiver.receive(data)
        self._go_on()
        self.receiver.spill()

    def advance(self, now: float) -> None:
        """Let time pass; what happens by itself until then happens in its order."""
        if not self.alive:
            self.now = max(self.now, now)
            return
        stuck = 0
        while (due := self.deadline()) <= now:
            stuck = 0 if due > self.now else stuck + 1
            assert stuck < STUCK, f"something falls due at {due} s again and again"
            self._at(max(due, self.now))
        if now > self.now:
            self._at(now)

    def transmit(self) -> bytes:
        """Return what is to be sent since the last call."""
        return self.outlet.transmit()

    def deadline(self) -> float:
        """Return when something happens by itself at the latest, s; inf: never."""
        if not self.alive:
            return math.inf
        due = self.motion.deadline()
        if self.turn.command is not None:
            due = min(due, self.turn.due(self.now, self.commands.thermals.heat_until))
        elif self.dialect.wait and self.receiver.idle:
            due = min(due, self._wait_at)
        due = min(due, self.open_at if self.closed else self.outlet.announces_at)
        return min(due, self.outlet.due, self.commands.thermals.report_at)

    # how it stands

    @property
    def blocked(self) -> bool:
        """Whether it cannot go on until time passes: planner full, dwell, heating, waiting for its motion's end."""
        return self.alive and (self.turn.command is not None or self.outlet.holds)

    @property
    def closed(self) -> bool:
        """Whether its port is gone."""
        return self.now < self.open_at

    # carrying out

    def _go_on(self) -> None:
        """Carry out what the queue holds as far as it goes without waiting."""
        receiver, turn = self.receiver, self.turn
        while self.alive:
            if receiver.urgent:
                self._urgently()
                continue
            if receiver.pending:
                self.say(receiver.transmit())
            if turn.command is not None:
                if not turn.over(self.now, self.motion, self.commands.thermals.heat_until):
                    return
                self._end(turn.command)
            elif (command := receiver.take()) is not None:
                self._begin(command)
            else:
                return

    def _begin(self, command: Queued) -> None:
        self.turn.prepare()
        if self.strikes.on_command:
            for fault in self.strikes.at(Stage.COMMAND, command.number):
                if not strike(self, fault):
                    return
        self.executed.append(Executed(command.number, command.text, self.now))
        self.turn.begin(command, self._busy_next())
        self.turn.wait = self.commands.begin(command.text, self.now)

    def _busy_next(self) -> float:
        return self.now + self.commands.keepalive if self.commands.keepalive else math.inf

    def _end(self, command: Queued) -> None:
        self.commands.end(self.now)
        self.turn.end()
        self._wait_at = self.now + self.dialect.wait
        ok = self.receiver.done(self.motion.free())
        ok, self.commands.own_ok = self.commands.own_ok or ok, b""
        if self.strikes.on_ok:
            outgoing(self, ok, command.number)
        else:
            self.say(ok)

    def _urgently(self) -> None:
        for word in self.receiver.urgent[:]:
            self.act(word)
        self.receiver.urgent.clear()

    def act(self, word: str) -> None:
        """Do what cannot wait: M108, M112, M410 (M524 and M876 have nothing to act on)."""
        if word == "M112":
            self.kill()
        elif word == "M410":
            self.motion.quickstop(self.now)
        elif word == "M108":
            self.commands.thermals.heat_until = self.now

    # time

    def _at(self, now: float) -> None:
        """Do what happens by itself at `now`."""
        self.now = now
        self.motion.advance(now)
        self.outlet.release(now)
        for data in () if self.closed else self.outlet.announced(now):
            self.say(data)
        self._go_on()
        if not self.alive:
            return
        turn = self.turn
        if turn.command is not None:
            if now >= turn.busy_at:
                if not turn.silent(now):
                    self.say(b"echo:busy: processing\n")
                turn.busy_at = self._busy_next()
        elif self.dialect.wait and now >= self._wait_at and self.receiver.idle:
            self.say(b"wait\n")
            self._wait_at = now + self.dialect.wait
        self.commands.thermals.report(now, quiet=turn.silent(now))

    # saying, failing

    def say(self, data: bytes, late: float = 0.0) -> None:
        """Send bytes, `late` s from now, and never before what is held back already."""
        if self.closed:
            return
        self.outlet.say(data, self.turn.speaks_at(self.now + late), self.now)

    def kill(self) -> None:
        """Stop for good, as kill() does: heaters off, motion dropped."""
        self.say(b"Error:Printer halted. kill() called!\n")
        self.die()

    def die(self) -> None:
        """Be silent from now on."""
        self.outlet.flush()
        self.motion.quickstop(self.now)
        self.commands.thermals.heaters_off(self.now)
        self.alive = False

    def boot(self) -> None:
        """Begin anew: greet, number, modes and heat forgotten."""
        self.partial = b""
        self.turn = Turn()
        self._wait_at = self.now + self.dialect.wait
        self.commands = Commands(
            self.machine, self.dialect, self.motion, self.receiver, self.say, self.act, self._score
        )
        if self.dialect.greeting:
            self.say(self.commands.greeting())

    def _score(self) -> str:
        return self.on_score(self) if self.on_score is not None else "nothing is scored here"
