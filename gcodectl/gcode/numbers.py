"""Numbers as G-code writes them, out of bytes, exactly: digits are gathered as an integer and divided once.

`X-.5`, `X+3.`, `X 1`, and `X3.2e-05` are numbers. A capital E, or an `e` without a sign and a digit after it, begins
the extruder's word, as printers read it (Marlin's parser ends a number at either); so an exponent is taken only where
a program has written one: a small `e` behind a word in capitals.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes
from gcodectl.jit import jit_inline, jit_lean

_POWERS = np.array([float(f"1e{k}") for k in range(23)])
_MOST = 10**17
_SURE = 18
"""Digits that surely fit into 64 bits; of a longer number `long_kernel` finds those that count."""


@jit_inline
def byte_kernel(text: Bytes, i: int) -> int:
    """Return the byte at `i`, which is not negative: spares the loops over bytes the question whether it is."""
    return int(text[np.uint64(i)])


@jit_inline
def digits_kernel(text: Bytes, i: int, n: int, exponent: bool) -> tuple[float, int, int, bool]:
    """Read a number at `i`: (value, position after it, digits after the point, whether there is one)."""
    c = byte_kernel(text, i) if i < n else 10
    negative = c == 45
    if negative or c == 43:
        i += 1
    begin = i
    mantissa = 0
    while i < n and 48 <= byte_kernel(text, i) <= 57:
        mantissa = mantissa * 10 + (byte_kernel(text, i) - 48)
        i += 1
    digits = i - begin
    decimals = 0
    if i < n and byte_kernel(text, i) == 46:
        i += 1
        point = i
        while i < n and 48 <= byte_kernel(text, i) <= 57:
            mantissa = mantissa * 10 + (byte_kernel(text, i) - 48)
            i += 1
        decimals = i - point
        digits += decimals
    scale = -decimals
    if digits > _SURE:
        mantissa, dropped = long_kernel(text, begin, i)
        scale += dropped
    if exponent and i < n and byte_kernel(text, i) == 101:
        power, i = exponent_kernel(text, i, n)
        scale += power
        decimals = max(0, decimals - power)
    value = float(mantissa)
    if -23 < scale < 0:
        value /= _POWERS[np.uint64(-scale)]
    elif scale != 0:
        value = scaled_kernel(value, scale)
    return (-value if negative else value), i, min(decimals, 12), digits > 0


@jit_lean
def long_kernel(text: Bytes, i: int, end: int) -> tuple[int, int]:
    """Read the digits from `i` to `end`: (the leading ones as an integer, how many were left out)."""
    mantissa = 0
    dropped = 0
    for k in range(i, end):
        if text[k] != 46:
            if mantissa < _MOST:
                mantissa = mantissa * 10 + (int(text[k]) - 48)
            else:
                dropped += 1
    return mantissa, dropped


@jit_lean
def number_kernel(text: Bytes, i: int, n: int, exponent: bool) -> tuple[float, int, int, bool]:
    """Read a number at `i` as digits_kernel does, where calls are few."""
    return digits_kernel(text, i, n, exponent)


@jit_lean
def exponent_kernel(text: Bytes, i: int, n: int) -> tuple[int, int]:
    """Read a small `e`, a sign and digits at `i`: (power of ten, position after it); (0, i) where there is none."""
    sign = int(text[i + 1]) if i + 2 < n and text[i] == 101 else 0
    if sign not in (43, 45) or not 48 <= text[i + 2] <= 57:
        return 0, i
    power = 0
    i += 2
    while i < n and 48 <= text[i] <= 57:
        power = min(power * 10 + (int(text[i]) - 48), 400)
        i += 1
    return (-power if sign == 45 else power), i


@jit_lean
def scaled_kernel(mantissa: float, scale: int) -> float:
    """Return mantissa * 10**scale with one rounding where the power is exact, infinity where it is too large."""
    if scale == 0 or mantissa == 0.0:
        return mantissa
    while scale < -22:
        mantissa /= _POWERS[22]
        scale += 22
        if mantissa == 0.0:
            return 0.0
    while scale > 22:
        if mantissa > 1e300:
            return np.inf
        mantissa *= _POWERS[22]
        scale -= 22
    if scale > 0:
        return np.inf if mantissa > 1e280 else float(mantissa * _POWERS[scale])
    return float(mantissa / _POWERS[-scale])
