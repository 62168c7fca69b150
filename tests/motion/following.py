"""Extruders to follow, made by hand: a first-order lag whose plunger has a cap."""

from __future__ import annotations

import numpy as np

from gcodectl.motion.follow import Follow


def lag(share: float, tau: float = 1.0, cap: float = 25.0, peak: float = 0.5) -> Follow:
    """tau dq/dt = u - q with |u| <= cap, mm^3/s: rise = tau ln(cap / (cap - q)), fall = tau ln((cap + q) / cap)."""
    q = cap * np.array([0.001, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99])
    rise, fall = tau * np.log(cap / (cap - q)), tau * np.log((cap + q) / cap)
    return Follow(q[None], rise[None], fall[None], share, share, peak)
