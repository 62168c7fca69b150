"""One word of a line at a time: the kernels that parse.py's loop calls, and the rules by which commands join.

A line so far is its code and modes (as in Blocks), whether a word with a value was seen, and whether something stray
stood there, which has no meaning in G-code.
"""

from __future__ import annotations

from gcodectl.columns import Bytes
from gcodectl.gcode.codes import Code, Mode
from gcodectl.gcode.numbers import byte_kernel, number_kernel
from gcodectl.jit import jit_inline, jit_lean

_NONE, _EXTENDED, _UNSAFE, _T_OTHER = int(Code.NONE), int(Code.EXTENDED), int(Code.UNSAFE), int(Code.T_OTHER)
_HARMLESS, _VELOCITY, _BARE, _SEVERAL = int(Code.HARMLESS), int(Code.VELOCITY_LIMIT), int(Code.BARE), int(Code.SEVERAL)
_M, _T, _M6, _M82, _M83 = 100_000, 200_000, int(Code.M6), int(Code.M82), int(Code.M83)
_CANCEL, _ODD, _CHECKSUM = int(Mode.CANCEL), int(Mode.ODD), int(Mode.CHECKSUM)


def letter_bits(letters: str) -> int:
    """Return the bits that stand for letters: A is 1, B is 2."""
    return sum(1 << (ord(letter) - 65) for letter in letters)


OF_MOTION = letter_bits("ABCEFIJKRUVWXYZ")
"""Words that mean motion where the line has no command."""
SEEN = letter_bits("ABCDEFGHIJKLMOPQRSTUVWXYZ")
"""All words but N, the line's number."""


@jit_lean
def list_kernel(text: Bytes, i: int, n: int) -> int:
    """Return the position after the list of numbers, `:80:80`, at `i`."""
    while i < n and 43 <= text[i] <= 58 and text[i] != 47:
        i += 1
    return i


@jit_lean
def rest_kernel(text: Bytes, i: int, n: int) -> tuple[int, bool]:
    """Skip to the line's LF or `n`: (position, whether no carriage return stood but at the line's end)."""
    clean = True
    while i < n and text[i] != 10:
        if text[i] == 13 and i + 1 < n and text[i + 1] != 10 and text[i + 1] != 13:
            clean = False
        i += 1
    return i, clean


@jit_lean
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


@jit_lean
def tool_kernel(code: int, present: int) -> bool:
    """Tell whether a T commands, on a line with this so far; behind a command or a word it is a word."""
    return not present & SEEN and (code == _NONE or mode_bit_kernel(code) != 0)


@jit_lean
def spindle_kernel(code: int) -> bool:
    """Tell whether a code is a spindle or coolant word, M3 to M9 without M6."""
    return _M + 30 <= code <= _M + 90 and code != _M6


@jit_lean
def merge_kernel(new: int, code: int, modes: int) -> tuple[int, int]:
    """Add a command word to the line: modal words become bits, of two commands one must yield; (code, modes)."""
    bit = mode_bit_kernel(new)
    old_bit = mode_bit_kernel(code)
    if bit:
        modes |= bit
        planes = modes & 7
        if (modes & 24) == 24 or (modes & 96) == 96 or (modes & 384) == 384 or (modes & 1536) == 1536:
            return _UNSAFE, modes
        if planes & (planes - 1) or code == _UNSAFE:
            return _UNSAFE, modes
        return (new if code == _NONE or old_bit == _CANCEL or (old_bit and bit != _CANCEL) else code), modes
    if code == _NONE or old_bit or spindle_kernel(code):
        return new, modes
    if spindle_kernel(new) or (code >= _T and new == _M6) or code == _UNSAFE:
        return code, modes
    return _SEVERAL, modes


@jit_inline
def command_kernel(text: Bytes, i: int, n: int, letter: int, code: int, modes: int) -> tuple[int, int, int]:
    """Read the number of a G, M or T word at `i` and add the command: (position after it, code, modes)."""
    number = 0
    digits = 0
    tenths = 0
    while i < n and 48 <= byte_kernel(text, i) <= 57 and digits < 6:
        number = number * 10 + (byte_kernel(text, i) - 48)
        digits += 1
        i += 1
    if i < n and byte_kernel(text, i) == 46:
        i += 1
        if i < n and 48 <= text[i] <= 57:
            tenths = int(text[i]) - 48
            i += 1
    if letter == 84:
        if digits and number <= 32_000 and tenths == 0:
            code, modes = merge_kernel(_T + number, code, modes)
        else:
            code, modes = merge_kernel(_T_OTHER, code, modes)
            while i < n and text[i] > 32 and text[i] != 59:
                i += 1
    elif digits and number < 10_000:
        code, modes = merge_kernel(number * 10 + tenths + (_M if letter == 77 else 0), code, modes)
    elif _M <= code < _T:
        modes |= _ODD
    else:
        code = _UNSAFE
    return i, code, modes


@jit_lean
def spaces_kernel(text: Bytes, i: int, n: int) -> int:
    """Return the position of the first byte at or after `i` that is neither space nor tab."""
    while i < n and (text[i] == 32 or text[i] == 9):
        i += 1
    return i


@jit_lean
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


@jit_lean
def checksum_kernel(text: Bytes, begin: int, i: int, n: int) -> bool:
    """Tell whether the checksum after the `*` at `i` is that of the bytes before it (or a CRC, five digits)."""
    total = 0
    for k in range(begin, i):
        total ^= int(text[k])
    value, after, _, found = number_kernel(text, spaces_kernel(text, i + 1, n), n, False)
    return found and (value == total or after - i > 5)


@jit_lean
def stray_kernel(code: int, modes: int) -> tuple[int, int]:
    """Return (code, modes) of a line with something on it that has no meaning: some M codes live with that."""
    followed = code in (_M82, _M83) or _M + 2000 <= code <= _M + 2060 or code == _M + 5660
    if _M <= code < _T and not followed and not _M + 2200 <= code <= _M + 2210:
        return code, modes | _ODD
    return _UNSAFE, modes


@jit_lean
def bare_kernel(code: int, present: int) -> int:
    """Return the code of a line that has words (bits of their letters), but no command or only a modal one."""
    if code == 610 or code == 800 or not (code == _NONE or mode_bit_kernel(code)):
        return code
    return _BARE if code == _NONE or present & OF_MOTION else code


@jit_lean
def sign_kernel(
    text: Bytes, i: int, begin: int, n: int, code: int, modes: int, seen: bool
) -> tuple[int, int, int, bool]:
    """Deal with the byte at `i`, neither letter nor space: (where to go on, code, modes, whether it is stray)."""
    c = int(text[i])
    fresh = code == _NONE and not seen
    if c == 40 or c == 34:
        close = 41 if c == 40 else 34
        i += 1
        while i < n and text[i] != close and text[i] != 10 and text[i] != 13:
            i += 1
        return (i + 1 if i < n and text[i] == close else i), code, modes | (_ODD if c == 34 else 0), False
    if c == 0xEF and i == begin and i + 2 < n and text[i + 1] == 0xBB and text[i + 2] == 0xBF:
        return i + 3, code, modes, False
    stray = False
    if c == 42 and not fresh:
        modes |= _CHECKSUM
        code = code if checksum_kernel(text, begin, i, n) else _UNSAFE
    elif ((c == 47 or c == 64) and fresh) or (c == 123 and not _M <= code < _T):
        code = _EXTENDED
    elif not (c == 59 or c == 13 or (c == 37 and fresh)):
        stray = True
    i, clean = rest_kernel(text, i, n)
    return i, (code if clean else _UNSAFE), modes, stray
