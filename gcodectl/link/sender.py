"""Runs a Host on a port: the only place of the link that has a port and a clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import BinaryIO, Protocol

from gcodectl.errors import CancelledError, DisconnectedError, NoPortError
from gcodectl.link.host import Host
from gcodectl.link.wire import Splitter

TURN = 0.1
"""s between two looks at what else there is to do."""
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

    def cancel(self) -> None:
        """Ask for the end of the job, from a signal handler: once in good order, twice by M112."""
        self._cancels += 1

    def run(self) -> None:
        """Send the job; NoPortError where the port cannot be opened at first. How it ended is the host's to say."""
        self._port = self._open()
        host, turn_at = self.host, self._clock()
        try:
            while not host.ended:
                now = self._clock()
                if self._cancels > self._taken:
                    self._cancel(now)
                if now >= host.deadline():
                    host.advance(now)
                if now >= turn_at:
                    turn_at = now + TURN
                    self._on_turn()
                    if self._log:
                        self._log.flush()
                self._exchange(now, turn_at)
            self._write(host.transmit())
        finally:
            self._on_turn()
            if self._port is not None:
                self._port.close()
            if self._log:
                self._log.flush()

    def _exchange(self, now: float, turn_at: float) -> None:
        """Write what is to be written, wait for what comes, hand it over."""
        host = self.host
        self._write(host.transmit())
        if self._port is None:
            self._reopen()
            return
        try:
            until = min(turn_at, host.deadline(), now + HUNGRY if host.hungry else turn_at)
            data = self._port.read(max(0.0, until - now))
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
