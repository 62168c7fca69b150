"""Ease: how much of what a line should carry the firmware lets it carry; the rest waits for the next lines.

The firmware sees E as an axis that runs beside the path at r = dE/ds, and stops or slows the whole machine where r is
more than it allows (`motion.feasible` lists its rules). So every line's r is kept within

    r_before +- e_corner_speed / v     v: speed at the junction             Klipper extruder.py, calc_junction; M205 E
    +- e_max_accel / a                 a: acceleration along the line       M201 E; Klipper max_extrude_only_accel
    +- e_max_speed / v_top                                                  M203 E; Klipper max_extrude_only_velocity
    max_bead / area, or nozzle x max_bead in the line                       Klipper check_move

(Klipper minds acceleration and speed only where E goes back, and how thick a bead is only where there is more in the
line than nozzle x max_bead: so a barrel fills in short lines while the head still crawls); what it cannot carry is
owed. Paying a debt at once would overshoot, and that be limited again; so no more than can be taken back by one step d
a line is added. With equal lines that pays O = x + (x - d) + (x - 2 d) + ..., hence

    r |       wanted ____________            x = d (sqrt(1/4 + 2 O / d) - 1/2),  O all at once where O <= d
      |       ______|_
      |    __|::|     |__  owed, then paid
      |___|__|__________________ lines

No more than MOST_OWED is owed for a junction; what the firmware would refuse is never said.
"""

from __future__ import annotations

import math

from gcodectl.columns import Floats
from gcodectl.gcode.bounds import (
    AT_ONCE,
    BACK_ACCEL,
    BACK_SPEED,
    BEAD,
    CORNER,
    FORTH_ACCEL,
    FORTH_SPEED,
    LEAST_STEPS,
    STEPS,
)
from gcodectl.gcode.packed import AREA, DISTANCE, KIND, NOMINAL, OWED, RATIO, X0, X1, E
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Kind

MOST_OWED = 0.01
"""Seconds of nominal flow that may be owed for the sake of a junction's speed: beyond that the bead comes first, and
the firmware slows down."""
ARC = int(Kind.ARC)


@jit_lean
def repaid_kernel(owed: float, step: float) -> float:
    """How much of `owed` a line may take on if later ones may change by `step` each; same unit, any sign."""
    size = abs(owed)
    if size > step:
        size = step * (math.sqrt(0.25 + 2.0 * size / step) - 0.5)
    return math.copysign(size, owed)


@jit_inline
def eased_kernel(volume: float, path: float, entry: float, top: float, accel: float, state: Floats) -> float:
    """What a line should say of `volume` mm^3 beside what is owed, on `path` mm from `entry` to at most `top` mm/s.

    `state` gives the ratio of the line before (RATIO) and what is owed (OWED); the caller owes what is left unsaid.
    """
    if path <= 0.0:
        return volume
    scale = path * state[AREA]
    wanted = (volume + state[OWED]) / scale
    high = min(state[FORTH_SPEED] / max(top, 1e-9), state[FORTH_ACCEL] / max(accel, 1e-9))
    low = -min(state[BACK_SPEED] / max(top, 1e-9), state[BACK_ACCEL] / max(accel, 1e-9))
    high = min(high, max(state[BEAD] * path, state[AT_ONCE]) / scale)
    step = state[CORNER] / max(entry, 1e-9)
    if low <= wanted <= high and abs(wanted - state[RATIO]) <= step:
        return volume
    whole = wanted
    wanted = volume / scale + repaid_kernel(state[OWED] / scale, step)
    wanted = min(max(wanted, state[RATIO] - step), state[RATIO] + step)
    debt = MOST_OWED * state[NOMINAL] / scale
    wanted = min(max(wanted, whole - debt), whole + debt)
    return float(min(max(wanted, low), high) * scale - state[OWED])


@jit_lean
def fewest_steps_kernel(state: Floats) -> float:
    """Share of a move on a path that one line must have at least, by the steps of its busiest axis."""
    most = abs(state[E]) * state[STEPS + 3]
    for axis in range(3):
        reach = state[DISTANCE] if state[KIND] == ARC else abs(state[X1 + axis] - state[X0 + axis])
        most = max(most, reach * state[STEPS + axis])
    return min(1.0, state[LEAST_STEPS] / most) if most > 0.0 else 0.0
