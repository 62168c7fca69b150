"""Changes: whether the signal asks for other volume along a row than its line gives."""

from __future__ import annotations

from gcodectl.columns import Floats, Ints
from gcodectl.gcode.cuts import added_kernel
from gcodectl.gcode.packed import AREA, DURATION, E_DIGITS, KIND, NOMINAL, OWED, PHASE, PHASES, STEADY, TAKES, E, T
from gcodectl.jit import jit
from gcodectl.records import Kind

TOLERANCE = 0.01
"""Share of the nominal flow below which a signal changes nothing."""
LINE, ARC = int(Kind.LINE), int(Kind.ARC)


@jit
def loudest_kernel(rates: Floats, cell0: int, dt: float, begin: float, end: float) -> float:
    """The most that the signal adds or takes at any moment between two times, mm^3/s."""
    loudest = 0.0
    for cell in range(max(int(begin / dt) - cell0, 0), min(int(end / dt) - cell0, len(rates) - 1) + 1):
        loudest = max(loudest, abs(rates[cell]))
    return loudest


@jit
def row_changes_kernel(
    floats: Floats, ints: Ints, phases: Floats, rates: Floats, cell0: int, dt: float, carry: Floats
) -> bool:
    """Whether the signal asks for other volume, anywhere along a row, than its line gives."""
    first, last = ints[PHASE], ints[PHASES]
    if first == last:
        return False
    if floats[STEADY] != 1.0 and floats[E] > 0.0 and (ints[KIND] in (LINE, ARC)):
        return True
    begin = phases[first, T]
    end = phases[last - 1, T] + phases[last - 1, DURATION] - floats[TAKES]
    if loudest_kernel(rates, cell0, dt, begin, end) > TOLERANCE * carry[NOMINAL]:
        return True
    owed = carry[OWED] + added_kernel(rates, cell0, dt, begin, end)
    return bool(abs(owed) > 2.0 * floats[AREA] * 10.0 ** (-ints[E_DIGITS]))
