"""Copying: a line that need not change leaves byte for byte as it came, over a firmware whose state is as it expects.

`G92 E` comes first where a copied line speaks absolute E and ours differs from the file's, `G1 F` where it relies on a
feed rate that ours has changed. As long as neither does, nobody asks what a line says: lines that follow each other
leave as one stretch of the text.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes, Floats
from gcodectl.gcode.packed import (
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
    OPEN,
    PHASES,
    RATIO,
    RETURNS,
    START,
    STOP,
    X1,
    X_OUT,
    E,
)
from gcodectl.gcode.write import SCALES, copy_kernel, has_word_kernel, units_kernel, write_word_kernel
from gcodectl.jit import jit_lean
from gcodectl.records import Flag, Kind

SETS_E, RELATIVE_E = int(Flag.SETS_E), int(Flag.RELATIVE_E)
LINE, ARC = int(Kind.LINE), int(Kind.ARC)
F_DIGITS = 4


@jit_lean
def newline_kernel(out: Bytes, n: int, state: Floats) -> int:
    """End a line as the file ends its lines; returns where the next byte goes."""
    if state[RETURNS]:
        out[n] = 13
        n += 1
    out[n] = 10
    return n + 1


@jit_lean
def in_step_kernel(state: Floats) -> bool:
    """Whether the firmware's E and F are what the file's next line expects, whatever it says."""
    if not np.isnan(state[F_OUT]):
        return False
    return bool(state[E_OUT] == state[E_IN] or int(state[FLAGS]) & RELATIVE_E)


@jit_lean
def restore_kernel(out: Bytes, n: int, text: Bytes, state: Floats) -> int:
    """Before a line is copied, bring back the E and F that it relies on; notes what it sets itself."""
    start, end, flags = int(state[START]), int(state[END]), int(state[FLAGS])
    if not flags & RELATIVE_E and (flags & SETS_E or has_word_kernel(text, start, end, 69)):
        digits = int(state[E_DIGITS])
        if not flags & SETS_E and abs(state[E_OUT] - state[E_IN]) > 0.5 / SCALES[digits]:
            out[n], out[n + 1], out[n + 2] = 71, 57, 50
            n = write_word_kernel(out, n + 3, 69, units_kernel(state[E_IN], digits), digits)
            n = newline_kernel(out, n, state)
        state[E_OUT] = state[E_IN]
    if np.isnan(state[F_OUT]):
        return n
    moves = state[KIND] in (LINE, ARC)
    if has_word_kernel(text, start, end, 70):
        # a line that moves says what the file has; a bare F may have set it, some other command's F not: say it again
        state[F_OUT] = np.nan if moves else -1.0
    elif moves and state[F_OUT] != state[F_IN]:
        out[n], out[n + 1] = 71, 49
        n = write_word_kernel(out, n + 2, 70, units_kernel(state[F_IN], F_DIGITS), F_DIGITS)
        n = newline_kernel(out, n, state)
        state[F_OUT] = state[F_IN]
    return n


@jit_lean
def copied_kernel(text: Bytes, state: Floats) -> None:
    """Note what a copied line leaves behind."""
    start, end, flags = int(state[START]), int(state[END]), int(state[FLAGS])
    if end > start:
        if state[E_OUT] == state[E_IN] or np.isnan(state[E_IN]) or flags & SETS_E:
            state[E_OUT] = state[E_END]
        elif flags & RELATIVE_E:
            state[E_OUT] += state[E_END] - state[E_IN]
        for axis in range(3):
            state[X_OUT + axis] = state[X1 + axis]
        state[OPEN] = 1.0 if text[end - 1] != 10 else 0.0
        if not state[OPEN]:
            state[RETURNS] = 1.0 if end - start > 1 and text[end - 2] == 13 else 0.0
    if state[PHASES]:
        state[RATIO] = state[E] / state[DISTANCE] if state[DISTANCE] > 0.0 else 0.0


@jit_lean
def close_line_kernel(out: Bytes, n: int, text: Bytes, state: Floats) -> int:
    """End a line we wrote as the file ends its lines, with the original's comment where that is still to be written."""
    comment, stop, end = int(state[COMMENT]), int(state[STOP]), int(state[END])
    if comment < stop:
        out[n] = 32
        n = copy_kernel(out, n + 1, text, comment, stop)
        state[COMMENT] = stop
    if stop == end:
        return newline_kernel(out, n, state)
    return copy_kernel(out, n, text, stop, end)
