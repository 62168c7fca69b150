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
    RELATIVE_E,
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
            n = write_word_kernel(out, n, 69, carry[E_IN], ints[E_DIGITS])
            out[n] = 10
            n += 1
        moves = ints[KIND] in (LINE, ARC)
        speaks_f = has_word_kernel(text, start, end, 70)
        if moves and not speaks_f and not np.isnan(carry[F_OUT]) and carry[F_OUT] != carry[F_IN]:
            out[n], out[n + 1] = 71, 49
            n = write_word_kernel(out, n + 2, 70, carry[F_IN], 4)
            out[n] = 10
            n += 1
            carry[F_OUT] = carry[F_IN]
        n = copy_kernel(out, n, text, start, end)
        if relative:
            carry[E_OUT] += floats[E_END] - carry[E_IN]
        elif speaks_e:
            carry[E_OUT] = floats[E_END]
        if moves and speaks_f:
            carry[F_OUT] = np.nan  # what the line says, which is what the file has
        for axis in range(3):
            carry[X_OUT + axis] = floats[X1 + axis]
    return n


@jit
def close_line_kernel(out: Bytes, n: int, text: Bytes, ints: Ints, comment: int) -> int:
    """End a line we wrote as the file ends its lines, with the original's comment where `comment` points into it."""
    end = ints[END]
    stop = end
    while stop > ints[START] and (text[stop - 1] == 10 or text[stop - 1] == 13):
        stop -= 1
    if comment < stop:
        out[n] = 32
        n = copy_kernel(out, n + 1, text, comment, stop)
    if stop == end:
        out[n] = 10
        return n + 1
    return copy_kernel(out, n, text, stop, end)
