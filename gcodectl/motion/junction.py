"""Junction: how fast the corner between two moves may be taken, after Klipper's square corner velocity.

An arc touches both moves at `deviation` from the corner, travelled with centripetal acceleration a
(klippy/toolhead.py, Kinematics.md; the idea is S. Jeon's for grbl):

    deviation = corner_speed^2 (sqrt 2 - 1) / a      r = deviation s / (1 - s),  s = sin(angle/2)      v^2 <= a r

and, as the arc must not be longer than the moves, v^2 <= a d tan(angle/2) / 2 for the length d of either.
"""

from __future__ import annotations

import math

from gcodectl.jit import jit_lean


@jit_lean
def junction_kernel(
    cosine: float, accel0: float, accel1: float, corner0: float, corner1: float, length0: float, length1: float
) -> float:
    """Speed at which the corner between two moves may be taken, mm/s; `cosine` of the change of direction."""
    if cosine > 0.999999:
        return math.inf
    if cosine < -0.999999:
        return 0.0
    s = math.sqrt(0.5 * (1.0 - cosine))  # sine of half the turn; the corner's half angle is its complement
    sine = math.sqrt(0.5 * (1.0 + cosine))
    tangent = sine / s
    speed = math.inf
    for accel, corner, length in ((accel0, corner0, length0), (accel1, corner1, length1)):
        deviation = corner * corner * (math.sqrt(2.0) - 1.0) / accel
        speed = min(speed, accel * deviation * sine / (1.0 - sine), 0.5 * accel * length * tangent)
    return math.sqrt(speed)
