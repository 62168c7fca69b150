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
from plant_models.printer.codes import Wait
from plant_models.printer.faults import Fault, Faults, Stage, Strikes
from plant_models.printer.motion import Motion, Still
from plant_models.printer.outlet import Outlet
from plant_models.printer.upsets import incoming, outgoing, strike

__all__ = ["Executed", "Motion", "Still", "VirtualPrinter"]
STUCK = 1000
"""Things that may happen at one moment; more is a mistake of ours."""


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
        self._outlet = Outlet()
        self.partial = b""
        """What has come of a line that is not whole; used where faults strike lines."""
        self._current: Queued | None = None
        self.commands: Commands
        self._boot()

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
        return self._outlet.transmit()

    def deadline(self) -> float:
        """Return when something happens by itself at the latest, s; inf: never."""
        if not self.alive:
            return math.inf
        due = self.motion.deadline()
        if self._current is not None:
            due = min(due, self._over_at(), self._busy_at)
        elif self.dialect.wait and self.receiver.idle:
            due = min(due, self._wait_at)
        if self.closed:
            due = min(due, self.open_at)
        return min(due, self._outlet.due, self.commands.thermals.report_at)

    # how it stands

    @property
    def blocked(self) -> bool:
        """Whether it cannot go on until time passes: planner full, dwell, heating, waiting for its motion's end."""
        return self.alive and (self._current is not None or self._outlet.holds)

    @property
    def closed(self) -> bool:
        """Whether its port is gone."""
        return self.now < self.open_at

    # carrying out

    def _go_on(self) -> None:
        """Carry out what the queue holds as far as it goes without waiting."""
        receiver = self.receiver
        while self.alive:
            if receiver.urgent:
                self._urgently()
                continue
            if receiver.pending:
                self.say(receiver.transmit())
            if self._current is not None:
                if not self._over():
                    return
                self._end(self._current)
            elif (command := receiver.take()) is not None:
                self._begin(command)
            else:
                return

    def _begin(self, command: Queued) -> None:
        now = self.now
        self._delay_until = self._silent_until = -math.inf
        if self.strikes.on_command:
            for fault in self.strikes.at(Stage.COMMAND, command.number):
                if not strike(self, fault):
                    return
        self._current = command
        self.executed.append(Executed(command.number, command.text, now))
        self._busy_at = now + self.commands.keepalive if self.commands.keepalive else math.inf
        self._wait = self.commands.begin(command.text, now)

    def _over(self) -> bool:
        wait = self._wait
        if wait is Wait.MOTION:
            if not self.motion.ready():
                return False
        elif wait is Wait.HEAT and self.now < self.commands.thermals.heat_until:
            return False
        return self.now >= self._delay_until

    def _over_at(self) -> float:
        """Return when the command in progress may be over, as far as time alone decides."""
        heat = self.commands.thermals.heat_until if self._wait is Wait.HEAT else -math.inf
        due = max(heat, self._delay_until)
        return due if due > self.now else math.inf

    def _end(self, command: Queued) -> None:
        self.commands.end(self.now)
        self._current = None
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
        self._outlet.release(now)
        self._go_on()
        if not self.alive:
            return
        if self._current is not None:
            if now >= self._busy_at:
                if now >= self._silent_until:
                    self.say(b"echo:busy: processing\n")
                self._busy_at = now + self.commands.keepalive if self.commands.keepalive else math.inf
        elif self.dialect.wait and now >= self._wait_at and self.receiver.idle:
            self.say(b"wait\n")
            self._wait_at = now + self.dialect.wait
        self.commands.thermals.report(now, quiet=now < self._silent_until)

    # saying, failing

    def say(self, data: bytes, late: float = 0.0) -> None:
        """Send bytes, `late` s from now, and never before what is held back already."""
        if self.closed:
            return
        due = max(self.now + late, self._silent_until if self._current is not None else 0.0)
        self._outlet.say(data, due, self.now)

    def delay(self, fault: Fault) -> None:
        """Make the command that begins take longer, silently or not."""
        self._delay_until = max(self._delay_until, self.now + fault.value)
        if fault.name == "silence":
            self._silent_until = self._delay_until

    def kill(self) -> None:
        """Stop for good, as kill() does: heaters off, motion dropped."""
        self.say(b"Error:Printer halted. kill() called!\n")
        self.die()

    def die(self) -> None:
        """Be silent from now on."""
        self._outlet.flush()
        self.motion.quickstop(self.now)
        self.commands.thermals.heaters_off(self.now)
        self.alive = False

    def reset(self) -> None:
        """Boot again: queue, modes and position are lost, heaters are off, everything said is cut off."""
        self._outlet.hold_nothing()
        self.receiver.reset()
        self.motion.quickstop(self.now)
        for text in (b"G90", b"M82", b"M220 S100", b"M221 S100", b"G92 X0 Y0 Z0 E0"):
            self.motion.take(text, self.now)
        self._boot()

    def close(self, seconds: float) -> None:
        """Lose the port for a while; what is under way on it is lost."""
        self._outlet.lose()
        self.partial = b""
        self.open_at = self.now + seconds

    def _boot(self) -> None:
        self.partial = b""
        self._current = None
        self._wait = Wait.NO
        self._delay_until = self._silent_until = -math.inf
        self._busy_at = math.inf
        self._wait_at = self.now + self.dialect.wait
        self.commands = Commands(
            self.machine, self.dialect, self.motion, self.receiver, self.say, self.act, self._score
        )
        if self.dialect.greeting:
            self.say(self.commands.greeting())

    def _commands(self) -> Commands:
        return Commands(self.machine, self.dialect, self.motion, self.receiver, self.say, self.act, self._score)

    def _score(self) -> str:
        return self.on_score(self) if self.on_score is not None else "nothing is scored here"
