"""Names in G-code, compared by hash: extended commands with their KEY=value words, and the slicers' marks.

Kernels have no strings; a name becomes its FNV-1a hash (32 bit), in capitals. Tables of hashes: dialects.py.
"""

from __future__ import annotations

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.gcode.codes import Code
from gcodectl.gcode.dialects import name_hash
from gcodectl.gcode.numbers import number_kernel
from gcodectl.jit import jit_lean

_EXTENDED, _HARMLESS, _VELOCITY = int(Code.EXTENDED), int(Code.HARMLESS), int(Code.VELOCITY_LIMIT)
_UNSAFE, _RETURNS = int(Code.UNSAFE), int(Code.RETURNS)
_LIMIT = name_hash("SET_VELOCITY_LIMIT")
_ACCEL = name_hash("ACCEL")
_CORNER = name_hash("SQUARE_CORNER_VELOCITY")
_SPEED = name_hash("VELOCITY")
_OFFSET = 2166136261


@jit_lean
def hash_kernel(text: Bytes, i: int, n: int) -> tuple[int, int]:
    """Hash the name of letters, digits, `_` and `-` at `i`, in capitals: (hash, position after it)."""
    value = _OFFSET
    while i < n:
        c = int(text[i])
        if 97 <= c <= 122:
            c -= 32
        if not (65 <= c <= 90 or 48 <= c <= 57 or c == 95 or c == 45):
            break
        value = ((value ^ c) * 16777619) & 0xFFFFFFFF
        i += 1
    return value, i


@jit_lean
def find_kernel(value: int, table: Ints) -> int:
    """Return what stands beside the hash `value` in `table` (pairs), 0 where it is not there."""
    for row in range(len(table)):
        if table[row, 0] == value:
            return int(table[row, 1])
    return 0


@jit_lean
def extended_kernel(text: Bytes, i: int, n: int, words: Floats, names: Ints) -> int:
    """Return the code of the extended command at `i`; SET_VELOCITY_LIMIT's numbers go into words A, S and V."""
    value, i = hash_kernel(text, i, n)
    known = find_kernel(value, names)
    if known:
        return _HARMLESS if known == 1 else _RETURNS
    limits = value == _LIMIT
    while i < n and text[i] != 10 and text[i] != 59:
        if text[i] == 0:
            return _UNSAFE
        if limits and 65 <= (text[i] & 0xDF) <= 90:
            key, i = hash_kernel(text, i, n)
            if i < n and text[i] == 61:
                number, i, _, _ = number_kernel(text, i + 1, n, False)
                if key == _ACCEL:
                    words[0] = number
                elif key == _CORNER:
                    words[18] = number
                elif key == _SPEED:
                    words[21] = number
        else:
            i += 1
    return _VELOCITY if limits else _EXTENDED


@jit_lean
def text_hash_kernel(text: Bytes, i: int, n: int) -> int:
    """Hash the rest of the line at `i`, in capitals, without the spaces around it."""
    while i < n and text[i] == 32:
        i += 1
    while n > i and (text[n - 1] == 32 or text[n - 1] == 10 or text[n - 1] == 13 or text[n - 1] == 9):
        n -= 1
    value = _OFFSET
    for k in range(i, n):
        c = int(text[k])
        if 97 <= c <= 122:
            c -= 32
        value = ((value ^ c) * 16777619) & 0xFFFFFFFF
    return value
