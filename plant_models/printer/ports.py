"""The two ports a virtual printer may have: a pty with a name of its own, or a TCP port.

A pty tells that its host has gone only if nobody else holds it open, and forgets its raw mode when nobody does: so
we hold it open until the host has sent its first bytes, let go, and take hold again when the host has gone.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import termios
import tty
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from gcodectl.errors import NoPortError, UsageError

CHUNK = 4096


class Port(Protocol):
    """What hosts come and go at; entered, it is open, and left, it is gone."""

    left: bool
    """A host was there, and has gone; cleared when the next one comes."""

    @property
    def name(self) -> str:
        """What hosts call it."""

    @property
    def is_open(self) -> bool:
        """Whether hosts can come."""

    @property
    def there(self) -> bool:
        """Whether there is something to write to."""

    @property
    def deaf(self) -> bool:
        """Whether what is written now would be heard by nobody."""

    def readers(self) -> list[int]:
        """Return the descriptors that may have something to read."""

    def fileno(self) -> int:
        """Return the descriptor that is written to."""

    def read(self) -> bytes:
        """Return bytes that came; nothing where a host came or went."""

    def write(self, data: bytes) -> int:
        """Write what can be written without waiting; return how many bytes."""

    def open(self) -> None:
        """Be there (again); NoPortError where that cannot be."""

    def close(self) -> None:
        """Be gone, for a while or for good."""

    def __enter__(self) -> Self:
        """Open."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""


class _Closing:
    """Opens where a `with` begins, closes where it ends."""

    def open(self) -> None:
        raise NotImplementedError

    def close(self) -> None:
        raise NotImplementedError

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class PtyPort(_Closing):
    """A pseudo terminal, with a symbolic link to it at a path that hosts know."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.left = False
        self._master, self._slave, self._tty = -1, -1, ""

    def open(self) -> None:
        """Make the terminal and its link; UsageError where something else is in the link's place."""
        if self.link.exists() or (self.link.is_symlink() and not str(self.link.readlink()).startswith("/dev/")):
            raise UsageError(f"{self.link} is there already; name another path with --link, or remove it")
        if not self.link.absolute().parent.is_dir():
            raise UsageError(f"there is no folder {self.link.absolute().parent} for --link; make it first")
        self._master, self._slave = os.openpty()
        self._tty = os.ttyname(self._slave)
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(self._tty)

    def close(self) -> None:
        """Remove the link, if it is still ours, and the terminal."""
        if self._master < 0:
            return
        if self.link.is_symlink() and str(self.link.readlink()) == self._tty:
            self.link.unlink()
        self._let_go()
        os.close(self._master)
        self._master = -1

    @property
    def name(self) -> str:
        """The link's path."""
        return str(self.link)

    @property
    def is_open(self) -> bool:
        """Whether there is a terminal."""
        return self._master >= 0

    @property
    def there(self) -> bool:
        """A terminal keeps what is written for whoever comes."""
        return self._master >= 0

    @property
    def deaf(self) -> bool:
        """Once a host has gone, nobody is there until the next one speaks."""
        return self.left

    def readers(self) -> list[int]:
        """Return the master's end."""
        return [self._master]

    def fileno(self) -> int:
        """Return the master's end."""
        return self._master

    def read(self) -> bytes:
        """Return what the host sent; nothing when it has just gone."""
        try:
            data = os.read(self._master, CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            self._take_hold()
            return b""
        if data:
            self.left = False
            self._let_go()
        return data

    def write(self, data: bytes) -> int:
        """Write what the terminal takes; it may take nothing while the host does not read."""
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            return len(data)

    def _let_go(self) -> None:
        if self._slave >= 0:
            os.close(self._slave)
            self._slave = -1

    def _take_hold(self) -> None:
        """The host has gone: what it did not read is not for the next one."""
        self._slave = os.open(self._tty, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._slave)
        termios.tcflush(self._slave, termios.TCIFLUSH)
        self.left = True


class TcpPort(_Closing):
    """A TCP port, one host at a time; whoever else comes is turned away."""

    def __init__(self, host: str, port: int) -> None:
        self.host, self.port = host, port
        self.left = False
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None

    def open(self) -> None:
        """Listen; NoPortError where the address is taken or not ours. Port 0: a free one, that `port` says then."""
        try:
            self._listener = socket.create_server((self.host, self.port))
        except OSError as error:
            raise NoPortError(f"cannot listen at {self.host}:{self.port}: {error.strerror or error}") from None
        self.port = self._listener.getsockname()[1]

    def close(self) -> None:
        """Close both the host's connection and the port."""
        self._drop()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    @property
    def name(self) -> str:
        """Its address, as pyserial takes it."""
        return f"socket://{self.host}:{self.port}"

    @property
    def is_open(self) -> bool:
        """Whether hosts can come."""
        return self._listener is not None

    @property
    def there(self) -> bool:
        """Whether a host is connected."""
        return self._client is not None

    @property
    def deaf(self) -> bool:
        """What is said before the first host comes waits for it; after that it is lost while nobody is there."""
        return self._client is None and self.left

    def readers(self) -> list[int]:
        """Return the port's and the host's descriptors."""
        return [one.fileno() for one in (self._listener, self._client) if one is not None]

    def fileno(self) -> int:
        """Return the host's descriptor, or the port's."""
        one = self._client or self._listener
        assert one is not None, "the port is closed"
        return one.fileno()

    def read(self) -> bytes:
        """Let a host in, and return what the one that is in sent; nothing where it has gone."""
        assert self._listener is not None, "the port is closed"
        ready, _, _ = select.select(self.readers(), [], [], 0)
        if self._listener.fileno() in ready:
            self._let_in(self._listener)
        if self._client is None or self._client.fileno() not in ready:
            return b""
        try:
            data = self._client.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._drop()
            self.left = True
        return data

    def write(self, data: bytes) -> int:
        """Write what the connection takes."""
        if self._client is None:
            return 0
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:  # it has gone: `read` will see that
            return len(data)

    def _let_in(self, listener: socket.socket) -> None:
        with suppress(OSError):  # gone again before we looked
            client, _ = listener.accept()
            if self._client is not None:
                client.close()
                return
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.setblocking(False)
            self._client, self.left = client, False

    def _drop(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
