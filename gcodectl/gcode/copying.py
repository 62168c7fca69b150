"""Copying: a line that need not change leaves byte for byte as it came, over a firmware whose state is as it expects.

`G92 E` comes first where a copied line speaks absolute E and ours differs from the file's, `G1 F` where it relies on a
feed rate that ours has changed.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.gcode.packed import (
    E_DIGITS,
    E_END,
    E_IN,
    E_OUT,
    END,
    F_IN,
    F_OUT,
    FLAGS,
    KIND,
    OPEN,
    RELATIVE_E,
    RETURNS,
    START,
    X1,
    X_OUT,
)
from gcodectl.gcode.write import copy_kernel, has_word_kernel, write_word_kernel
from gcodectl.jit import jit
from gcodectl.records import Flag, Kind

SETS_E = int(Flag.SETS_E)
LINE, ARC = int(Kind.LINE), int(Kind.ARC)


@jit
def newline_kernel(out: Bytes, n: int, carry: Floats) -> int:
    """End a line as the file ends its lines; returns where the next byte goes."""
    if carry[RETURNS]:
        out[n] = 13
        n += 1
    out[n] = 10
    return n + 1


@jit
def copy_row_kernel(out: Bytes, n: int, text: Bytes, floats: Floats, ints: Ints, carry: Floats) -> int:
    """Copy a row's raw line; before it, bring back the E and F that it relies on."""
    start, end = ints[START], ints[END]
    if end > start:
        relative = ints[FLAGS] & RELATIVE_E
        digit = 0.5 * 10.0 ** (-ints[E_DIGITS])
        speaks_e = has_word_kernel(text, start, end, 69)
        if not relative and speaks_e and abs(carry[E_OUT] - carry[E_IN]) > digit and not ints[FLAGS] & SETS_E:
            for byte in (71, 57, 50):
                out[n] = byte
                n += 1
            n = newline_kernel(out, write_word_kernel(out, n, 69, carry[E_IN], ints[E_DIGITS]), carry)
        moves = ints[KIND] in (LINE, ARC)
        speaks_f = has_word_kernel(text, start, end, 70)
        if moves and not speaks_f and not np.isnan(carry[F_OUT]) and carry[F_OUT] != carry[F_IN]:
            out[n], out[n + 1] = 71, 49
            n = newline_kernel(out, write_word_kernel(out, n + 2, 70, carry[F_IN], 4), carry)
            carry[F_OUT] = carry[F_IN]
        n = copy_kernel(out, n, text, start, end)
        if ints[FLAGS] & SETS_E or (speaks_e and not relative):
            carry[E_OUT] = floats[E_END]
        elif relative:
            carry[E_OUT] += floats[E_END] - carry[E_IN]
        if moves and speaks_f:
            carry[F_OUT] = np.nan  # what the line says, which is what the file has
        elif speaks_f and not np.isnan(carry[F_OUT]):
            carry[F_OUT] = -1.0  # a bare F may have set it, or some other command's F not: it must be said again
        for axis in range(3):
            carry[X_OUT + axis] = floats[X1 + axis]
        carry[OPEN] = 1.0 if text[end - 1] != 10 else 0.0
        if not carry[OPEN]:
            carry[RETURNS] = 1.0 if end - start > 1 and text[end - 2] == 13 else 0.0
    return n


@jit
def close_line_kernel(out: Bytes, n: int, text: Bytes, ints: Ints, comment: int, carry: Floats) -> int:
    """End a line we wrote as the file ends its lines, with the original's comment where `comment` points into it."""
    end = ints[END]
    stop = end
    while stop > ints[START] and (text[stop - 1] == 10 or text[stop - 1] == 13):
        stop -= 1
    if comment < stop:
        out[n] = 32
        n = copy_kernel(out, n + 1, text, comment, stop)
    if stop == end:
        return newline_kernel(out, n, carry)
    return copy_kernel(out, n, text, stop, end)
