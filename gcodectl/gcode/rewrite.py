"""Rewrite: one line of G-code for a piece of a move, its words rounded to the file's digits and the rest carried on."""

from __future__ import annotations

import math

from gcodectl.columns import Bytes, Floats, Ints
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
    INCH,
    INCHES,
    KIND,
    MOVED,
    OWED,
    PLANE,
    POINT,
    RELATIVE_E,
    RELATIVE_XYZ,
    SWEEP,
    X0,
    X1,
    X_OUT,
)
from gcodectl.gcode.write import SCALES, units_kernel, write_word_kernel
from gcodectl.jit import jit_lean
from gcodectl.path import point_kernel
from gcodectl.records import Kind

MOST_F_DIGITS = 7
ARC = int(Kind.ARC)


@jit_lean
def e_units_kernel(volume: float, row: Floats, whole: Ints, carry: Floats) -> int:
    """The E word for `volume` mm^3 and what is owed, in units of its last digit; notes what it moves E by."""
    wanted = (volume + carry[OWED]) / e_scale_kernel(row, whole)
    if whole[FLAGS] & RELATIVE_E:
        units = units_kernel(wanted, whole[E_DIGITS])
        carry[MOVED] = units / SCALES[whole[E_DIGITS]]
    else:
        units = units_kernel(carry[E_OUT] + wanted, whole[E_DIGITS])
        carry[MOVED] = units / SCALES[whole[E_DIGITS]] - carry[E_OUT]
    return units


@jit_lean
def e_scale_kernel(row: Floats, whole: Ints) -> float:
    """Volume that one of E in the file's units stands for, mm^3."""
    return float(row[AREA] * row[FLOW] * (INCH if whole[FLAGS] & INCHES else 1.0))


@jit_lean
def moves_e_kernel(volume: float, row: Floats, whole: Ints, carry: Floats) -> bool:
    """Whether `volume` mm^3 and what is owed move E by a digit."""
    e_units_kernel(volume, row, whole, carry)
    return bool(abs(carry[MOVED]) >= 0.5 / SCALES[whole[E_DIGITS]])


@jit_lean
def e_word_kernel(out: Bytes, n: int, volume: float, row: Floats, whole: Ints, carry: Floats) -> int:
    """Write the E word for `volume` mm^3 and what is owed, none where it rounds to 0; the rest stays owed."""
    units, digits = e_units_kernel(volume, row, whole, carry), whole[E_DIGITS]
    if abs(carry[MOVED]) < 0.5 / SCALES[digits]:
        carry[OWED] += volume
        return n
    carry[OWED] += volume - carry[MOVED] * e_scale_kernel(row, whole)
    carry[E_OUT] = carry[E_OUT] + carry[MOVED] if whole[FLAGS] & RELATIVE_E else units / SCALES[digits]
    return write_word_kernel(out, n, 69, units, digits)


@jit_lean
def f_word_kernel(out: Bytes, n: int, feed: float, digits: int, carry: Floats) -> int:
    """Write the F word (file units a minute) where it differs from the one in force, to three digits at least."""
    while 0.0 < feed * SCALES[digits] < 100.0 and digits < MOST_F_DIGITS:
        digits += 1
    units = units_kernel(feed, digits)
    printed = units / SCALES[digits]
    if printed <= 0.0 or printed == carry[F_OUT]:
        return n
    carry[F_OUT] = printed
    return write_word_kernel(out, n, 70, units, digits)


@jit_lean
def point_on_kernel(s: float, row: Floats, whole: Ints) -> None:
    """Put the point `s` mm along the move into `row`."""
    share = 1.0 if s >= row[DISTANCE] else s / row[DISTANCE]
    if whole[KIND] == ARC:
        p0, p1, center = row[X0 : X0 + 3], row[X1 : X1 + 3], row[CENTER : CENTER + 2]
        point_kernel(p0, p1, center, row[SWEEP], whole[PLANE], True, share, row[POINT : POINT + 3])
        return
    for axis in range(3):
        here = row[X1 + axis]
        if share < 1.0:
            here = row[X0 + axis] + share * (here - row[X0 + axis])
        row[POINT + axis] = here


@jit_lean
def axis_word_kernel(out: Bytes, n: int, axis: int, row: Floats, whole: Ints, carry: Floats) -> int:
    """Write the word of an axis for the point in `row`, and note where the output is now."""
    unit, digits = INCH if whole[FLAGS] & INCHES else 1.0, whole[DIGITS]
    units = units_kernel(row[POINT + axis] / unit, digits)
    goal = units / SCALES[digits]
    if whole[FLAGS] & RELATIVE_XYZ:
        units = units_kernel(goal - carry[X_OUT + axis] / unit, digits)
    carry[X_OUT + axis] = goal * unit
    return write_word_kernel(out, n, 88 + axis, units, digits)


@jit_lean
def line_kernel(
    out: Bytes, n: int, s: float, volume: float, speed: float, row: Floats, whole: Ints, carry: Floats
) -> int:
    """Write one line of a move that goes on to `s` mm along it, with `volume` mm^3, at `speed` mm/s."""
    arc = whole[KIND] == ARC
    first, second = -1, -1
    from_first, from_second = 0.0, 0.0
    out[n], out[n + 1] = 71, 49
    if arc:
        out[n + 1] = 50 if row[SWEEP] < 0.0 else 51
        first, second = (0, 2, 1)[whole[PLANE]], (1, 0, 2)[whole[PLANE]]
        from_first, from_second = carry[X_OUT + first], carry[X_OUT + second]
    n += 2
    point_on_kernel(s, row, whole)
    for axis in range(3):
        if row[X0 + axis] != row[X1 + axis] or axis in (first, second):
            n = axis_word_kernel(out, n, axis, row, whole, carry)
    if arc:
        unit, digits = INCH if whole[FLAGS] & INCHES else 1.0, max(whole[DIGITS], 4)
        i_units = units_kernel((row[CENTER] - from_first) / unit, digits)
        j_units = units_kernel((row[CENTER + 1] - from_second) / unit, digits)
        n = write_word_kernel(out, n, 73 + first, i_units, digits)
        n = write_word_kernel(out, n, 73 + second, j_units, digits)
    n = e_word_kernel(out, n, volume, row, whole, carry)
    return f_word_kernel(out, n, speed * 60.0 * row[FEED], 1, carry)


@jit_lean
def standing_kernel(
    out: Bytes, n: int, begin: float, end: float, volume: float, accel: float, row: Floats, whole: Ints, carry: Floats
) -> int:
    """Write one line that moves E alone by `volume` mm^3 between two times (see moves_e_kernel).

    Firmware begins and ends it at rest, so it must run faster than its mean: v t = d + v^2 / accel.
    """
    out[n], out[n + 1] = 71, 49
    n = e_word_kernel(out, n + 2, volume, row, whole, carry)
    unit = INCH if whole[FLAGS] & INCHES else 1.0
    distance, reach = abs(carry[MOVED]) * unit, accel * (end - begin)
    speed = 0.5 * (reach - math.sqrt(max(0.0, reach * reach - 4.0 * accel * distance)))
    # FEED turns mm/s into file units a minute; E is in file units already
    return f_word_kernel(out, n, speed / unit * 60.0 * row[FEED] * unit, 3, carry)


@jit_lean
def rest_time_kernel(loudest: float, accel: float, area: float) -> float:
    """Seconds that a line of E alone must last so that starting and stopping are a small part of it."""
    return 16.0 * loudest / (area * accel)
