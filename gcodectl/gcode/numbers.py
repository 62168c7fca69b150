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


@jit_inline
def digits_kernel(text: Bytes, i: int, n: int, exponent: bool) -> tuple[float, int, int, bool]:
    """Read a number at `i`: (value, position after it, digits after the point, whether there is one)."""
    negative = i < n and text[i] == 45
    if negative or (i < n and text[i] == 43):
        i += 1
    mantissa = 0
    digits = 0
    dropped = 0
    point = -1
    while i < n:
        c = int(text[i])
        if 48 <= c <= 57:
            digits += 1
            if mantissa < _MOST:
                mantissa = mantissa * 10 + (c - 48)
            else:
                dropped += 1
        elif c == 46 and point < 0:
            point = digits
        else:
            break
        i += 1
    decimals = digits - point if point >= 0 else 0
    scale = dropped - decimals
    if exponent and i < n and text[i] == 101:
        power, i = exponent_kernel(text, i, n)
        scale += power
        decimals = max(0, decimals - power)
    value = float(mantissa)
    if -23 < scale < 0:
        value /= _POWERS[-scale]
    elif scale != 0:
        value = scaled_kernel(value, scale)
    return (-value if negative else value), i, min(decimals, 12), digits > 0


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
