"""What goes over the wire: numbered lines with their checksum, and bytes cut back into lines.

    N<number> <command>*<checksum>\\n        checksum: XOR of all bytes before the *

Source: Marlin, queue.cpp (GCodeQueue::get_serial_commands), MAX_CMD_SIZE in Configuration_adv.h.
"""

from __future__ import annotations

import re

LONGEST = 95
"""Bytes of a line that Marlin keeps, its end not counted (MAX_CMD_SIZE 96, less the closing NUL)."""
UNENDED = 65_536
"""Bytes without a line end after which they are taken as a line all the same: nothing sends such lines on purpose."""
_ENDS = re.compile(rb"[\r\n]+")


def checksum(data: bytes) -> int:
    """Return the XOR of all bytes: the number they make, folded in half until one byte is left."""
    folded, bits = int.from_bytes(data, "little"), 8
    while bits < 8 * len(data):
        bits *= 2
    while bits > 8:
        bits //= 2
        folded ^= folded >> bits
    return folded & 255


def numbered(number: int, command: bytes) -> bytes:
    """Return the line, its end included, that carries `command` as line `number`."""
    line = b"N%d %s" % (number, command)
    return b"%s*%d\n" % (line, checksum(line))


class Splitter:
    """Cuts bytes, as they come, into lines without their ends; empty lines are dropped."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Take more bytes; return the lines that are whole now."""
        if data == b"ok\n" and not self._rest:
            return [b"ok"]  # what nearly all that comes is
        *lines, self._rest = _ENDS.split(self._rest + data)
        if len(self._rest) > UNENDED:
            lines.append(self._rest)
            self._rest = b""
        return [line for line in lines if line]
