"""Bytes to Blocks: one pass over the bytes, one row a line, the words into 26 columns.

    N10 G1 X1.5Y-2 ; text*71 LF      letters are words, spaces do not matter, `;` ends the line's commands,
    ---- == ==== ==  --------        `( )` is skipped, `"..."` is text, `*` is the checksum of all before it
    label command words  comment

Rules:
- The first G, M or T word commands. Modal words (G90, G21, G17, M83 ...) become bits in `modes` and may stand beside
  it; alone, the last of them is the code. A second command makes the line SEVERAL, except `T0 M6` and a spindle word.
- A line of words alone is BARE: it belongs to the last motion. A first word that is not letter + number is EXTENDED.
- M codes that take a text (M117, M486 ...) end there. Exponents: see numbers.py.
- `{...}` (a RepRapFirmware expression, or a slicer's placeholder left unfilled) makes a line EXTENDED: who knows.
- UNSAFE is what no printer can be trusted to read as meant: `#`, `[`, O-words, opposite modes, a stray character
  in a G line, a carriage return inside a line, a checksum that does not match.

Sources: NIST RS274/NGC section 3, reprap.org's G-code page, Marlin's src/gcode/parser.cpp, Klipper's klippy/gcode.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Bytes, Floats, Ints
from gcodectl.gcode.codes import Code, Mode
from gcodectl.gcode.dialects import NAME_HASHES, TEXT_COMMANDS
from gcodectl.gcode.names import extended_kernel
from gcodectl.gcode.words import (
    CODE,
    MODES,
    SEEN,
    STRAY,
    checksum_kernel,
    command_kernel,
    finish_kernel,
    first_kernel,
    mode_bit_kernel,
    rest_kernel,
    spaces_kernel,
    word_kernel,
)
from gcodectl.jit import jit
from gcodectl.records import Blocks

__all__ = ["Code", "Mode", "parse"]

_NONE, _EXTENDED, _UNSAFE = int(Code.NONE), int(Code.EXTENDED), int(Code.UNSAFE)
_M, _T = 100_000, 200_000
_ODD, _CHECKSUM = int(Mode.ODD), int(Mode.CHECKSUM)


@jit
def sign_kernel(text: Bytes, i: int, begin: int, n: int, state: Ints) -> int:
    """Deal with the byte at `i` that is neither letter nor space; returns where to go on."""
    c = int(text[i])
    fresh = state[CODE] == _NONE and state[SEEN] == 0
    if c == 40 or c == 34:
        close = 41 if c == 40 else 34
        if c == 34:
            state[MODES] |= _ODD
        i += 1
        while i < n and text[i] != close and text[i] != 10 and text[i] != 13:
            i += 1
        return i + 1 if i < n and text[i] == close else i
    if c == 0xEF and i == begin and i + 2 < n and text[i + 1] == 0xBB and text[i + 2] == 0xBF:
        return i + 3
    if c == 42 and not fresh:
        state[MODES] |= _CHECKSUM
        if not checksum_kernel(text, begin, i, n):
            state[STRAY] = 1
            state[CODE] = _UNSAFE
    elif ((c == 47 or c == 64) and fresh) or c == 123:
        state[CODE] = _EXTENDED
    elif not (c == 59 or c == 13 or (c == 37 and fresh)):
        state[STRAY] = 1
    i, clean = rest_kernel(text, i, n)
    if not clean:
        state[STRAY] = 1
        state[CODE] = _UNSAFE
    return i


@jit
def block_kernel(
    text: Bytes, i: int, n: int, words: Floats, decimals: NDArray[np.int8], names: Ints, texts: Bools, state: Ints
) -> int:
    """Read the line at `i` into `words`, `decimals` and `state`; returns the position of its LF, or `n`."""
    begin = i
    state[CODE], state[MODES], state[SEEN], state[STRAY] = _NONE, 0, 0, 0
    while i < n:
        c = int(text[i])
        if c == 10:
            break
        if c == 32 or c == 9:
            i += 1
            continue
        letter = c & 0xDF
        if c < 65 or not 65 <= letter <= 90:
            i = sign_kernel(text, i, begin, n, state)
            continue
        code = int(state[CODE])
        if code == _NONE and state[SEEN] == 0:
            form = first_kernel(text, i, n)
            if form != 0:
                state[CODE] = extended_kernel(text, i, n, words, names) if form == 1 else _UNSAFE
                i, clean = rest_kernel(text, i, n)
                state[CODE] = state[CODE] if clean else _UNSAFE
                return i
        tool = letter == 84 and state[SEEN] == 0 and (code == _NONE or mode_bit_kernel(code) != 0)
        if letter == 71 or letter == 77 or tool:
            i = command_kernel(text, spaces_kernel(text, i + 1, n), n, letter, state)
            number = (int(state[CODE]) - _M) // 10
            if letter == 77 and 0 <= number < len(texts) and texts[number]:
                i, clean = rest_kernel(text, i, n)
                state[STRAY] = 0 if clean else 1
                break
        else:
            i = word_kernel(text, i, n, words, decimals, state)
    finish_kernel(words, state)
    return i


@jit
def parse_kernel(
    text: Bytes,
    names: Ints,
    texts: Bools,
    start: Ints,
    end: Ints,
    code: Ints,
    modes: Ints,
    words: Floats,
    decimals: NDArray[np.int8],
) -> int:
    """Fill one row a line of `text`; returns the number of rows."""
    n = len(text)
    state = np.zeros(4, dtype=np.int64)
    row = 0
    i = 0
    while i < n:
        start[row] = i
        words[row, :] = np.nan
        decimals[row, :] = -1
        i = block_kernel(text, i, n, words[row], decimals[row], names, texts, state)
        i = min(i + 1, n)
        end[row] = i
        code[row] = state[CODE]
        modes[row] = state[MODES]
        row += 1
    return row


def parse(chunks: Iterable[bytes]) -> Iterator[Blocks]:
    """Yield the Blocks of every chunk of whole lines (see lines.read_chunks), one row a line; never refuses."""
    line = 1
    for chunk in chunks:
        rows = chunk.count(b"\n") + (not chunk.endswith(b"\n"))
        if not chunk:
            continue
        text = np.frombuffer(chunk, dtype=np.uint8)
        columns = {name: array for name, array in Blocks.allocate(0).items() if name != "words"}
        columns = {name: np.empty((rows, *array.shape[1:]), array.dtype) for name, array in columns.items()}
        columns["words"] = np.empty((rows, 26))
        columns["text"] = text
        columns["line"] = np.arange(line, line + rows)
        order = ("start", "end", "code", "modes", "words", "decimals")
        filled = parse_kernel(text, NAME_HASHES, TEXT_COMMANDS, *(columns[name] for name in order))
        assert filled == rows, f"{filled} rows read of {rows} lines"
        line += rows
        yield Blocks(**columns)
