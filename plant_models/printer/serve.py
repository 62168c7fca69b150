"""Puts a virtual printer on a pty or a TCP port, and gives it a clock.

    port --bytes--> printer.receive(data, now)     real time, N times as fast:   now = N * seconds since the start
         <--------- printer.transmit()             as fast as it goes:           now stands still while input comes and
    sleep until printer.deadline(), or bytes come  jumps to deadline() when the printer is blocked, or when nothing has
                                                   come for 50 ms

A jump never overtakes a host: bytes that are there already are read before it.
"""

from __future__ import annotations

import math
import os
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from plant_models.printer.ports import Port
from plant_models.printer.virtual import VirtualPrinter

QUIET = 0.05
"""s without input after which a clock that only jumps goes on."""
PATIENCE = 0.02
"""s between looks at a port that is lost, and at a host that does not read."""
UNHEARD = 1 << 20
"""Bytes kept for a host that does not read."""
LONGEST_WAIT = 3600.0
"""Real s of one wait; no select() takes what a command can be told to take."""
LONGEST_CLOSED = 1.0
"""Real s that a lost port stays away at the most, where time jumps."""


class Clock:
    """The printer's time: `speed` times real time; inf: it stands still and is moved by `jump`."""

    def __init__(self, speed: float) -> None:
        self.speed = speed
        self._start = time.monotonic()
        self._now = 0.0

    @property
    def jumps(self) -> bool:
        """Whether time passes by jumps alone."""
        return math.isinf(self.speed)

    def now(self) -> float:
        """Return the printer's time, s."""
        if not self.jumps:
            self._now = (time.monotonic() - self._start) * self.speed
        return self._now

    def jump(self, to: float) -> None:
        """Move a clock that jumps."""
        self._now = max(self._now, to)

    def until(self, due: float) -> float:
        """Return the real seconds until `due`."""
        return max(due - self.now(), 0.0) / self.speed


class Server:
    """Serves one printer on one port until it is told to stop, or (once) until its first host has gone."""

    def __init__(
        self,
        printer: VirtualPrinter,
        port: Port,
        *,
        speed: float = 1.0,
        once: bool = False,
        log: Callable[[float, str, bytes], None] | None = None,
    ) -> None:
        self._printer, self._port, self._once, self._log = printer, port, once, log
        self._clock = Clock(speed)
        self._stop, self._wake = os.pipe()
        self._stopped = False
        self._heard = time.monotonic()
        self._unsent = b""
        self._reopen = math.inf

    def stop(self) -> None:
        """End `run`; may be called from another thread or a signal handler."""
        self._stopped = True
        if self._wake >= 0:
            os.write(self._wake, b"x")

    def run(
        self,
        finish: Callable[[VirtualPrinter], None] | None = None,
        ready: Callable[[], None] | None = None,
    ) -> None:
        """Serve; `ready` is called when hosts can come, `finish` when the port is closed again."""
        try:
            with _stopping_on_signals(self.stop), self._port:
                if ready is not None:
                    ready()
                self._serve()
        finally:
            ends, self._stop, self._wake = (self._stop, self._wake), -1, -1
            for end in ends:
                os.close(end)
        if finish is not None:
            finish(self._printer)

    def _serve(self) -> None:
        printer, port, clock = self._printer, self._port, self._clock
        self._speak()
        while not self._stopped:
            if not port.is_open:
                self._wait_for_port()
                continue
            if self._ready(self._patience()):
                data = port.read()
                if data:
                    self._note("<", data)
                    printer.receive(data, clock.now())
                    self._heard = time.monotonic()
            elif clock.jumps and self._may_jump():
                clock.jump(printer.deadline())
                if not printer.blocked and printer.motion.idle:
                    self._heard = time.monotonic()  # autoreports and the like: one at a time
            printer.advance(clock.now())
            self._speak()
            if printer.closed:
                self._lose_port()
            elif self._once and port.left:
                return

    def _patience(self) -> float:
        """Return how long to wait for bytes, real s."""
        due = self._printer.deadline()
        if self._clock.jumps:
            if due == math.inf:
                wait = math.inf
            elif self._printer.blocked:
                wait = 0.0
            else:
                wait = max(self._heard + QUIET - time.monotonic(), 0.0)
        else:
            wait = math.inf if due == math.inf else self._clock.until(due)
        return min(wait, PATIENCE if self._unsent else LONGEST_WAIT)

    def _may_jump(self) -> bool:
        if self._printer.deadline() == math.inf or self._unsent:
            return False
        return self._printer.blocked or time.monotonic() - self._heard >= QUIET

    def _ready(self, wait: float) -> bool:
        """Wait for bytes, s; whether the port has something to read."""
        readers = [self._stop, *self._port.readers()]
        writers = [self._port.fileno()] if self._unsent and self._port.there else []
        can_read, can_write, _ = select.select(readers, writers, [], wait)
        if can_write:
            self._flush()
        return any(one != self._stop for one in can_read)

    def _speak(self) -> None:
        """Send what the printer has to say; what nobody is there to hear is lost, as on a wire."""
        data = self._printer.transmit()
        if data:
            self._note(">", data)
            self._unsent = (self._unsent + data)[-UNHEARD:]
        if self._unsent:
            self._flush()

    def _flush(self) -> None:
        self._unsent = b"" if self._port.deaf else self._unsent[self._port.write(self._unsent) :]

    def _lose_port(self) -> None:
        """Let the port go away for as long as the printer's is closed."""
        self._port.close()
        self._unsent = b""
        away = self._printer.open_at - self._clock.now()
        real = min(away, LONGEST_CLOSED) if self._clock.jumps else away / self._clock.speed
        self._reopen = time.monotonic() + real

    def _wait_for_port(self) -> None:
        """Let the printer go on alone until its port is back."""
        left = self._reopen - time.monotonic()
        if left > 0:
            select.select([self._stop], [], [], min(left, PATIENCE))
        elif self._clock.jumps:
            self._clock.jump(self._printer.open_at)
        self._printer.advance(self._clock.now())
        self._printer.transmit()
        if not self._printer.closed:
            self._port.open()

    def _note(self, way: str, data: bytes) -> None:
        if self._log is not None:
            self._log(self._clock.now(), way, data)


@contextmanager
def _stopping_on_signals(stop: Callable[[], None]) -> Iterator[None]:
    """Make SIGINT and SIGTERM call `stop`, where signals can be had: in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda *_: stop()) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
