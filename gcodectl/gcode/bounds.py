"""Bounds: what the machine's firmware allows of a line, and the grid of the signal, as one array for the kernels."""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine

CORNER, FORTH_SPEED, BACK_SPEED, FORTH_ACCEL, BACK_ACCEL, BEAD = 0, 1, 2, 3, 4, 5
LEAST_STEPS, STEPS, ALONE = 6, 7, 11
"""Columns of `bounds`: what E may do, forth and back, mm and s of E; bead, mm^2; steps a line must have; steps a mm of
X, Y, Z and E; and what E is accelerated by alone."""
LEAST_TIME, SWITCH_DWELL, NOZZLE, PRINT_ACCEL, TRAVEL_ACCEL, SQUARE_CORNER = 12, 13, 14, 15, 16, 17
"""Seconds a line must last, seconds a change of tools takes, mm; accelerations and square corner velocity where the
file sets none."""
DT, CELL0, AT_ONCE, N_BOUNDS = 18, 19, 20, 21
"""How long a sample of the signal lasts, s, and the number of a chunk's first: rates[n] holds from (CELL0 + n) DT;
what a line may lay on any path, however short, mm^3."""
KEEP = 0.98
"""Share of a limit that is used: the firmware's speeds are not quite the plan's."""


def bounds_of(machine: Machine) -> Floats:
    """The machine's limits as the kernels take them, shape (N_BOUNDS,); the grid is filled in chunk by chunk."""
    limits = machine.e_limits
    bounds = np.full(N_BOUNDS, np.inf)
    bounds[CORNER], bounds[BACK_SPEED] = KEEP * limits.corner_speed, KEEP * limits.max_speed
    bounds[BACK_ACCEL] = KEEP * (machine.e_accel if limits.alone else limits.max_accel)
    if not limits.alone:
        bounds[FORTH_SPEED], bounds[FORTH_ACCEL] = bounds[BACK_SPEED], bounds[BACK_ACCEL]
    bounds[BEAD], bounds[AT_ONCE] = KEEP * limits.max_bead, KEEP * machine.most_at_once
    bounds[LEAST_STEPS] = limits.least_steps
    bounds[STEPS:ALONE] = (*machine.steps_per_mm, machine.e_steps_per_mm)
    bounds[ALONE] = machine.e_accel
    bounds[LEAST_TIME], bounds[SWITCH_DWELL] = 1.0 / machine.max_lines_per_second, machine.switch_dwell
    bounds[NOZZLE], bounds[SQUARE_CORNER] = machine.nozzle, machine.corner_speed
    bounds[PRINT_ACCEL], bounds[TRAVEL_ACCEL] = machine.accel, machine.travel_accel
    return bounds
