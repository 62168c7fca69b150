"""The printer role of Marlin's line protocol, as tables: what a line that has come leads to.

    bytes --> [comment, length] --> line --> Place (of its number) --+
                                       \\--> Sum   (of its checksum) -+--> LINES[place, sum] --> Deed

    Place       N<number> is ...                       Deed
    BARE        not there                              QUEUE    into the queue; `ok` when it has been carried out
    NEXT        the last one + 1                       DROP     nothing is said
    REPEAT      the last one, or the one before        NUMBER   "Line Number is not Last Line Number+1", Resend
    ASTRAY      any other                              CHECKSUM "checksum mismatch", Resend
    SET         M110's: the last one from now on       MISSING  "No Checksum with line number", Resend

The number is looked at before the checksum: a repeated line is dropped even where its checksum is wrong.

The emergency parser reads the same bytes beside the queue, as they come, and knows nothing of checksums:

    start --N--> number --M--> M --1--> M1 --0--> M10 --8--> M108 --line end--> break the wait, and start again
      |            |                                   any other byte: ignore, up to the line end
      +-----M------+           a whole word ignores what follows it: Marlin takes M1123 for M112 as well

Sources: Marlin, queue.cpp (GCodeQueue::get_serial_commands, gcode_line_error), e_parser.cpp (EmergencyParser::update).
"""

from __future__ import annotations

from enum import Enum, auto


class Place(Enum):
    """Where a line's number stands."""

    BARE = auto()
    NEXT = auto()
    REPEAT = auto()
    ASTRAY = auto()
    SET = auto()


class Sum(Enum):
    """What a line's checksum is."""

    RIGHT = auto()
    WRONG = auto()
    NONE = auto()


class Deed(Enum):
    """What is done with a line."""

    QUEUE = auto()
    DROP = auto()
    NUMBER = auto()
    CHECKSUM = auto()
    MISSING = auto()


def _lines() -> dict[tuple[Place, Sum], Deed]:
    in_order = {Sum.RIGHT: Deed.QUEUE, Sum.WRONG: Deed.CHECKSUM, Sum.NONE: Deed.MISSING}
    table = {(place, sum_): deed for place in (Place.NEXT, Place.SET) for sum_, deed in in_order.items()}
    for sum_ in Sum:
        table[Place.BARE, sum_] = Deed.QUEUE
        table[Place.REPEAT, sum_] = Deed.DROP
        table[Place.ASTRAY, sum_] = Deed.NUMBER
    return table


LINES = _lines()
"""What a line leads to; firmware before 2.1 has no REPEAT, it is ASTRAY there."""
SAID = {
    Deed.NUMBER: b"Line Number is not Last Line Number+1, Last Line: ",
    Deed.CHECKSUM: b"checksum mismatch, Last Line: ",
    Deed.MISSING: b"No Checksum with line number, Last Line: ",
}
"""What the firmware says, before the number of the last line."""

START, NUMBER, IGNORE = "start", "number", "ignore"
URGENT = (b"M108", b"M112", b"M410", b"M524")
"""Words that the emergency parser acts on; M876 S<digit> besides."""
ENDS = b"\r\n"


def _emergency() -> dict[tuple[str, int], str]:
    table = {(START, byte): START for byte in b" " + ENDS}
    table |= {(START, ord("N")): NUMBER, (START, ord("M")): "M", ("M", ord(" ")): "M"}
    table |= {(NUMBER, byte): NUMBER for byte in b"0123456789- "} | {(NUMBER, ord("M")): "M"}
    for word in (*URGENT, b"M876"):
        for k in range(1, len(word)):
            table[word[:k].decode(), word[k]] = word[: k + 1].decode()
    table |= {("M876", ord(" ")): "M876", ("M876", ord("S")): "M876S"}
    table |= {("M876S", byte): "M876S" for byte in range(256) if byte not in ENDS}
    table |= {("M876S", byte): f"M876S{chr(byte)}" for byte in b"0123456789"}
    whole = [word.decode() for word in URGENT] + [f"M876S{digit}" for digit in range(10)]
    table |= {(word, byte): word for word in whole for byte in range(256) if byte not in ENDS}
    return table


EMERGENCY = _emergency()
"""The emergency parser's next state for a state and a byte; what is not there is IGNORE."""
ACTS = frozenset(word.decode() for word in URGENT) | {f"M876S{digit}" for digit in range(10)}
"""States in which a line end makes it act."""
