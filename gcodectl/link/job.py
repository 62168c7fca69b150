"""A job: the commands of a file, each ready to be sent, or a refusal before anything is.

What becomes of a line:
    comment           dropped: `;` to the end, `(...)`, a `%` or blank line too
    N and checksum    of the file dropped: the link numbers anew
    non-ASCII, control characters
                      in a message (M117, M118, M0, M1) each character becomes `?`; anywhere else the line is refused
    M110              dropped: the link numbers
    M112, M410        refused: firmware obeys them when they arrive, before the moves that stand above them
    too long          refused: firmware cuts it at 95 bytes, number and checksum included, without a word

Text may be UTF-8 or Latin-1, lines may end in LF, CRLF or CR.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from gcodectl.errors import RefusedError
from gcodectl.link.wire import LONGEST, numbered

BASE = 1000
"""Number of the M110 that a job begins with. A printer that was reset in mid-job asks for line 1, which is none of the
job's: it can't be taken for a request to go back."""
_MESSAGE = re.compile(rb"M(?:117|118|0|1)(?![0-9.])", re.IGNORECASE)
_NAMED = re.compile(rb"M(?:23|28|30|32|928)(?![0-9.])", re.IGNORECASE)
_PARENTHESES = re.compile(rb"\([^)]*\)?")
_NUMBER = re.compile(rb"N\d+\s*(?=\D)", re.IGNORECASE)
_CHECKSUM = re.compile(rb"\*\s*\d+\s*$")
_ORDERS = re.compile(rb"(M11[02]|M410)(?![0-9.])", re.IGNORECASE)
_CONTROL = re.compile(rb"[\x00-\x1f\x7f]")
_BREAKS = re.compile(rb"\r\n|\n|\r")


class Line(NamedTuple):
    """A command to be sent, and the line of the file that it stands on (from 1; 0: the link's own)."""

    source: int
    command: bytes


def clean(text: bytes) -> bytes:
    """Return the command on a line of a file, empty where there is none; RefusedError where it must not be sent."""
    text = text.strip()
    message = _MESSAGE.match(text)
    text = text.partition(b";")[0]
    if not message and not _NAMED.match(text) and b"(" in text:
        text = _PARENTHESES.sub(b" ", text)
    if found := _NUMBER.match(text):
        text = _CHECKSUM.sub(b"", text[found.end() :])
        message = _MESSAGE.match(text)
    text = text.replace(b"\t", b" ").strip()
    if text == b"%":
        return b""
    if not text.isascii() or _CONTROL.search(text):
        text = _ascii(text, allowed=message is not None)
    if order := _ORDERS.match(text):
        name = order[1].upper().decode()
        if name != "M110":
            raise RefusedError(f"{name} acts when it arrives, not when its turn has come: take it out")
        return b""
    return text


def _ascii(text: bytes, *, allowed: bool) -> bytes:
    try:
        decoded = text.decode()
    except UnicodeDecodeError:
        decoded = text.decode("latin-1")
    if not allowed:
        strange = next(letter for letter in decoded if not (letter.isascii() and letter.isprintable()))
        raise RefusedError(f"holds {strange!r}, which no firmware reads: take it out")
    return _CONTROL.sub(b"?", decoded.encode("ascii", errors="replace"))


def read_lines(chunks: Iterable[bytes], source: str = "", limit: int = LONGEST) -> Iterator[Line]:
    """Yield the commands of a G-code stream, in whatever chunks it comes.

    Raises RefusedError, naming the line, where one cannot be sent as it must arrive.
    """
    place, carry = 0, b""
    for chunk in chunks:
        *texts, carry = _split(carry + chunk)
        for text in texts:
            place += 1
            yield from _line(place, text, source, limit)
    yield from _line(place + 1, carry, source, limit)


def _split(data: bytes) -> list[bytes]:
    """Split at line ends, but not at a CR that ends the data: it may be the first half of a CRLF."""
    if not data.endswith(b"\r"):
        return _BREAKS.split(data)
    *texts, last = _BREAKS.split(data[:-1])
    return [*texts, last + b"\r"]


def _line(place: int, text: bytes, source: str, limit: int) -> Iterator[Line]:
    try:
        command = clean(text)
    except RefusedError as error:
        raise RefusedError(error.reason, line=place, text=text, source=source) from None
    if not command:
        return
    length = len(numbered(BASE + 10 * place, command)) - 1  # its number on the wire has no more digits than this
    if length > limit:
        raise RefusedError(
            f"takes {length} bytes with its number and checksum; firmware cuts lines at {limit}: shorten it",
            line=place, text=text, source=source,
        )  # fmt: skip
    yield Line(place, command)
