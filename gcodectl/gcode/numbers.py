"""Numbers as G-code writes them, out of bytes, exactly: digits are gathered as an integer and divided once.

`X-.5`, `X+3.`, `X 1`, and `X3.2e-05` are numbers. A capital E, or an `e` without a sign and a digit after it, begins
the extruder's word, as printers read it (Marlin's parser ends a number at either); so an exponent is taken only where
a program has written one: a small `e` behind a word in capitals.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes
from gcodectl.jit import jit

POWERS = 10.0 ** np.arange(23)
_MOST = 10**17


@jit
def number_kernel(text: Bytes, i: int, n: int, exponent: bool) -> tuple[float, int, int, bool]:
    """Read a number at `i`: (value, position after it, digits after the point, whether there is one)."""
    negative = False
    if i < n and (text[i] == 45 or text[i] == 43):
        negative = text[i] == 45
        i += 1
    mantissa = 0
    digits = 0
    decimals = 0
    scale = 0
    point = False
    while i < n:
        c = int(text[i])
        if 48 <= c <= 57:
            digits += 1
            if mantissa < _MOST:
                mantissa = mantissa * 10 + (c - 48)
                if point:
                    decimals += 1
            elif not point:
                scale += 1
        elif c == 46 and not point:
            point = True
        else:
            break
        i += 1
    if digits == 0:
        return np.nan, i, 0, False
    scale -= decimals
    if exponent and i + 2 < n and text[i] == 101 and (text[i + 1] == 45 or text[i + 1] == 43):
        if 48 <= text[i + 2] <= 57:
            power = 0
            k = i + 2
            while k < n and 48 <= text[k] <= 57:
                power = min(power * 10 + (int(text[k]) - 48), 400)
                k += 1
            power = -power if text[i + 1] == 45 else power
            scale += power
            decimals = max(0, decimals - power)
            i = k
    value = scaled_kernel(float(mantissa), scale)
    return (-value if negative else value), i, min(decimals, 12), True


@jit
def scaled_kernel(mantissa: float, scale: int) -> float:
    """Return mantissa * 10**scale with one rounding where the power is exact, infinity where it is too large."""
    if scale == 0 or mantissa == 0.0:
        return mantissa
    while scale < -22:
        mantissa /= POWERS[22]
        scale += 22
        if mantissa == 0.0:
            return 0.0
    while scale > 22:
        if mantissa > 1e300:
            return np.inf
        mantissa *= POWERS[22]
        scale -= 22
    if scale > 0:
        return np.inf if mantissa > 1e280 else mantissa * POWERS[scale]
    return mantissa / POWERS[-scale]
