"""Copying: a line that need not change leaves byte for byte as it came, over a firmware whose state is as it expects.

`G92 E` comes first where a copied line speaks absolute E and ours differs from the file's, `G1 F` where it relies on a
feed rate that ours has changed. As long as neither does, nobody asks what a line says: lines that follow each other
leave as one stretch of the text.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.gcode.bounds import NOZZLE
from gcodectl.gcode.packed import (
    AREA,
    COMMENT,
    DISTANCE,
    E_DIGITS,
    E_END,
    E_IN,
    E_OUT,
    END,
    F_IN,
    F_OUT,
    FLAGS,
    KIND,
    MOST_E_DIGITS,
    OPEN,
    RATIO,
    RELATIVE_E,
    RETURNS,
    START,
    STOP,
    X_OUT,
    E,
    e_digits_kernel,
    file_feed_kernel,
)
from gcodectl.gcode.write import SCALES, copy_kernel, has_word_kernel, units_kernel, write_word_kernel
from gcodectl.jit import jit_lean
from gcodectl.records import Flag, Kind

SETS_E = int(Flag.SETS_E)
LINE, ARC = int(Kind.LINE), int(Kind.ARC)
F_DIGITS = 4


@jit_lean
def newline_kernel(out: Bytes, n: int, carry: Floats) -> int:
    """End a line as the file ends its lines; returns where the next byte goes."""
    if carry[RETURNS]:
        out[n] = 13
        n += 1
    out[n] = 10
    return n + 1


@jit_lean
def feed_before_kernel(floats: Floats, ints: Ints, i: int, carry: Floats) -> float:
    """The file's F before a row, in its own units a minute."""
    return file_feed_kernel(floats, ints, i - 1) if i > 0 else float(carry[F_IN])


@jit_lean
def in_step_kernel(ints: Ints, i: int, carry: Floats) -> bool:
    """Whether the firmware's E and F are what the file's next line expects, whatever it says."""
    return bool((ints[FLAGS, i] & RELATIVE_E or carry[E_OUT] == carry[E_IN]) and np.isnan(carry[F_OUT]))


@jit_lean
def restore_kernel(
    out: Bytes, n: int, text: Bytes, floats: Floats, ints: Ints, i: int, bounds: Floats, carry: Floats
) -> int:
    """Before a line is copied, bring back the E and F that it relies on; notes what it sets itself."""
    start, end, flags = ints[START, i], ints[END, i], ints[FLAGS, i]
    if not flags & RELATIVE_E and (flags & SETS_E or has_word_kernel(text, start, end, 69)):
        digits = max(ints[E_DIGITS, i], e_digits_kernel(floats[AREA, i], bounds[NOZZLE]))
        digits = min(digits, MOST_E_DIGITS)
        if not flags & SETS_E and abs(carry[E_OUT] - carry[E_IN]) > 0.5 / SCALES[digits]:
            out[n], out[n + 1], out[n + 2] = 71, 57, 50
            n = write_word_kernel(out, n + 3, 69, units_kernel(carry[E_IN], digits), digits)
            n = newline_kernel(out, n, carry)
        carry[E_OUT] = carry[E_IN]
    if np.isnan(carry[F_OUT]):
        return n
    moves = ints[KIND, i] == LINE or ints[KIND, i] == ARC
    if has_word_kernel(text, start, end, 70):
        # a line that moves says what the file has; a bare F may have set it, some other command's F not: say it again
        carry[F_OUT] = np.nan if moves else -1.0
    elif moves:
        feed = feed_before_kernel(floats, ints, i, carry)
        if carry[F_OUT] != feed:
            out[n], out[n + 1] = 71, 49
            n = write_word_kernel(out, n + 2, 70, units_kernel(feed, F_DIGITS), F_DIGITS)
            n = newline_kernel(out, n, carry)
            carry[F_OUT] = feed
    return n


@jit_lean
def copied_kernel(text: Bytes, floats: Floats, ints: Ints, p1: Floats, i: int, acts: bool, carry: Floats) -> None:
    """Note what a copied line leaves behind; `acts`: it takes time."""
    start, end = ints[START, i], ints[END, i]
    if end > start:
        if carry[E_OUT] == carry[E_IN] or np.isnan(carry[E_IN]) or ints[FLAGS, i] & SETS_E:
            carry[E_OUT] = floats[E_END, i]
        elif ints[FLAGS, i] & RELATIVE_E:
            carry[E_OUT] += floats[E_END, i] - carry[E_IN]
        for axis in range(3):
            carry[X_OUT + axis] = p1[i, axis]
        carry[OPEN] = 1.0 if text[end - 1] != 10 else 0.0
        if not carry[OPEN]:
            carry[RETURNS] = 1.0 if end - start > 1 and text[end - 2] == 13 else 0.0
    if acts:
        carry[RATIO] = floats[E, i] / floats[DISTANCE, i] if floats[DISTANCE, i] > 0.0 else 0.0


@jit_lean
def close_line_kernel(out: Bytes, n: int, text: Bytes, whole: Ints, carry: Floats) -> int:
    """End a line we wrote as the file ends its lines, with the original's comment where that is still to be written."""
    if whole[COMMENT] < whole[STOP]:
        out[n] = 32
        n = copy_kernel(out, n + 1, text, whole[COMMENT], whole[STOP])
        whole[COMMENT] = whole[STOP]
    if whole[STOP] == whole[END]:
        return newline_kernel(out, n, carry)
    return copy_kernel(out, n, text, whole[STOP], whole[END])
