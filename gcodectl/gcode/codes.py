"""What a line can command (Code) and the modal words that may stand beside it (Mode).

Codes are numbers, so that kernels compare them: ten times the number after the letter plus the digit after its point,
G from 0 (G92.1 is 921), M from 100_000, T from 200_000 by ones. Below zero are lines that command no such word. Any
number of this form may stand in `Blocks.code`; `Code` names the ones that mean something here.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag

M_BASE = 100_000
T_BASE = 200_000


class Code(IntEnum):
    """What a line commands."""

    NONE = -1
    """Nothing: empty, a comment, `%`."""
    EXTENDED = -2
    """A word that is not letter + number: a Klipper macro, a host command, a block that `/` may skip."""
    HARMLESS = -3
    """An extended command known to move nothing (`EXCLUDE_OBJECT_START ...`)."""
    VELOCITY_LIMIT = -4
    """Klipper's SET_VELOCITY_LIMIT: ACCEL stands in word A, SQUARE_CORNER_VELOCITY in S, VELOCITY in V."""
    BARE = -5
    """Words without a command: they belong to the last G0-G3 (`X10 Y5`), or set F alone."""
    SEVERAL = -6
    """Two commands on one line that no rule orders."""
    RETURNS = -8
    """An extended command that may move, but restores what it changed (`TIMELAPSE_TAKE_FRAME`, `PAUSE`)."""
    UNSAFE = -7
    """A parameter or expression (`#5`, `[...]`), an O-word, a wrong checksum, text no firmware can read."""

    G0 = 0
    G1 = 10
    G2 = 20
    G3 = 30
    G4 = 40
    G10 = 100
    G11 = 110
    G17 = 170
    G18 = 180
    G19 = 190
    G20 = 200
    G21 = 210
    G28 = 280
    G29 = 290
    G80 = 800
    G90 = 900
    G91 = 910
    G90_1 = 901
    G91_1 = 911
    G92 = 920
    M6 = M_BASE + 60
    M82 = M_BASE + 820
    M83 = M_BASE + 830
    M101 = M_BASE + 1010
    M103 = M_BASE + 1030
    M106 = M_BASE + 1060
    M109 = M_BASE + 1090
    M190 = M_BASE + 1900
    M200 = M_BASE + 2000
    M201 = M_BASE + 2010
    M203 = M_BASE + 2030
    M204 = M_BASE + 2040
    M205 = M_BASE + 2050
    M220 = M_BASE + 2200
    M221 = M_BASE + 2210
    M400 = M_BASE + 4000
    M566 = M_BASE + 5660
    T0 = T_BASE
    T_OTHER = T_BASE + 99_999
    """A tool word that names no tool: `T?`, `Tx`, `Tc`, `T-1`."""


class Mode(IntFlag):
    """Modal words on the line, and what else is to be known about it."""

    G17 = 1
    G18 = 2
    G19 = 4
    G20 = 8
    G21 = 16
    G90 = 32
    G91 = 64
    G90_1 = 128
    G91_1 = 256
    M82 = 512
    M83 = 1024
    CANCEL = 2048
    """G40, G49, G61, G64, G80, G94 beside another word: the modes of a mill, at their defaults."""
    ODD = 4096
    """A word without a number, a list (`E1:2`) or a text stands on the line: it must not be rewritten."""
    CHECKSUM = 8192
    """The line carries a checksum: its neighbours count on its number."""


def command_name(code: int) -> str:
    """Return how a command is written: `G92.1`, `M204`, `T1`; empty where the line has none."""
    if code < 0:
        return ""
    if code >= T_BASE:
        return f"T{code - T_BASE}" if code != Code.T_OTHER else "T?"
    letter, number = ("M", code - M_BASE) if code >= M_BASE else ("G", code)
    return f"{letter}{number // 10}" + (f".{number % 10}" if number % 10 else "")
