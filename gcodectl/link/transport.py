"""A port by its URL: opened, read, written; what goes wrong on it is a NoPortError or a DisconnectedError.

/dev/ttyACM0   COM3   socket://host:port   rfc2217://host:port   hwgrep://regexp   auto

pyserial opens all of them. Where the port has a file descriptor that can be waited on, it is read and written directly,
because pyserial's own reads cost several system calls each. pyserial empties the input when it opens a port: the
`start` of a printer that resets at once may be lost, so nothing waits for it.
"""

from __future__ import annotations

import os
import select
import time
from typing import Any

from gcodectl.errors import DisconnectedError, NoPortError

AUTO = "auto"
STUCK = 10.0
"""s that a port may take to accept one write."""
EMPTY = 3
"""Reads in a row that give nothing, though there is something to read, from a port that is closed; a terminal device
may do so once for no reason."""
_READ = 4096


class Port:
    """An open port."""

    def __init__(self, serial: Any, name: str) -> None:
        self.name = name
        self._serial = serial
        self._fd = _descriptor(serial)
        self._empty = 0

    def read(self, timeout: float) -> bytes:
        """Return what has come, empty where nothing does within `timeout` s.

        Raises DisconnectedError where the port is gone; it may take some reads to say so.
        """
        try:
            if self._fd is None:
                self._serial.timeout = timeout
                return bytes(self._serial.read(max(1, self._serial.in_waiting)))
            if not select.select([self._fd], [], [], timeout)[0]:
                return b""
            data = os.read(self._fd, _READ)
            self._empty = 0 if data else self._empty + 1
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:  # pyserial's SerialException is an OSError
            raise DisconnectedError(f"{self.name} was lost: {error}") from error
        if self._empty >= EMPTY:
            raise DisconnectedError(f"{self.name} was closed by the other side")
        return data

    def write(self, data: bytes) -> None:
        """Write all of `data`; DisconnectedError where the port is gone, or takes nothing for STUCK s."""
        try:
            if self._fd is None:
                self._serial.write(data)
                return
            until = time.monotonic() + STUCK
            while data:
                try:
                    data = data[os.write(self._fd, data) :]
                except BlockingIOError:
                    left = until - time.monotonic()
                    if left <= 0 or not select.select([], [self._fd], [], left)[1]:
                        raise DisconnectedError(f"{self.name} takes nothing for {STUCK:g} s") from None
        except (OSError, ValueError) as error:
            raise DisconnectedError(f"{self.name} was lost: {error}") from error

    def close(self) -> None:
        """Close it."""
        self._serial.close()


def _descriptor(serial: Any) -> int | None:
    """Return what can be waited on and read directly; None where only pyserial can."""
    if os.name != "posix":
        return None
    try:
        return int(serial.fileno())
    except (AttributeError, OSError, ValueError):  # io.UnsupportedOperation is both of these
        return None


def open_port(url: str, baud: int) -> Port:
    """Open the port; NoPortError, with the ports there are, where that cannot be."""
    import serial

    name = find_port() if url == AUTO else url
    try:
        opened = serial.serial_for_url(name, baudrate=baud, timeout=0, write_timeout=STUCK)
    except (serial.SerialException, OSError, ValueError) as error:
        known = ", ".join(one.device for one in _ports()) or "none"
        raise NoPortError(f"cannot open {name}: {_reason(error)}; the serial ports here: {known}") from error
    return Port(opened, name)


def _reason(error: Exception) -> str:
    text = str(error)
    if "Permission denied" in text:
        return "permission denied (on Linux, add yourself to the group dialout)"
    if "busy" in text.lower() or "lock" in text.lower():
        return "another program has it open"
    return text


def _ports() -> list[Any]:
    from serial.tools import list_ports

    return sorted(list_ports.comports(), key=lambda one: str(one.device))


def find_port() -> str:
    """Return the one serial port that could be a printer; NoPortError where there is none, or several."""
    ports = _ports()
    usb = [one for one in ports if one.vid is not None] or ports
    if len(usb) == 1:
        return str(usb[0].device)
    if not usb:
        raise NoPortError("there is no serial port here: connect the printer, or give --port")
    listed = ", ".join(f"{one.device} ({one.description})" for one in usb)
    raise NoPortError(f"there are several serial ports; say which with --port: {listed}")
