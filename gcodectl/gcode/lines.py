"""Bytes to whole lines: a stream in, chunks of complete lines out, as soon as they are there.

A line ends with LF; the CR of a CRLF rides along in its line, so every byte leaves as it came. A CR alone (old Mac
files) ends no line: printers disagree on it, so the parser refuses a line that has one in its middle.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

from gcodectl.errors import InputError

MAX_LINE = 1 << 20
"""Longest line that is read, bytes: thumbnails and object polygons stay far below."""


def read_chunks(stream: BinaryIO, size: int = 1 << 18) -> Iterator[bytes]:
    """Yield the stream as chunks of whole lines; only the last may lack its newline.

    Reads at most `size` bytes at once and never waits for more than the next line: lines that a pipe has now leave
    now. Raises InputError on a line longer than MAX_LINE.
    """
    size = max(1, min(size, MAX_LINE))
    read = getattr(stream, "read1", stream.read)
    carry: list[bytes] = []
    carried = 0
    line = 1
    while data := read(size):
        head = data.find(b"\n") + 1
        if carried + (head or len(data)) > MAX_LINE:
            text = (b"".join(carry) + data)[:80]
            raise InputError(
                f"the line is longer than {MAX_LINE} bytes; is this G-code, with line feeds?", line=line, text=text
            )
        if not head:
            carry.append(data)
            carried += len(data)
            continue
        tail = data.rfind(b"\n") + 1
        chunk = b"".join((*carry, data[:tail]))
        carry = [data[tail:]] if tail < len(data) else []
        carried = len(data) - tail
        line += int(np.count_nonzero(np.frombuffer(chunk, dtype=np.uint8) == 10))
        yield chunk
    if carry:
        yield b"".join(carry)
