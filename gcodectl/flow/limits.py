"""Keep a plunger signal within what the plunger can do, without losing volume.

A plunger conserves volume: what it may not push now it must have pushed before or must push after, or the reservoir
holds the wrong amount of material from then on. So what the cap cuts off is not thrown away; each lump above the cap is
handed half to the room just before it and half to the room just after it, lumps below minus the cap likewise.

       u           ____ lump
                  /xxxx\\
    cap  --------/------\\---------          --------__________-------    half of x fills the room before,
               _/        \\_                       _|          |_          half of it the room after
         _____/            \\____             _____|            |_____

For a first-order lag the bound-constrained least squares solution lies there as well: the error that a saturated
stretch must leave is split between its two ends. Last to first RMS error of learning on a routine with ramps of 0.1 s
and a pause of 0.5 s, the cap as a multiple of the nominal flow:

    cap, lag       handed over    plain clipping    optimum (L-BFGS-B)
     5x, 2.7 s        0.190            0.461              0.190
     5x, 4.5 s        0.254            0.707              0.253
    10x, 4.5 s        0.161            0.456              0.160

The slew limit uses the same idea: following late (from the front) and following early (from the back) err by the same
volume with opposite signs at a step, so their mean keeps both the limit and a step's volume.

Rules: a signal that keeps both limits comes back as it is; -u gives minus what u gives; where neither side has room
left, the rest goes to whatever room there is, and only a signal longer over the cap than it is under it loses volume.
A pulse too short and tall for the slew limit becomes a triangle and does lose some.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats
from gcodectl.jit import jit


@jit
def conserve_kernel(u: Floats, cap: float) -> Floats:
    """Return `u` with every lump beyond +-cap handed to the room beside it, half each way."""
    n = len(u)
    out = np.empty(n)
    half = np.empty(n)
    for k in range(n):
        out[k] = min(max(u[k], -cap), cap)
        half[k] = 0.5 * (u[k] - out[k])
    carry = 0.0
    for sweep in range(3):  # back with one half, forth with the other, and once more for what found no room
        for step in range(n):
            k = n - 1 - step if sweep != 1 else step
            if sweep < 2:
                carry += half[k]
            if carry != 0.0:
                moved = min(carry, cap - out[k]) if carry > 0.0 else max(carry, -cap - out[k])
                out[k] = min(max(out[k] + moved, -cap), cap)
                carry -= moved
    return out


@jit
def slew_kernel(u: Floats, most: float) -> Floats:
    """Return the mean of `u` followed from the front and from the back by at most `most` a sample."""
    n = len(u)
    late, early = u.copy(), u.copy()
    for k in range(1, n):
        late[k] = min(max(u[k], late[k - 1] - most), late[k - 1] + most)
        back = n - 1 - k
        early[back] = min(max(u[back], early[back + 1] - most), early[back + 1] + most)
    return 0.5 * (late + early)


def within_limits(u: Floats, max_flow: float, max_flow_slew: float, dt: float) -> Floats:
    """Return `u` (n samples, mm^3/s) within +-max_flow (mm^3/s) and max_flow_slew (mm^3/s^2), its volume kept."""
    assert dt > 0, "samples need a length"
    assert max_flow > 0, "the plunger must be able to move"
    assert max_flow_slew > 0, "the plunger must be able to start moving"
    out = np.ascontiguousarray(u, dtype=np.float64)
    if np.abs(out).max(initial=0.0) > max_flow:
        out = conserve_kernel(out, float(max_flow))
    if np.abs(np.diff(out)).max(initial=0.0) > max_flow_slew * dt:
        out = slew_kernel(out, float(max_flow_slew * dt))
    return out.copy() if out is u else out
