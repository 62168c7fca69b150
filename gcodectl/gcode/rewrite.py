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
    RELATIVE_E,
    RELATIVE_XYZ,
    SWEEP,
    X0,
    X1,
    X_OUT,
)
from gcodectl.gcode.write import round_kernel, write_word_kernel
from gcodectl.jit import jit
from gcodectl.path import point_kernel
from gcodectl.records import Kind

MOST_F_DIGITS = 7
ARC = int(Kind.ARC)


@jit
def e_word_kernel(out: Bytes, n: int, volume: float, floats: Floats, ints: Ints, carry: Floats) -> int:
    """Write the E word for `volume` mm^3 and what is owed, none where it rounds to 0; the rest stays owed."""
    scale = floats[AREA] * floats[FLOW] * (INCH if ints[FLAGS] & INCHES else 1.0)
    wanted = (volume + carry[OWED]) / scale
    digits = ints[E_DIGITS]
    if ints[FLAGS] & RELATIVE_E:
        printed = round_kernel(wanted, digits)
        moved = printed
    else:
        printed = round_kernel(carry[E_OUT] + wanted, digits)
        moved = printed - carry[E_OUT]
    carry[MOVED] = moved
    if abs(moved) < 0.5 * 10.0 ** (-digits):
        carry[OWED] += volume
        return n
    carry[OWED] += volume - moved * scale
    carry[E_OUT] += moved
    if not ints[FLAGS] & RELATIVE_E:
        carry[E_OUT] = printed
    return write_word_kernel(out, n, 69, printed, digits)


@jit
def f_word_kernel(out: Bytes, n: int, feed: float, digits: int, carry: Floats) -> int:
    """Write the F word (file units a minute) where it differs from the one in force, to three digits at least."""
    while 0.0 < feed * 10.0**digits < 100.0 and digits < MOST_F_DIGITS:
        digits += 1
    printed = round_kernel(feed, digits)
    if printed <= 0.0 or printed == carry[F_OUT]:
        return n
    carry[F_OUT] = printed
    return write_word_kernel(out, n, 70, printed, digits)


@jit
def position_kernel(out: Bytes, n: int, target: Floats, always: int, floats: Floats, ints: Ints, carry: Floats) -> int:
    """Write the words of the axes that the move moves (`always`: a bit each for axes that must be named)."""
    unit = INCH if ints[FLAGS] & INCHES else 1.0
    for axis in range(3):
        if floats[X0 + axis] == floats[X1 + axis] and not always >> axis & 1:
            continue
        goal = round_kernel(target[axis] / unit, ints[DIGITS])
        printed = goal
        if ints[FLAGS] & RELATIVE_XYZ:
            printed = goal - carry[X_OUT + axis] / unit
        carry[X_OUT + axis] = goal * unit
        n = write_word_kernel(out, n, 88 + axis, printed, ints[DIGITS])
    return n


@jit
def line_kernel(
    out: Bytes, n: int, s: float, volume: float, speed: float, floats: Floats, ints: Ints, carry: Floats, point: Floats
) -> int:
    """Write one line of a move that goes on to `s` mm along it, with `volume` mm^3, at `speed` mm/s."""
    unit = INCH if ints[FLAGS] & INCHES else 1.0
    arc = ints[KIND] == ARC
    share = 1.0 if s >= floats[DISTANCE] else s / floats[DISTANCE]
    p0, p1, center = floats[X0 : X0 + 3], floats[X1 : X1 + 3], floats[CENTER : CENTER + 2]
    point_kernel(p0, p1, center, floats[SWEEP], ints[PLANE], arc, share, point)
    out[n] = 71
    out[n + 1] = 49
    if arc:
        out[n + 1] = 50 if floats[SWEEP] < 0.0 else 51
    n += 2
    always = 0
    first, second = (0, 2, 1)[ints[PLANE]], (1, 0, 2)[ints[PLANE]]
    from_first, from_second = carry[X_OUT + first], carry[X_OUT + second]
    if arc:
        always = 1 << first | 1 << second
    n = position_kernel(out, n, point, always, floats, ints, carry)
    if arc:
        digits = max(ints[DIGITS], 4)
        n = write_word_kernel(out, n, 73 + first, (floats[CENTER] - from_first) / unit, digits)
        n = write_word_kernel(out, n, 73 + second, (floats[CENTER + 1] - from_second) / unit, digits)
    n = e_word_kernel(out, n, volume, floats, ints, carry)
    return f_word_kernel(out, n, speed * 60.0 * floats[FEED], 1, carry)


@jit
def moves_e_kernel(volume: float, floats: Floats, ints: Ints, carry: Floats) -> bool:
    """Whether `volume` mm^3 and what is owed move E by a digit."""
    scale = floats[AREA] * floats[FLOW] * (INCH if ints[FLAGS] & INCHES else 1.0)
    wanted = (volume + carry[OWED]) / scale
    if ints[FLAGS] & RELATIVE_E:
        moved = round_kernel(wanted, ints[E_DIGITS])
    else:
        moved = round_kernel(carry[E_OUT] + wanted, ints[E_DIGITS]) - carry[E_OUT]
    return bool(abs(moved) >= 0.5 * 10.0 ** (-ints[E_DIGITS]))


@jit
def standing_kernel(
    out: Bytes, n: int, begin: float, end: float, volume: float, accel: float, floats: Floats, ints: Ints, carry: Floats
) -> int:
    """Write one line that moves E alone by `volume` mm^3 between two times (see moves_e_kernel).

    Firmware begins and ends it at rest, so it must run faster than its mean: v t = d + v^2 / accel.
    """
    out[n] = 71
    out[n + 1] = 49
    n = e_word_kernel(out, n + 2, volume, floats, ints, carry)
    unit = INCH if ints[FLAGS] & INCHES else 1.0
    distance, reach = abs(carry[MOVED]) * unit, accel * (end - begin)
    speed = 0.5 * (reach - math.sqrt(max(0.0, reach * reach - 4.0 * accel * distance)))
    return f_word_kernel(out, n, speed / unit * 60.0 * floats[FEED] / _unit_kernel(ints), 3, carry)


@jit
def rest_time_kernel(loudest: float, accel: float, area: float) -> float:
    """Seconds that a line of E alone must last so that starting and stopping are a small part of it."""
    return 16.0 * loudest / (area * accel)


@jit
def _unit_kernel(ints: Ints) -> float:
    """FEED turns mm/s into file units a minute; E is in file units already."""
    return 1.0 / INCH if ints[FLAGS] & INCHES else 1.0
