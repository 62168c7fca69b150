"""Swing: what to tell a drive whose speed loop swings (a screw's motor), so that it reaches the rates that it should.

    T^2 w'' + 2 z T w' + w = u          w: the rate reached,  u: the rate told,  T: 1 / natural frequency,  z: damping

So u is w and its slopes, for a w that is smooth: the rates wanted, under a Gaussian of half T. What the drive does when
a block begins goes on before it as it is.

Source: the inverse of a second-order lag.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.course import DT, EVEN, LATE, RATE, SMOOTH, TOLD
from gcodectl.flow.flow_model import DAMPING, DRIVE, DRIVE_RATE, SWING
from gcodectl.jit import jit_lean


def smoothing(swing: float, dt: float) -> Floats:
    """Return one half of the Gaussian's weights, its middle first, for samples of `dt` s."""
    sigma = 0.5 * swing / dt
    weights = np.exp(-0.5 * (np.arange(math.ceil(4.0 * sigma) + 1) / max(sigma, 1e-9)) ** 2)
    return np.asarray(weights / (2.0 * weights.sum() - weights[0]))


@jit_lean
def against_swing_kernel(n: int, p: Floats, weights: Floats, state: Floats, work: Floats) -> None:
    """Turn the rates in row RATE (n of them, and SMOOTH more) into what to tell, in place."""
    reach, lead = int(p[SMOOTH]) - 2, int(p[SMOOTH])
    for k in range(lead):  # row LATE begins `lead` samples early, row EVEN two
        work[LATE, k] = state[DRIVE] + state[DRIVE_RATE] * p[DT] * (k - lead)
    for k in range(n + lead):
        work[LATE, lead + k] = work[RATE, k]
    for k in range(n + 4):
        work[EVEN, k] = weights[0] * work[LATE, k + lead - 2]
    for i in range(1, reach + 1):
        weight = weights[i]
        for k in range(n + 4):
            work[EVEN, k] += weight * (work[LATE, k + lead - 2 - i] + work[LATE, k + lead - 2 + i])
    swing = p[SWING]
    for k in range(n):
        rate = (work[EVEN, k + 3] - work[EVEN, k + 1]) / (2.0 * p[DT])
        bend = (work[EVEN, k + 4] - 2.0 * work[EVEN, k + 2] + work[EVEN, k]) / (4.0 * p[DT] ** 2)
        told = work[EVEN, k + 2] + 2.0 * p[DAMPING] * swing * rate + swing**2 * bend
        work[RATE, k] = min(max(told, -p[TOLD]), p[TOLD])
