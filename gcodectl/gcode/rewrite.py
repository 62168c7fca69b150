"""Rewrite: one line of G-code for a piece of a move, its words rounded to the file's digits and the rest carried on."""

from __future__ import annotations

import math

from gcodectl.columns import Bytes, Floats
from gcodectl.gcode.bounds import ALONE
from gcodectl.gcode.packed import (
    AREA,
    CENTER,
    DIGITS,
    DISTANCE,
    E_DIGITS,
    E_OUT,
    F_OUT,
    FEED,
    FLAGS,
    FLOW,
    KIND,
    MOVED,
    OWED,
    PLANE,
    POINT,
    SWEEP,
    UNIT,
    X0,
    X1,
    X_OUT,
)
from gcodectl.gcode.write import SCALES, units_kernel, write_word_kernel
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.path import point_kernel
from gcodectl.records import Flag, Kind

MOST_F_DIGITS = 7
ARC = int(Kind.ARC)
RELATIVE_XYZ, RELATIVE_E = int(Flag.RELATIVE_XYZ), int(Flag.RELATIVE_E)


@jit_lean
def e_units_kernel(volume: float, state: Floats) -> int:
    """The E word for `volume` mm^3 and what is owed, in units of its last digit; notes what it moves E by."""
    wanted = (volume + state[OWED]) / e_scale_kernel(state)
    if int(state[FLAGS]) & RELATIVE_E:
        units = units_kernel(wanted, int(state[E_DIGITS]))
        state[MOVED] = units / SCALES[int(state[E_DIGITS])]
    else:
        units = units_kernel(state[E_OUT] + wanted, int(state[E_DIGITS]))
        state[MOVED] = units / SCALES[int(state[E_DIGITS])] - state[E_OUT]
    return units


@jit_lean
def e_scale_kernel(state: Floats) -> float:
    """Volume that one of E in the file's units stands for, mm^3."""
    return float(state[AREA] * state[FLOW] * state[UNIT])


@jit_lean
def moves_e_kernel(volume: float, state: Floats) -> bool:
    """Whether `volume` mm^3 and what is owed move E by a digit."""
    e_units_kernel(volume, state)
    return bool(abs(state[MOVED]) >= 0.5 / SCALES[int(state[E_DIGITS])])


@jit_inline
def e_word_kernel(out: Bytes, n: int, volume: float, state: Floats) -> int:
    """Write the E word for `volume` mm^3 and what is owed, none where it rounds to 0; the rest stays owed."""
    units, digits = e_units_kernel(volume, state), int(state[E_DIGITS])
    if abs(state[MOVED]) < 0.5 / SCALES[digits]:
        state[OWED] += volume
        return n
    state[OWED] += volume - state[MOVED] * e_scale_kernel(state)
    state[E_OUT] = state[E_OUT] + state[MOVED] if int(state[FLAGS]) & RELATIVE_E else units / SCALES[digits]
    return write_word_kernel(out, n, 69, units, digits)


@jit_inline
def f_word_kernel(out: Bytes, n: int, feed: float, digits: int, state: Floats) -> int:
    """Write the F word (file units a minute) where it differs from the one in force, to three digits at least."""
    while 0.0 < feed * SCALES[digits] < 100.0 and digits < MOST_F_DIGITS:
        digits += 1
    units = units_kernel(feed, digits)
    printed = units / SCALES[digits]
    if printed <= 0.0 or printed == state[F_OUT]:
        return n
    state[F_OUT] = printed
    return write_word_kernel(out, n, 70, units, digits)


@jit_inline
def point_on_kernel(s: float, state: Floats) -> None:
    """Put the point `s` mm along the move into `state`."""
    share = 1.0 if s >= state[DISTANCE] else s / state[DISTANCE]
    if state[KIND] == ARC:
        p0, p1, center = state[X0 : X0 + 3], state[X1 : X1 + 3], state[CENTER : CENTER + 2]
        point_kernel(p0, p1, center, state[SWEEP], int(state[PLANE]), True, share, state[POINT : POINT + 3])
        return
    for axis in range(3):
        here = state[X1 + axis]
        if share < 1.0:
            here = state[X0 + axis] + share * (here - state[X0 + axis])
        state[POINT + axis] = here


@jit_inline
def axis_word_kernel(out: Bytes, n: int, axis: int, state: Floats) -> int:
    """Write the word of an axis for the point in `state`, and note where the output is now."""
    unit, digits = state[UNIT], int(state[DIGITS])
    units = units_kernel(state[POINT + axis] / unit, digits)
    goal = units / SCALES[digits]
    if int(state[FLAGS]) & RELATIVE_XYZ:
        units = units_kernel(goal - state[X_OUT + axis] / unit, digits)
    state[X_OUT + axis] = goal * unit
    return write_word_kernel(out, n, 88 + axis, units, digits)


@jit_lean
def arc_words_kernel(out: Bytes, n: int, state: Floats) -> int:
    """Write the words of an arc to the point in `state`: its end, and its centre from where the output is."""
    first, second = (0, 2, 1)[int(state[PLANE])], (1, 0, 2)[int(state[PLANE])]
    unit, digits = state[UNIT], max(int(state[DIGITS]), 4)
    i_units = units_kernel((state[CENTER] - state[X_OUT + first]) / unit, digits)
    j_units = units_kernel((state[CENTER + 1] - state[X_OUT + second]) / unit, digits)
    for axis in range(3):
        if state[X0 + axis] != state[X1 + axis] or axis in (first, second):
            n = axis_word_kernel(out, n, axis, state)
    n = write_word_kernel(out, n, 73 + first, i_units, digits)
    return write_word_kernel(out, n, 73 + second, j_units, digits)


@jit_inline
def line_kernel(out: Bytes, n: int, s: float, volume: float, speed: float, state: Floats) -> int:
    """Write one line of a move that goes on to `s` mm along it, with `volume` mm^3, at `speed` mm/s."""
    out[n], out[n + 1] = 71, 49
    point_on_kernel(s, state)
    if state[KIND] == ARC:
        out[n + 1] = 50 if state[SWEEP] < 0.0 else 51
        n = arc_words_kernel(out, n + 2, state)
    else:
        n += 2
        for axis in range(3):
            if state[X0 + axis] != state[X1 + axis]:
                n = axis_word_kernel(out, n, axis, state)
    n = e_word_kernel(out, n, volume, state)
    return f_word_kernel(out, n, speed * 60.0 * state[FEED], 1, state)


@jit_lean
def standing_kernel(out: Bytes, n: int, lasts: float, volume: float, state: Floats) -> int:
    """Write one line that moves E alone by `volume` mm^3 in `lasts` seconds (see moves_e_kernel).

    Firmware begins and ends it at rest, so it must run faster than its mean: v t = d + v^2 / accel.
    """
    out[n], out[n + 1] = 71, 49
    n = e_word_kernel(out, n + 2, volume, state)
    unit, accel = state[UNIT], state[ALONE]
    distance, reach = abs(state[MOVED]) * unit, accel * lasts
    speed = 0.5 * (reach - math.sqrt(max(0.0, reach * reach - 4.0 * accel * distance)))
    # FEED turns mm/s into file units a minute; E is in file units already
    return f_word_kernel(out, n, speed / unit * 60.0 * state[FEED] * unit, 3, state)
