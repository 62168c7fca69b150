"""Course: how much a barrel should hold at any time, by the price of flow that misses a road or lands beside it.

The stored volume S sets the flow, so the question is which course S should take. It cannot jump: at the plunger's cap U
it rises by K U - h(S) and falls by K U + h(S) a second.

      q_ref        ____________
                  |            |               a sharp road
           _______|            |_______
      S         ___________                    begun early, so that the road starts full, and drained early enough:
               /           \\                   how early is a matter of price: flow that misses a road is a gap in it,
       yield _/             \\_                 flow beside it is a thread in a travel
             pre-charged to just below the threshold: that is free, nothing flows

Prices, a sample:  on a road      MISSING (q - q_ref)^2 / (max(q_ref, F/5) F)
                   beside it      OOZE q / F,  and next to nothing for every mm^3 away from the pre-charge

The cheapest course is found by dynamic programming, backwards over a grid of S. Only four rates need be tried at each
point: both caps, the rate that holds S, and the one that makes the flow right at once; what lies between never wins
(the cost is convex about the goal).

Source: Bellman's principle; the volume balance is `flow.flow_model`'s.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.flow_model import (
    LEAK,
    PRESSURE,
    PULL,
    STORE,
    THRESHOLD,
    F,
    K,
    flow_kernel,
    loss_kernel,
    slope_kernel,
    stored_kernel,
)
from gcodectl.jit import jit

MISSING, OOZE, TIDY = 10.0, 1.0, 1e-4
LEAST = 1e-9
"""A flow below this share of the nominal one is none."""


@jit
def price_kernel(q: float, stored: float, wanted: float, rest: float, p: Floats) -> float:
    """Price of a sample with flow q at `stored` mm^3 where `wanted` mm^3/s is asked for."""
    if wanted > LEAST * p[F]:
        return float(MISSING * (q - wanted) ** 2 / (max(wanted, 0.2 * p[F]) * p[F]))
    return float(OOZE * q / p[F] + TIDY * abs(stored - rest) / p[STORE])


@jit
def goal_kernel(wanted: float, rest: float, p: Floats) -> float:
    """What should be stored for the flow wanted: the pre-charge where none is."""
    return stored_kernel(wanted, p) if wanted > LEAST * p[F] else rest


@jit
def ahead_kernel(stored: float, rate: float, dt: float, p: Floats) -> float:
    """What is stored one sample later if `rate` reaches the store (one linearly implicit step)."""
    slope = slope_kernel(stored, p) + p[LEAK] if p[PRESSURE] == 0.0 else 0.0
    return float(stored + dt * (p[K] * rate - loss_kernel(stored, p)) / (1.0 + 0.5 * dt * slope))


@jit
def rate_kernel(stored: float, goal: float, dt: float, p: Floats) -> float:
    """The rate that makes `stored` the goal one sample later: ahead_kernel inverted."""
    slope = slope_kernel(stored, p) + p[LEAK] if p[PRESSURE] == 0.0 else 0.0
    return float(((goal - stored) / dt * (1.0 + 0.5 * dt * slope) + loss_kernel(stored, p)) / p[K])


@jit
def between_kernel(row: Floats, stored: float, low: float, step: float) -> float:
    """Interpolate a row over the grid of stored volumes; constant beyond its ends."""
    place = (stored - low) / step
    if place <= 0.0:
        return float(row[0])
    if place >= len(row) - 1:
        return float(row[-1])
    i = int(place)
    return float(row[i] + (place - i) * (row[i + 1] - row[i]))


@jit
def value_kernel(wanted: Floats, dt: float, p: Floats, cap: float, low: float, high: float, value: Floats) -> None:
    """Fill value[n + 1, LEVELS]: the least price of all samples from k on, by what is stored when k begins."""
    levels = value.shape[1]
    step = (high - low) / (levels - 1)
    least = min(cap, p[PULL])
    top, bottom, flow = np.empty(levels), np.empty(levels), np.empty(levels)
    for i in range(levels):
        stored = low + i * step
        top[i] = ahead_kernel(stored, cap, dt, p)
        bottom[i] = max(low, ahead_kernel(stored, -least, dt, p))
        flow[i] = flow_kernel(stored, p)
    after = np.empty(levels)
    for i in range(levels):  # a store that is left charged will ooze until it is at its threshold
        value[len(wanted), i] = OOZE * max(0.0, low + i * step - p[THRESHOLD]) / p[F] / dt
    for k in range(len(wanted) - 1, -1, -1):
        goal = goal_kernel(wanted[k], low, p)
        for i in range(levels):
            after[i] = value[k + 1, i] + price_kernel(flow[i], low + i * step, wanted[k], low, p)
        for i in range(levels):
            stored = low + i * step
            best = min(between_kernel(after, top[i], low, step), between_kernel(after, bottom[i], low, step))
            best = min(best, between_kernel(after, min(max(goal, bottom[i]), top[i]), low, step))
            value[k, i] = min(best, between_kernel(after, min(max(stored, bottom[i]), top[i]), low, step))
