"""Runs a Host on a port: the only place of the link that has a port and a clock."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import BinaryIO, Protocol

from gcodectl.errors import CancelledError, DisconnectedError, NoPortError
from gcodectl.link.host import Host
from gcodectl.link.wire import Splitter

LOOK = 0.01
"""s between two looks at the clock's business: deadlines, signals."""
TURN = 0.1
"""s between two moments to show how far the job is."""
HUNGRY = 0.005
"""s between two looks at a job that has no line ready."""
RETRY = 0.5
"""s between two attempts to open a port that went away."""


class Wire(Protocol):
    """What a Sender asks of a port (`transport.Port`)."""

    def read(self, timeout: float) -> bytes:
        """Return what has come, waiting up to `timeout` s."""

    def write(self, data: bytes) -> None:
        """Write all."""

    def close(self) -> None:
        """Close it."""


class Log:
    """Every line each way with its time, as text: seconds, `>` to the printer or `<` from it, the line."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._splitters = {">": Splitter(), "<": Splitter()}

    def take(self, way: str, data: bytes, now: float) -> None:
        """Write the lines that are whole now."""
        for line in self._splitters[way].feed(data):
            self._file.write(b"%.6f %s %s\n" % (now, way.encode(), line))

    def flush(self) -> None:
        """Have it all on disk."""
        self._file.flush()


class Sender:
    """Sends a job down a port until the host says that it has ended."""

    def __init__(
        self,
        host: Host,
        open_port: Callable[[], Wire],
        *,
        log: Log | None = None,
        on_turn: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.host = host
        self._open = open_port
        self._log = log
        self._on_turn = on_turn
        self._clock = clock
        self._port: Wire | None = None
        self._cancels = 0
        self._taken = 0
        self._began = clock()
        self._turn_at = -math.inf

    def cancel(self) -> None:
        """Ask for the end of the job, from a signal handler: once in good order, twice by M112."""
        self._cancels += 1

    def run(self) -> None:
        """Send the job; NoPortError where the port cannot be opened at first. How it ended is the host's to say."""
        self._port = self._open()
        host, look_at = self.host, -math.inf
        try:
            while not host.ended:
                now = self._clock()
                if now >= look_at:
                    look_at = now + LOOK
                    self._look(now)
                self._write(host.transmit())
                if self._port is None:
                    self._reopen()
                else:
                    self._hear()
            self._write(host.transmit())
        finally:
            self._on_turn()
            if self._port is not None:
                self._port.close()
            if self._log:
                self._log.flush()

    def _look(self, now: float) -> None:
        """Do what is done by the clock."""
        host = self.host
        if self._cancels > self._taken:
            self._cancel(now)
        if now >= host.deadline():
            host.advance(now)
        if now >= self._turn_at:
            self._turn_at = now + TURN
            self._on_turn()
            if self._log:
                self._log.flush()

    def _hear(self) -> None:
        """Wait a moment for what the printer says, and hand it over; the next line is made ready meanwhile."""
        host, port = self.host, self._port
        assert port is not None
        host.prepare()
        try:
            data = port.read(HUNGRY if host.hungry else LOOK)
        except DisconnectedError as error:
            self._lost(error)
            return
        if data:
            now = self._clock()
            if self._log:
                self._log.take("<", data, now - self._began)
            host.receive(data, now)

    def _write(self, data: bytes) -> None:
        if not data or self._port is None:
            return
        if self._log:
            self._log.take(">", data, self._clock() - self._began)
        try:
            self._port.write(data)
        except DisconnectedError as error:
            self._lost(error)

    def _cancel(self, now: float) -> None:
        first = self._taken == 0
        self._taken = self._cancels
        if first:
            self.host.cancel(CancelledError("stopped by you"), now)
        else:
            self.host.emergency("stopped at once by you (M112)", now)

    def _lost(self, error: DisconnectedError) -> None:
        if self._port is not None:
            self._port.close()
        self._port = None
        self.host.disconnected(str(error), self._clock())

    def _reopen(self) -> None:
        time.sleep(RETRY)
        try:
            self._port = self._open()
        except NoPortError:
            return
        self.host.reconnected(self._clock())
