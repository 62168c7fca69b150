"""Bytes of G-code out of numbers: words with at most so many digits, trailing zeros left away, as slicers do."""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes
from gcodectl.jit import jit


@jit
def round_kernel(value: float, decimals: int) -> float:
    """Round half away from zero to `decimals` digits after the point: what write_word_kernel will print."""
    scale = 10.0**decimals
    return float(np.floor(abs(value) * scale + 0.5) / scale * (1.0 if value >= 0.0 else -1.0))


@jit
def write_word_kernel(out: Bytes, n: int, letter: int, value: float, decimals: int) -> int:
    """Write ` X1.25` to out[n:] (no letter where it is 0); returns where the next byte goes."""
    if letter:
        out[n], out[n + 1] = 32, letter
        n += 2
    units = int(np.floor(abs(value) * 10.0**decimals + 0.5))
    if value < 0.0 and units:
        out[n] = 45
        n += 1
    while decimals and units % 10 == 0:
        units //= 10
        decimals -= 1
    digits = 1
    power = 10
    while power <= units or digits <= decimals:
        power *= 10
        digits += 1
    end = n + digits + (1 if decimals else 0)
    k = end - 1
    for place in range(digits):
        if place == decimals and decimals:
            out[k] = 46
            k -= 1
        out[k] = 48 + units % 10
        units //= 10
        k -= 1
    return end


@jit
def copy_kernel(out: Bytes, n: int, text: Bytes, start: int, end: int) -> int:
    """Append text[start:end]; returns where the next byte goes."""
    for k in range(start, end):
        out[n] = text[k]
        n += 1
    return n


@jit
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


@jit
def comment_kernel(text: Bytes, start: int, end: int) -> int:
    """Where the comment of the line text[start:end] begins, its `;` included; `end` where it has none."""
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


def word(value: float, decimals: int) -> bytes:
    """Return `value` as a word's number: `1.25`, `-.5` as `-0.5`, `3`."""
    out: Bytes = np.empty(40, dtype=np.uint8)
    return out[: write_word_kernel(out, 0, 0, value, decimals)].tobytes()
