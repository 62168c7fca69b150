"""Asking: what is asked of the plunger now for the flow that roads want, and what must be stored for it.

    wanted  ___|-----|___   -->   asked  __/-----\\__    the dead time sooner; what a plunger cannot do no flow may ask

The ramp is a triangle of `reach` samples on either side, as two sums that go along: one before its peak, one after.
They are begun anew with each span, so no rounding is carried far, and always at the same samples.

What must be stored for a flow takes a power: it is reckoned for the flows that differ from those before, side by side,
which a processor does several at a time, and then laid out.

    asked     0  0  2  5  9  9  9  9  4  0  0
    changes         2  5  9           4  0          each with its goal, the rate that leads there, the rate that stays

A passage wants nothing of its plunger outside of itself.
"""

from __future__ import annotations

from gcodectl.columns import Floats
from gcodectl.flow.course import BARE, DELAY, FULL, HIGHEST, LEAST, LOWEST, REACH, REST, goal_kernel
from gcodectl.flow.flow_model import F
from gcodectl.flow.slewing import needed_kernel
from gcodectl.jit import jit_lean

CHANGE, TARGET, LEADS, STAYS = FULL, BARE, HIGHEST, LOWEST
"""Rows of the work space, before a course is laid there: by change, the flow asked for, its goal, and both rates; at 0
what is asked, and stored, before the first change."""


@jit_lean
def wanted_kernel(wanted: Floats, k: int) -> float:
    """What a passage wants at its sample k."""
    return wanted[k] if 0 <= k < len(wanted) else 0.0


@jit_lean
def ramp_kernel(wanted: Floats, at: int, p: Floats, asked: Floats) -> None:
    """Fill `asked`, whose first sample is number `at` of the passage."""
    reach, whole = int(p[REACH]), int(p[DELAY])
    part, norm = p[DELAY] - whole, 1.0 / (reach + 1.0) ** 2
    peak = at + whole
    smooth = after = before = 0.0
    for i in range(-reach, reach + 1):
        smooth += (reach + 1.0 - abs(i)) * norm * wanted_kernel(wanted, peak + i)
    for i in range(reach + 1):
        after += wanted_kernel(wanted, peak + 1 + i)
        before += wanted_kernel(wanted, peak - i)
    for k in range(len(asked)):
        now, peak = smooth, peak + 1
        smooth += (after - before) * norm
        middle = wanted_kernel(wanted, peak)
        after += wanted_kernel(wanted, peak + reach + 1) - middle
        before += middle - wanted_kernel(wanted, peak - reach - 1)
        asked[k] = now + part * (smooth - now)


@jit_lean
def changes_kernel(asked: Floats, least: float, work: Floats) -> int:
    """Note every flow asked for that differs from the one before by more than `least`; returns how many there are."""
    count, asks = 0, work[CHANGE, 0]
    for k in range(len(asked)):
        if abs(asked[k] - asks) > least:
            count += 1
            work[CHANGE, count] = asks = asked[k]
    return count


@jit_lean
def targets_kernel(count: int, p: Floats, work: Floats) -> None:
    """Fill the goals of `count` changes, and the rates that lead there from the goal before, and stay."""
    least = LEAST * p[F]
    for i in range(1, count + 1):
        work[TARGET, i] = goal_kernel(work[CHANGE, i], p)
    for i in range(count + 1):
        goal, asks = work[TARGET, i], work[CHANGE, i]
        flow = asks if asks > least else 0.0
        work[STAYS, i] = needed_kernel(goal, flow, goal, p)
        if i < count:
            work[LEADS, i + 1] = needed_kernel(goal, flow, work[TARGET, i + 1], p)


@jit_lean
def lay_out_kernel(asked: Floats, least: float, work: Floats, goals: Floats, rates: Floats) -> None:
    """Fill the goals of samples, and the rates, by the changes among what is asked."""
    i, asks = 0, work[CHANGE, 0]
    for k in range(len(asked)):
        if abs(asked[k] - asks) > least:
            i, asks = i + 1, asked[k]
            rates[k] = work[LEADS, i]
        else:
            rates[k] = work[STAYS, i]
        goals[k] = work[TARGET, i]


@jit_lean
def ask_kernel(
    wanted: Floats, begin: int, wall: int, at: int, end: int, p: Floats, asked: Floats, goals: Floats, rates: Floats,
    work: Floats,
) -> None:  # fmt: skip
    """Fill samples `at` to `end` of `asked`, `goals` and `rates`; a row of `work` takes one more than these.

    A goal is what must be stored for what is asked when the sample ends, a rate what leads there from the goal before.
    """
    since, span = max(begin, 0), slice(at, end)
    ramp_kernel(wanted[since:wall], at - since, p, asked[span])
    work[CHANGE, 0], work[TARGET, 0] = (asked[at - 1], goals[at - 1]) if at > begin else (0.0, p[REST])
    least = LEAST * p[F]
    targets_kernel(changes_kernel(asked[span], least, work), p, work)
    lay_out_kernel(asked[span], least, work, goals[span], rates[span])
