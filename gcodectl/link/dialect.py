"""What differs from firmware to firmware, and what a line leaves in the buffer of each.

Source: Marlin, Configuration.h, Configuration_adv.h, queue.cpp (process_stream_char).
"""

from __future__ import annotations

from dataclasses import dataclass

from gcodectl.errors import UsageError
from gcodectl.link.wire import LONGEST

LEAST = {"places": 1, "longest": 1, "rx_bytes": 1, "wait": 0, "keepalive": 0, "extruders": 1}


@dataclass(frozen=True)
class Dialect:
    """What differs from firmware to firmware; as it stands: Marlin 2.1 with EMERGENCY_PARSER. Times s."""

    places: int = 4
    """Commands that the queue holds, the one that is carried out among them (BUFSIZE)."""
    longest: int = LONGEST
    """Bytes of a line that are kept (MAX_CMD_SIZE - 1)."""
    rx_bytes: int | None = None
    """Bytes that are kept while the queue is full; None: as many as come (flow control, as USB has)."""
    advanced_ok: bool = False
    """`ok N<line> P<free blocks> B<free places>` (ADVANCED_OK)."""
    emergency_parser: bool = True
    """M108, M112, M410, M524 and M876 act as they are received (EMERGENCY_PARSER)."""
    ok_after_resend: bool = True
    """`Resend: n` is followed by `ok`."""
    drop_repeats: bool = True
    """The last two lines, sent again, are dropped silently (2.1 and later), not answered with Resend."""
    flush_on_error: bool = True
    """An error throws away what has been received but not read."""
    paren_comments: bool = False
    """(...) is a comment too (PAREN_COMMENTS)."""
    quoted_strings: bool = False
    """; within "..." begins no comment (GCODE_QUOTED_STRINGS)."""
    wait: float = 0.0
    """Says `wait` this often when it has nothing to do; 0: never (NO_TIMEOUTS)."""
    keepalive: float = 2.0
    """Says `echo:busy: processing` this often; M113 changes it; 0: never (HOST_KEEPALIVE_FEATURE)."""
    greeting: bool = True
    """Says `start` and what it is when it boots."""
    extruders: int = 1
    """Tools that T knows."""

    def __post_init__(self) -> None:
        for name, least in LEAST.items():
            value = getattr(self, name)
            if value is not None and value < least:
                raise UsageError(f"the virtual printer's {name} is {value}; it must be at least {least}")


def cleaned(raw: bytes, dialect: Dialect) -> bytes:
    """Return what process_stream_char makes of a line: comments, escapes, backspaces and overflow byte by byte."""
    kept = bytearray()
    quoted = escaped = paren = False
    for byte in raw:
        if paren:
            paren = byte != 0x29
            continue
        if escaped:
            escaped = False
        elif byte == 0x5C:
            escaped = True
            if not quoted:
                continue
        elif quoted:
            quoted = byte != 0x22
        elif byte == 0x22 and dialect.quoted_strings:
            quoted = True
        elif byte == 0x3B:
            break
        elif byte == 0x28 and dialect.paren_comments:
            paren = True
            continue
        if byte == 0x08:
            del kept[-1:]
            continue
        kept.append(byte)
        if len(kept) >= dialect.longest:
            break
    return bytes(kept)
