"""Ramps: how far a jerk-limited change of speed takes, and how fast one can be after a distance.

A ramp goes from speed v0 to v1 with no acceleration at either end, never more than a, its jerk always +j, 0 or -j:

    a |   _____            dv = |v1 - v0|
      |  /     \\
      | /       \\          dv >= a^2/j: the acceleration reaches a       T = dv/a + a/j
    0 |/_________\\__ t     dv <  a^2/j: a triangle, its peak sqrt(j dv)  T = 2 sqrt(dv/j)

It is point-symmetric about its middle, so the path is d = (v0 + v1)/2 T. Turning that about gives the speed reached
after d: a quadratic in dv where a is reached; else, with x = sqrt(dv), the cubic x^3 + 2 v0 x = d sqrt(j), whose one
real root is 2 sqrt(p) sinh(asinh(w / p^1.5) / 3), p = 2 v0/3, w = d sqrt(j)/2. Source: Biagiotti and Melchiorri,
Trajectory Planning for Automatic Machines and Robots (2008), section 3.4, with zero acceleration at both ends.
"""

from __future__ import annotations

import math

from gcodectl.jit import jit_lean


@jit_lean
def ramp_time_kernel(v0: float, v1: float, a: float, j: float) -> float:
    """Seconds from speed v0 to v1, mm/s, at acceleration a, mm/s^2, and jerk j, mm/s^3."""
    dv = abs(v1 - v0)
    if dv * j >= a * a:
        return dv / a + a / j
    return 2.0 * math.sqrt(dv / j)


@jit_lean
def ramp_distance_kernel(v0: float, v1: float, a: float, j: float) -> float:
    """Path from speed v0 to v1, mm."""
    return 0.5 * (v0 + v1) * ramp_time_kernel(v0, v1, a, j)


@jit_lean
def reachable_kernel(v0: float, d: float, a: float, j: float) -> float:
    """Fastest speed, mm/s, that a ramp from v0 reaches within d mm (or the fastest it can come from to end at v0)."""
    knee = a * a / j
    if ramp_distance_kernel(v0, v0 + knee, a, j) <= d:
        # (v0 + dv/2)(dv/a + a/j) = d
        half = 0.5 * (2.0 * v0 / a + a / j)
        return v0 + a * (math.sqrt(half * half - 2.0 / a * (v0 * a / j - d)) - half)
    p = 2.0 * v0 / 3.0
    w = 0.5 * d * math.sqrt(j)
    if p * p * p <= 1e-42 * w * w:  # from rest, or as good as
        x = (2.0 * w) ** (1.0 / 3.0)
    else:
        x = 2.0 * math.sqrt(p) * math.sinh(math.asinh(w / (p * math.sqrt(p))) / 3.0)
    return float(v0 + min(x * x, knee))


@jit_lean
def slope_kernel(v0: float, v1: float, a: float, j: float) -> float:
    """By how much the path of a ramp grows with its faster end v1, mm a mm/s."""
    dv = v1 - v0
    if dv * j >= a * a:
        return v1 / a + 0.5 * a / j
    root = math.sqrt(dv / j)
    return root + 0.5 * (v0 + v1) / (j * root) if root > 0.0 else math.inf


@jit_lean
def peak_kernel(v0: float, v1: float, cruise: float, d: float, a: float, j: float) -> float:
    """Fastest speed within d mm that begins at v0, ends at v1 and never passes `cruise`.

    Where both ramps reach a, a quadratic: (2 v^2 - v0^2 - v1^2) / a + (2 v + v0 + v1) a / j = 2 d; else Newton's steps
    on the path that both ramps take together, kept between what is known to be too little and too much.
    """
    low, high = max(v0, v1), cruise
    if high <= low or ramp_distance_kernel(v0, high, a, j) + ramp_distance_kernel(high, v1, a, j) <= d:
        return max(low, high)
    half = 0.5 * a * a / j
    v = math.sqrt(half * half - half * (v0 + v1) + 0.5 * (v0 * v0 + v1 * v1) + a * d) - half
    if math.isinf(j) or (v - low) * j >= a * a:
        return min(max(v, low), high)
    v, least = 0.5 * (low + high), low
    for _ in range(60):
        error = ramp_distance_kernel(v0, v, a, j) + ramp_distance_kernel(v, v1, a, j) - d
        if error > 0.0:
            high = v
        else:
            low = v
        step = v - error / (slope_kernel(v0, v, a, j) + slope_kernel(v1, v, a, j))
        if abs(step - v) <= 1e-15 * v:
            break
        v = step if low < step < high else 0.5 * (low + high)
    # where the path is steep in v its last digit shows: rather below than beyond d
    error = ramp_distance_kernel(v0, v, a, j) + ramp_distance_kernel(v, v1, a, j) - d
    return max(least, v - 2.0 * error / (slope_kernel(v0, v, a, j) + slope_kernel(v1, v, a, j))) if error > 0.0 else v
