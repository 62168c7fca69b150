"""Asking: what is asked of the plunger now for the flow that roads want, and what must be stored for it.

    wanted  ___|-----|___   -->   asked  __/-----\\__    the dead time sooner; what a plunger cannot do no flow may ask

The ramp is a triangle of `reach` samples on either side, as two sums that go along: one before its peak, one after.
They are begun anew with each span, so no rounding is carried far, and always at the same samples.

A passage wants nothing of its plunger outside of itself.
"""

from __future__ import annotations

from gcodectl.columns import Floats
from gcodectl.flow.course import DELAY, LEAST, REACH, REST, goal_kernel
from gcodectl.flow.flow_model import F
from gcodectl.flow.slewing import needed_kernel
from gcodectl.jit import jit_lean


@jit_lean
def wanted_kernel(wanted: Floats, k: int, begin: int, wall: int) -> float:
    """What a passage wants at sample k."""
    return wanted[k] if begin <= k < wall else 0.0


@jit_lean
def ask_kernel(
    wanted: Floats, begin: int, wall: int, at: int, end: int, p: Floats, asked: Floats, goals: Floats, rates: Floats
) -> None:
    """Fill samples `at` to `end` of `asked`, `goals` and `rates`.

    A goal is what must be stored for what is asked when the sample ends, a rate what leads there from the goal before.
    """
    reach, whole = int(p[REACH]), int(p[DELAY])
    part, norm = p[DELAY] - whole, 1.0 / (reach + 1.0) ** 2
    peak = at + whole
    smooth = after = before = 0.0
    for i in range(-reach, reach + 1):
        smooth += (reach + 1.0 - abs(i)) * norm * wanted_kernel(wanted, peak + i, begin, wall)
    for i in range(reach + 1):
        after += wanted_kernel(wanted, peak + 1 + i, begin, wall)
        before += wanted_kernel(wanted, peak - i, begin, wall)
    asks, goal = (asked[at - 1], goals[at - 1]) if at > begin else (0.0, p[REST])
    least, hold, held = LEAST * p[F], 0.0, False
    for k in range(at, end):
        now, peak = smooth, k + whole + 1
        smooth += (after - before) * norm
        middle = wanted_kernel(wanted, peak, begin, wall)
        after += wanted_kernel(wanted, peak + reach + 1, begin, wall) - middle
        before += middle - wanted_kernel(wanted, peak - reach - 1, begin, wall)
        asked[k] = asking = now + part * (smooth - now)
        if abs(asking - asks) > least:
            stored, flow, asks = goal, asks if asks > least else 0.0, asking
            goal = goal_kernel(asks, p)
            rates[k] = needed_kernel(stored, flow, goal, p)
            held = False
        else:
            if not held:
                hold, held = needed_kernel(goal, asks if asks > least else 0.0, goal, p), True
            rates[k] = hold
        goals[k] = goal
