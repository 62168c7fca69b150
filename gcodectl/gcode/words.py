"""One word of a line at a time: the kernels that parse.py's loop calls, and the rules by which commands join.

A line's result so far is four integers: `CODE` and `MODES` as in Blocks, `SEEN` 1 once a word with a value was read,
`STRAY` 1 once something stood there that has no meaning in G-code.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Bytes, Floats, Ints
from gcodectl.gcode.codes import Code, Mode
from gcodectl.gcode.numbers import number_kernel
from gcodectl.jit import jit

CODE, MODES, SEEN, STRAY = 0, 1, 2, 3

_NONE, _EXTENDED, _UNSAFE, _T_OTHER = int(Code.NONE), int(Code.EXTENDED), int(Code.UNSAFE), int(Code.T_OTHER)
_HARMLESS, _VELOCITY, _BARE, _SEVERAL = int(Code.HARMLESS), int(Code.VELOCITY_LIMIT), int(Code.BARE), int(Code.SEVERAL)
_M, _T, _M6, _M82, _M83 = 100_000, 200_000, int(Code.M6), int(Code.M82), int(Code.M83)
_CANCEL, _ODD, _CHECKSUM = int(Mode.CANCEL), int(Mode.ODD), int(Mode.CHECKSUM)


@jit
def rest_kernel(text: Bytes, i: int, n: int) -> tuple[int, bool]:
    """Skip to the line's LF or `n`: (position, whether no carriage return stood but at the line's end)."""
    clean = True
    while i < n and text[i] != 10:
        if text[i] == 13 and i + 1 < n and text[i + 1] != 10 and text[i + 1] != 13:
            clean = False
        i += 1
    return i, clean


@jit
def mode_bit_kernel(code: int) -> int:
    """Return the Mode bit of a modal word's code, 0 for a command."""
    if code < 170:
        return 0
    if code <= 210:
        return (1, 2, 4, 8, 16)[(code - 170) // 10] if code % 10 == 0 else 0
    if code == 900:
        return 32
    if code == 910:
        return 64
    if code == 901:
        return 128
    if code == 911:
        return 256
    if code == _M82:
        return 512
    if code == _M83:
        return 1024
    return _CANCEL if code == 400 or code == 490 or code == 610 or code == 640 or code == 800 or code == 940 else 0


@jit
def spindle_kernel(code: int) -> bool:
    """Tell whether a code is a spindle or coolant word, M3 to M9 without M6."""
    return _M + 30 <= code <= _M + 90 and code != _M6


@jit
def merge_kernel(new: int, state: Ints) -> None:
    """Add a command word to the line: modal words become bits, of two commands one must yield."""
    code, modes = state[CODE], state[MODES]
    bit = mode_bit_kernel(new)
    old_bit = mode_bit_kernel(code)
    if bit:
        modes |= bit
        pair = (modes & 24) == 24 or (modes & 96) == 96 or (modes & 384) == 384 or (modes & 1536) == 1536
        planes = modes & 7
        state[MODES] = modes
        if pair or (planes & (planes - 1)):
            state[STRAY] = 1
        elif code == _NONE or old_bit == _CANCEL or (old_bit and bit != _CANCEL):
            state[CODE] = new
    elif code == _NONE or old_bit:
        state[CODE] = new
    elif spindle_kernel(new) or (code >= _T and new == _M6):
        pass
    elif spindle_kernel(code):
        state[CODE] = new
    else:
        state[CODE] = _SEVERAL


@jit
def command_kernel(text: Bytes, i: int, n: int, letter: int, state: Ints) -> int:
    """Read the number of a G, M or T word at `i`; returns the position after it."""
    value, after, decimals, found = number_kernel(text, i, n, False)
    if letter == 84:
        if found and 0 <= value <= 32_000 and decimals == 0:
            merge_kernel(_T + int(value), state)
        else:
            merge_kernel(_T_OTHER, state)
            after = max(after, i + 1) if not found else after
    elif found and 0 <= value < 10_000:
        merge_kernel(int(value * 10 + 0.5) + (_M if letter == 77 else 0), state)
    elif _M <= state[CODE] < _T:
        state[MODES] |= _ODD
    else:
        state[STRAY] = 1
    return after


@jit
def word_kernel(text: Bytes, i: int, n: int, words: Floats, decimals: NDArray[np.int8], state: Ints) -> int:
    """Read the word at `i` that is no command into `words`; returns the position after it."""
    c = int(text[i])
    letter = c & 0xDF
    i += 1
    value, after, places, found = number_kernel(text, spaces_kernel(text, i, n), n, c < 91)
    if not found:
        state[MODES] |= _ODD
        if i < n and 65 <= (text[i] & 0xDF) <= 90 and state[CODE] < _M:
            state[STRAY] = 1
        return i
    words[letter - 65] = value
    if letter != 78:
        state[SEEN] = 1
    if letter >= 88:
        decimals[0] = max(int(decimals[0]), places)
    elif letter == 69:
        decimals[1] = places
    if after < n and text[after] == 58:
        state[MODES] |= _ODD
        while after < n and (43 <= text[after] <= 58 and text[after] != 47):
            after += 1
    return after


@jit
def spaces_kernel(text: Bytes, i: int, n: int) -> int:
    """Return the position of the first byte at or after `i` that is neither space nor tab."""
    while i < n and (text[i] == 32 or text[i] == 9):
        i += 1
    return i


@jit
def first_kernel(text: Bytes, i: int, n: int) -> int:
    """Tell what the first word at `i` is: 0 letter + number, 1 an extended name, 2 an O-word or an expression."""
    letter = int(text[i]) & 0xDF
    k = spaces_kernel(text, i + 1, n)
    c = int(text[k]) if k < n else 10
    plain = 48 <= c <= 57 or c == 45 or c == 43 or c == 46
    if (letter == 79 and (plain or c == 60)) or c == 91 or c == 35:
        return 2
    if plain:
        return 0
    if letter == 84 and k == i + 1 and (c == 63 or (c & 0xDF) == 88 or (c & 0xDF) == 67):
        follows = int(text[k + 1]) & 0xDF if k + 1 < n else 10
        return 1 if 65 <= follows <= 95 else 0
    return 1


@jit
def checksum_kernel(text: Bytes, begin: int, i: int, n: int) -> bool:
    """Tell whether the checksum after the `*` at `i` is that of the bytes before it (or a CRC, five digits)."""
    total = 0
    for k in range(begin, i):
        total ^= int(text[k])
    value, after, _, found = number_kernel(text, spaces_kernel(text, i + 1, n), n, False)
    return found and (value == total or after - i > 5)


@jit
def finish_kernel(words: Floats, state: Ints) -> None:
    """Settle what the line is once all of it was read."""
    code = int(state[CODE])
    if state[STRAY]:
        followed = code == _M82 or code == _M83 or _M + 2000 <= code <= _M + 2060 or code == _M + 5660
        if _M <= code < _T and not followed and not _M + 2200 <= code <= _M + 2210:
            state[MODES] |= _ODD
        else:
            state[CODE] = _UNSAFE
    elif state[SEEN] and (code == _NONE or mode_bit_kernel(code)):
        coordinates = code == _NONE
        for letter in (0, 1, 2, 4, 5, 8, 9, 10, 17, 20, 21, 22, 23, 24, 25):  # A B C E F I J K R U V W X Y Z
            coordinates = coordinates or not np.isnan(words[letter])
        if coordinates and code != 610 and code != 800:
            state[CODE] = _BARE
