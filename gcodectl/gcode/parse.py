"""Bytes to lines, and what a line says: one pass over the bytes, the words by their 26 letters.

    N10 G1 X1.5Y-2 ; text*71 LF      letters are words, spaces do not matter, `;` ends the line's commands,
    ---- == ==== ==  --------        `( )` is skipped, `"..."` is text, `*` is the checksum of all before it
    label command words  comment

Rules:
- The first G, M or T word commands. Modal words (G90, G21, G17, M83 ...) become bits in `modes` and may stand beside
  it; alone, the last of them is the code. A second command makes the line SEVERAL, except `T0 M6` and a spindle word.
- A line of words alone is BARE: it belongs to the last motion. A first word that is not letter + number is EXTENDED.
- M codes that take a text (M117, M486 ...) end there. Exponents: see numbers.py.
- `{...}` (RepRapFirmware's expression, or a slicer's placeholder left unfilled) makes a motion EXTENDED.
- UNSAFE is what no printer can be trusted to read as meant: `#`, `[`, O-words, opposite modes, a stray character
  in a G line, a carriage return inside a line, a checksum that does not match.

Sources: NIST RS274/NGC section 3, reprap.org's G-code page, Marlin's src/gcode/parser.cpp, Klipper's klippy/gcode.py.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Bytes, Floats, Ints
from gcodectl.gcode.codes import Code, Mode
from gcodectl.gcode.dialects import NAME_HASHES, TEXT_COMMANDS
from gcodectl.gcode.names import extended_kernel
from gcodectl.gcode.numbers import byte_kernel, digits_kernel
from gcodectl.gcode.words import (
    SEEN,
    bare_kernel,
    command_kernel,
    first_kernel,
    letter_bits,
    list_kernel,
    rest_kernel,
    sign_kernel,
    spaces_kernel,
    stray_kernel,
    tool_kernel,
)
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Blocks

__all__ = ["Code", "Mode", "parse"]

_NONE, _UNSAFE = int(Code.NONE), int(Code.UNSAFE)
_M = 100_000
_ODD = int(Mode.ODD)
_COMMANDS = letter_bits("GMT")


@jit_inline
def block_kernel(
    text: Bytes, i: int, n: int, names: Ints, texts: Bools, words: Floats
) -> tuple[int, int, int, int, int, int]:
    """Read the line at `i`, its words by letter into `words`.

    Returns (position of its LF, or `n`; letters as bits; code; modes; digits after the point of X Y Z; and of E).
    """
    words[:] = np.nan
    begin = i
    code, modes, present, places, e_places, stray = _NONE, 0, 0, -1, -1, False
    while i < n:
        c = byte_kernel(text, i)
        letter = c & 0xDF
        if 65 <= letter <= 90:
            bit = 1 << (letter - 65)
            start = i
            after = i + 1
            follows = byte_kernel(text, after) if after < n else 10
            form = 0
            if code == _NONE and not present & SEEN and (follows < 48 or follows > 57 or letter == 79):
                form = first_kernel(text, i, n)
            if follows == 32:
                after = spaces_kernel(text, after, n)
            if form != 0:
                code = _UNSAFE
                if form == 1:
                    code = extended_kernel(text, i, n, words, names)
                i, clean = rest_kernel(text, i, n)
                code = code if clean else _UNSAFE
            elif bit & _COMMANDS and (letter != 84 or tool_kernel(code, present)):
                i, code, modes = command_kernel(text, after, n, letter, code, modes)
                if letter == 77 and _M <= code < _M + 20_000 and texts[(code - _M) // 10]:
                    i, clean = rest_kernel(text, i, n)
                    code = code if clean else _UNSAFE
            else:
                value, i, digits, found = digits_kernel(text, after, n, c < 91)
                follows = byte_kernel(text, i) if i < n else 10
                if found:
                    words[np.uint64(letter - 65)] = value
                    present |= bit
                    if letter >= 88:
                        places = max(places, digits)
                    elif letter == 69:
                        e_places = digits
                    if follows == 32:
                        i += 1
                    elif follows == 58:
                        modes |= _ODD
                        i = list_kernel(text, i, n)
                else:
                    modes |= _ODD
                    i = start + 1
                    stray = stray or (code < _M and i < n and 65 <= byte_kernel(text, i) & 0xDF <= 90)
        elif c == 32 or c == 9:
            i += 1
        elif c == 10:
            break
        elif c == 59:
            while i < n and byte_kernel(text, i) != 10 and byte_kernel(text, i) != 13:
                i += 1
        else:
            i, code, modes, odd = sign_kernel(text, i, begin, n, code, modes, present & SEEN != 0)
            stray = stray or odd
    if stray:
        code, modes = stray_kernel(code, modes)
    elif present & SEEN and code != 10:
        code = bare_kernel(code, present)
    return i, present, code, modes, places, e_places


@jit_lean
def parse_kernel(
    text: Bytes,
    names: Ints,
    texts: Bools,
    cuts: Ints,
    code: Ints,
    modes: Ints,
    decimals: NDArray[np.int8],
    words: Floats,
) -> int:
    """Fill one row a line of `text`, and where lines begin and end; returns the number of rows."""
    n = len(text)
    row = i = 0
    cuts[0] = 0
    while i < n:
        i, _, code[row], modes[row], places, e_places = block_kernel(text, i, n, names, texts, words[row])
        decimals[row, 0], decimals[row, 1] = places, e_places
        i = min(i + 1, n)
        row += 1
        cuts[row] = i
    return row


@dataclasses.dataclass(frozen=True)
class Lines:
    """A chunk of whole lines, numbered. `interpret` reads their words as it goes: to keep them all takes its time."""

    text: Bytes
    line: int
    """1-based number of the first line in the file."""
    count: int

    def __len__(self) -> int:
        return self.count

    @cached_property
    def blocks(self) -> Blocks:
        """What every line says, one row a line."""
        rows = self.count
        cuts, code, modes = np.empty(rows + 1, np.int64), np.empty(rows, np.int64), np.empty(rows, np.int64)
        words, decimals = np.empty((rows, 26)), np.empty((rows, 2), np.int8)
        filled = parse_kernel(self.text, NAME_HASHES, TEXT_COMMANDS, cuts, code, modes, decimals, words)
        assert filled == rows, f"{filled} rows read of {rows} lines"
        numbers = np.arange(self.line, self.line + rows)
        return Blocks(self.text, cuts[:-1], cuts[1:], numbers, code, modes, words, decimals)


def parse(chunks: Iterable[bytes]) -> Iterator[Lines]:
    """Yield the Lines of every chunk of whole lines (see lines.read_chunks); never refuses."""
    line = 1
    for chunk in chunks:
        if not chunk:
            continue
        text = np.frombuffer(chunk, dtype=np.uint8)
        count = int(np.count_nonzero(text == 10)) + (not chunk.endswith(b"\n"))
        yield Lines(text, line, count)
        line += count
