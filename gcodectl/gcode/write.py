"""Bytes of G-code out of numbers: words with at most so many digits, trailing zeros left away, as slicers do.

A value is rounded once, to a whole number of its last digits (`units`); that is what is printed, and what is reckoned
with from there on. Digits are written two at a time, from the back.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes
from gcodectl.jit import jit_inline, jit_lean

SCALES = np.array([float(f"1e{k}") for k in range(19)])
"""Powers of ten: units in one, by the digits after the point."""
TENS = np.array([10**k for k in range(19)])
TENTHS = 1.0 / SCALES
"""The same as whole numbers, and what a unit is of one."""
PAIRS = np.frombuffer("".join(f"{k:02}" for k in range(100)).encode(), dtype=np.uint8)
"""The digits of 00 to 99, one pair behind the other."""


@jit_lean
def units_kernel(value: float, digits: int) -> int:
    """How many units of the last of `digits` digits after the point a value is, rounded half away from zero."""
    units = int(abs(value) * SCALES[digits] + 0.5)
    return units if value >= 0.0 else -units


@jit_lean
def number_kernel(out: Bytes, n: int, number: int, digits: int) -> int:
    """Write a whole number as just so many digits, as it has or more; returns where the next byte goes."""
    k = n + digits
    while k > n + 1:
        rest = number // 100
        pair = (number - 100 * rest) * 2
        number = rest
        k -= 2
        out[k], out[k + 1] = PAIRS[pair], PAIRS[pair + 1]
    if k > n:
        out[n] = 48 + number
    return n + digits


@jit_inline
def write_word_kernel(out: Bytes, n: int, letter: int, units: int, digits: int) -> int:
    """Write ` X1.25` to out[n:] (no letter where it is 0); returns where the next byte goes."""
    if letter:
        out[n], out[n + 1] = 32, letter
        n += 2
    if units < 0:
        units = -units
        out[n] = 45
        n += 1
    one = TENS[digits]
    whole = int(units * TENTHS[digits])  # may be one off: a division takes thrice as long
    part = units - whole * one
    if part < 0:
        whole, part = whole - 1, part + one
    elif part >= one:
        whole, part = whole + 1, part - one
    places = 1
    while places < 18 and whole >= TENS[places]:
        places += 1
    n = number_kernel(out, n, whole, places)
    if part:
        out[n] = 46
        n = number_kernel(out, n + 1, part, digits)
        while out[n - 1] == 48:
            n -= 1
    return n


@jit_lean
def copy_kernel(out: Bytes, n: int, text: Bytes, start: int, end: int) -> int:
    """Append text[start:end]; returns where the next byte goes."""
    if end <= start:
        return n
    source, target = text[start:end], out[n:]  # as slices: counted from 0, they are copied many bytes at a time
    for k in range(len(source)):
        target[k] = source[k]
    return n + len(source)


@jit_lean
def has_word_kernel(text: Bytes, start: int, end: int, letter: int) -> bool:
    """Whether the line text[start:end] has a number behind `letter`, capital or small, outside comments."""
    depth = 0
    for k in range(start, end):
        c = text[k]
        if c == 59 and depth == 0:
            return False
        if c == 40:
            depth += 1
        elif c == 41 and depth:
            depth -= 1
        elif depth == 0 and (c == letter or c == letter + 32):
            after = k + 1
            while after < end and text[after] == 32:
                after += 1
            if after < end and (48 <= text[after] <= 57 or text[after] in (43, 45, 46)):
                return True
    return False


@jit_lean
def behind_brackets_kernel(text: Bytes, start: int, end: int) -> int:
    """Where the comment of the line text[start:end] begins, a `;` outside of ( ); `end` where it has none."""
    depth = 0
    for k in range(start, end):
        c = text[k]
        if c == 40:
            depth += 1
        elif c == 41 and depth:
            depth -= 1
        elif c == 59 and depth == 0:
            return k
    return end


@jit_lean
def comment_kernel(text: Bytes, start: int, end: int) -> int:
    """Where the comment of the line text[start:end] begins, its `;` included; `end` where it has none."""
    for k, c in enumerate(text[start:end]):
        if c == 59:
            return start + k
        if c == 40:
            return behind_brackets_kernel(text, start + k, end)
    return end


def word(value: float, decimals: int) -> bytes:
    """Return `value` as a word's number: `1.25`, `-.5` as `-0.5`, `3`."""
    out: Bytes = np.empty(40, dtype=np.uint8)
    return out[: write_word_kernel(out, 0, 0, units_kernel(value, decimals), decimals)].tobytes()
