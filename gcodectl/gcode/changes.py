"""Changes: whether the signal asks for other volume along a row than its line gives."""

from __future__ import annotations

import math

from gcodectl.columns import Floats
from gcodectl.gcode.bounds import CELL0, DT
from gcodectl.gcode.cuts import added_kernel, speeds_kernel
from gcodectl.gcode.packed import (
    AREA,
    BEGIN,
    DISTANCE,
    E_DIGITS,
    FINISH,
    FLAGS,
    NOMINAL,
    OWED,
    PHASES,
    STEADY,
    TAKES,
    E,
)
from gcodectl.gcode.write import SCALES
from gcodectl.jit import jit_inline, jit_lean
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
    for rate in rates[max(int(begin / dt) - cell0, 0) : max(int(end / dt) - cell0 + 1, 0)]:
        loudest = max(loudest, abs(rate))
    return loudest


@jit_inline
def row_changes_kernel(state: Floats, phases: Floats, rates: Floats, on_path: bool, writable: bool) -> bool:
    """Whether the signal asks for other volume, anywhere along a row, than its line gives; takes note of the flow.

    What a row that stays as it is should have had is owed by the next.
    """
    if state[PHASES] == 0.0:
        return False
    cell0, dt = int(state[CELL0]), state[DT]
    begin, end = state[BEGIN], state[FINISH]
    lays = on_path and state[E] > 0.0
    if lays:
        _, top, _ = speeds_kernel(phases, 0, int(state[PHASES]), -math.inf, math.inf)
        state[NOMINAL] = state[E] * state[AREA] / state[DISTANCE] * top
    loudest = loudest_kernel(rates, cell0, dt, begin, end)
    state[NOMINAL] = max(state[NOMINAL], loudest / LOUD)
    if int(state[FLAGS]) & PART or (writable and lays and state[STEADY] != 1.0):
        return True
    until = end
    if writable and state[TAKES] > 0.0:
        until = end - state[TAKES]
        loudest = loudest_kernel(rates, cell0, dt, begin, until)
    if writable and loudest > TOLERANCE * state[NOMINAL]:
        return True
    owed = state[OWED] + (added_kernel(rates, cell0, dt, begin, until) if loudest > 0.0 else 0.0)
    if writable and abs(owed) > 2.0 * state[AREA] / SCALES[int(state[E_DIGITS])]:
        return True
    state[OWED] = owed + (added_kernel(rates, cell0, dt, until, end) if until < end else 0.0)
    return False
