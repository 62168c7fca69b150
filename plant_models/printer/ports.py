"""What a virtual printer asks of its port, and a TCP port."""

from __future__ import annotations

import select
import socket
from abc import ABC, abstractmethod
from contextlib import suppress
from types import TracebackType
from typing import Protocol, Self

from gcodectl.errors import NoPortError

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


class Closing(ABC):
    """Opens where a `with` begins, closes where it ends."""

    @abstractmethod
    def open(self) -> None:
        """Be there."""

    @abstractmethod
    def close(self) -> None:
        """Be gone."""

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class TcpPort(Closing):
    """A TCP port, one host at a time; whoever else comes is turned away."""

    def __init__(self, host: str, port: int) -> None:
        self.host, self.port = host, port
        self.left = False
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None

    def open(self) -> None:
        """Listen; NoPortError where the address is taken or not ours. Port 0: a free one, that `port` says then."""
        try:
            family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
            self._listener = socket.create_server((self.host, self.port), family=family)
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
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"socket://{host}:{self.port}"

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
