"""Changes: whether the signal asks for other volume along a row than its line gives."""

from __future__ import annotations

import math

from gcodectl.columns import Floats, Ints
from gcodectl.gcode.bounds import CELL0, DT, NOZZLE
from gcodectl.gcode.cuts import added_kernel, speeds_kernel
from gcodectl.gcode.packed import (
    AREA,
    DISTANCE,
    DURATION,
    E_DIGITS,
    FLAGS,
    MOST_E_DIGITS,
    NOMINAL,
    OWED,
    TOOL,
    E,
    T,
    e_digits_kernel,
    takes_kernel,
)
from gcodectl.gcode.write import SCALES
from gcodectl.jit import jit_lean
from gcodectl.records import Flag

TOLERANCE = 0.01
"""Share of the nominal flow below which a signal changes nothing."""
LOUD = 10.0
"""A signal this many times the nominal flow says that the flow is larger than what was seen of it so far."""
PART = int(Flag.PART)


@jit_lean
def loudest_kernel(rates: Floats, cell0: int, dt: float, begin: float, end: float) -> float:
    """The most that the signal adds or takes at any moment between two times, mm^3/s."""
    loudest = 0.0
    for cell in range(max(int(begin / dt) - cell0, 0), min(int(end / dt) - cell0, len(rates) - 1) + 1):
        loudest = max(loudest, abs(rates[cell]))
    return loudest


@jit_lean
def row_changes_kernel(
    floats: Floats, ints: Ints, i: int, on_path: bool, writable: bool, phases: Floats, first: int, last: int,
    rates: Floats, steady: Floats, bounds: Floats, carry: Floats,
) -> bool:  # fmt: skip
    """Whether the signal asks for other volume, anywhere along a row, than its line gives; takes note of the flow.

    What a row that stays as it is should have had is owed by the next.
    """
    if first == last:
        return False
    cell0, dt = int(bounds[CELL0]), bounds[DT]
    begin, end = phases[T, first], phases[T, last - 1] + phases[DURATION, last - 1]
    lays = on_path and floats[E, i] > 0.0
    if lays:
        _, top, _ = speeds_kernel(phases, first, last, -math.inf, math.inf)
        carry[NOMINAL] = floats[E, i] * floats[AREA, i] / floats[DISTANCE, i] * top
    loudest = loudest_kernel(rates, cell0, dt, begin, end)
    carry[NOMINAL] = max(carry[NOMINAL], loudest / LOUD)
    if ints[FLAGS, i] & PART or (writable and lays and steady[min(max(ints[TOOL, i], 0), len(steady) - 1)] != 1.0):
        return True
    added = added_kernel(rates, cell0, dt, begin, end) if loudest > 0.0 else 0.0
    if writable:
        until, takes = added, takes_kernel(ints, i, bounds, carry)
        if takes > 0.0:
            loudest = loudest_kernel(rates, cell0, dt, begin, end - takes)
            until = added_kernel(rates, cell0, dt, begin, end - takes)
        owed = abs(carry[OWED] + until)
        if loudest > TOLERANCE * carry[NOMINAL] or owed > 2.0 * last_digit_kernel(floats, ints, i, bounds):
            return True
    carry[OWED] += added
    return False


@jit_lean
def last_digit_kernel(floats: Floats, ints: Ints, i: int, bounds: Floats) -> float:
    """Volume that the last digit of a row's E stands for, mm^3."""
    digits = max(ints[E_DIGITS, i], e_digits_kernel(floats[AREA, i], bounds[NOZZLE]))
    return float(floats[AREA, i] / SCALES[min(digits, MOST_E_DIGITS)])
