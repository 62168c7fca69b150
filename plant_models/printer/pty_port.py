"""A pseudo terminal with a name of its own.

A pty tells that its host has gone only if nobody else holds it open, and forgets its raw mode when nobody does: so
we hold it open until the host has sent its first bytes, let go, and take hold again when the host has gone.
"""

from __future__ import annotations

import errno
import os
import termios
import tty
from pathlib import Path

from gcodectl.errors import UsageError
from plant_models.printer.ports import CHUNK, Closing


class PtyPort(Closing):
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
