"""Course: how much a barrel should hold at any time, by the price of flow that misses a road or lands beside it.

The stored volume S sets the flow, so each flow asked for has its goal G: what must be stored for it, and between roads
the pre-charge, just below the threshold, where nothing flows. Mostly the plunger can follow G: then G is the course.
Where it cannot, because at its cap U the store rises by no more than K U - h(S) and falls by K U + h(S) a second, there
is a window:

      q_ref        ____________
                  |            |               a sharp road
           _______|            |_______
      S         ___________                    begun early, so that the road starts full, and drained early enough:
               /           \\                   how early is a matter of price: flow that misses a road is a gap in it,
       yield _/             \\_                 flow beside it is a thread in a travel

Within a window only what lies between four curves can be best, and outside of it they are all G:

       backwards from every goal    filled in time for all that comes      max(G, that less one sample's filling)
                                    drained in time for all that comes     min(G, that and one sample's draining)
       forwards from every goal     filled as soon as it can be            min(G, that and one sample's filling)
                                    drained as soon as it can be           max(G, that less one sample's draining)

The cheapest course there is found by dynamic programming, backwards over LEVELS between the lowest and the highest of
them. Prices, a sample:

    on a road      MISSING (q - q_ref)^2 / (max(q_ref, F/5) F)
    beside it      OOZE q / F,  and next to nothing for every mm^3 away from the pre-charge

Only three rates need be tried at each point: both caps, and the one that makes the flow right at once; what lies
between never wins (the cost is convex about the goal).

Source: Bellman's principle; the volume balance is `flow.flow_model`'s.
"""

from __future__ import annotations

from gcodectl.columns import Floats
from gcodectl.flow.flow_model import PARAMETERS, STORE, THRESHOLD, F, stored_kernel
from gcodectl.jit import jit_inline, jit_lean

MISSING, OOZE, TIDY = 10.0, 1.0, 1e-4
LEAST = 1e-9
"""A flow below this share of the nominal one is none."""
WORTH = 2e-3
"""A price must be lower by this to lead away from the goal: the grid's own error is not to be followed."""
CLOSE = 1e-6
"""Shares of the store that make no difference."""
LEVELS = 16
# Places in an inversion's row, beyond those of its model's parameters
DT, CAP, PULLED, SLEW, TOLD, REST, LOW, SCALE, DELAY, REACH, HORIZON, SMOOTH, PER_DT, PER_K, PLACES = range(
    PARAMETERS, PARAMETERS + 15
)
# Columns of an inversion's table, by what is stored: LOW + n / SCALE mm^3
UP, DOWN, FLOW, TABLE = range(4)
# Rows of the work space, by the end of sample: k + 1; at 0 what is stored when the first begins
GOAL, COURSE, FULL, BARE, HIGHEST, LOWEST, PLAN, LATE, RATE, EVEN, WORK = range(11)


@jit_lean
def price_kernel(q: float, stored: float, wanted: float, p: Floats) -> float:
    """Price of a sample with flow q at `stored` mm^3 where `wanted` mm^3/s is asked for."""
    if wanted > LEAST * p[F]:
        return float(MISSING * (q - wanted) ** 2 / (max(wanted, 0.2 * p[F]) * p[F]))
    return float(OOZE * q / p[F] + TIDY * abs(stored - p[REST]) / p[STORE])


@jit_lean
def goal_kernel(wanted: float, p: Floats) -> float:
    """What should be stored for the flow wanted: the pre-charge where none is."""
    return stored_kernel(wanted, p) if wanted > LEAST * p[F] else float(p[REST])


@jit_lean
def read_kernel(stored: float, column: int, p: Floats, table: Floats) -> float:
    """A table's value at `stored`; straight on beyond its upper end, constant below it."""
    place = max((stored - p[LOW]) * p[SCALE], 0.0)
    i = min(int(place), len(table) - 2)
    return float(table[i, column] + (place - i) * (table[i + 1, column] - table[i, column]))


@jit_lean
def before_kernel(stored: float, column: int, p: Floats, table: Floats) -> float:
    """What must be stored for one sample at the cap, UP or DOWN, to lead to `stored`."""
    return stored - read_kernel(stored - read_kernel(stored, column, p, table), column, p, table)


@jit_inline
def between_kernel(cheapest: Floats, k: int, stored: float, low: float, scale: float) -> float:
    """Interpolate row k over LEVELS stored volumes, `scale` to a mm^3; constant beyond its ends."""
    place = min(max((stored - low) * scale, 0.0), LEVELS - 1.0)
    i = min(int(place), LEVELS - 2)
    return float(cheapest[k, i] + (place - i) * (cheapest[k, i + 1] - cheapest[k, i]))


@jit_lean
def limits_kernel(n: int, p: Floats, table: Floats, work: Floats) -> None:
    """Fill the rows FULL, BARE, HIGHEST and LOWEST for the row GOAL of n samples."""
    close = CLOSE * p[STORE]
    full = bare = work[FULL, n] = work[BARE, n] = work[GOAL, n]
    for k in range(n - 1, -1, -1):
        goal = work[GOAL, k]
        if full > goal + close:
            full = before_kernel(full, UP, p, table)
        if bare < goal - close:
            bare = before_kernel(bare, DOWN, p, table)
        full, bare = (full if full > goal + close else goal), (bare if bare < goal - close else goal)
        work[FULL, k], work[BARE, k] = full, bare
    lowest = highest = work[LOWEST, 0] = work[HIGHEST, 0] = work[GOAL, 0]
    for k in range(1, n + 1):
        goal = work[GOAL, k]
        if lowest < goal - close:
            lowest += read_kernel(lowest, UP, p, table)
        if highest > goal + close:
            highest += read_kernel(highest, DOWN, p, table)
        lowest, highest = (lowest if lowest < goal - close else goal), (highest if highest > goal + close else goal)
        work[LOWEST, k], work[HIGHEST, k] = min(lowest, work[BARE, k]), max(highest, work[FULL, k])


@jit_lean
def window_kernel(
    begin: int, end: int, wanted: Floats, p: Floats, table: Floats, work: Floats, cheapest: Floats
) -> None:
    """Fill COURSE from begin + 1 to `end`, from the goal at `begin` on; wanted[k] is asked of sample k."""
    for k in range(end, begin, -1):
        low, asked = work[LOWEST, k], wanted[k - 1]
        step = (work[HIGHEST, k] - low) / (LEVELS - 1.0)
        missing = MISSING / (max(asked, 0.2 * p[F]) * p[F]) if asked > LEAST * p[F] else 0.0
        ooze, tidy = (0.0, 0.0) if missing > 0.0 else (OOZE / p[F], TIDY / p[STORE])
        ahead = min(k + 1, end)
        goal, then = work[GOAL, ahead], work[LOWEST, ahead]
        width = work[HIGHEST, ahead] - then
        scale = (LEVELS - 1.0) / width if width > 0.0 else 0.0
        right = between_kernel(cheapest, ahead, goal, then, scale)
        for i in range(LEVELS):
            stored = low + i * step
            place = max((stored - p[LOW]) * p[SCALE], 0.0)
            j = min(int(place), len(table) - 2)
            part = place - j
            flow = max(table[j, FLOW] + part * (table[j + 1, FLOW] - table[j, FLOW]), 0.0)
            if k == end:  # a store that is left charged will ooze until it is at its threshold
                best = OOZE * max(0.0, stored - p[THRESHOLD]) / p[F] / p[DT]
            else:
                top = stored + table[j, UP] + part * (table[j + 1, UP] - table[j, UP])
                bottom = stored + table[j, DOWN] + part * (table[j + 1, DOWN] - table[j, DOWN])
                best = between_kernel(cheapest, ahead, top, then, scale)
                best = min(best, between_kernel(cheapest, ahead, bottom, then, scale))
                best = min(best, right) if bottom <= goal <= top else best
            # what `price_kernel` says
            cheapest[k, i] = best + missing * (flow - asked) ** 2 + ooze * flow + tidy * abs(stored - p[REST])
    stored = work[GOAL, begin]
    for k in range(begin + 1, end + 1):
        low, high = work[LOWEST, k], work[HIGHEST, k]
        scale = (LEVELS - 1.0) / (high - low) if high > low else 0.0
        top = max(min(stored + read_kernel(stored, UP, p, table), high), low)
        bottom = min(max(stored + read_kernel(stored, DOWN, p, table), low), high)
        stored = min(max(work[GOAL, k], bottom), top)
        best = between_kernel(cheapest, k, stored, low, scale) - WORTH
        for target in (top, bottom):
            price = between_kernel(cheapest, k, target, low, scale)
            if price < best:
                best, stored = price, target
        work[COURSE, k] = stored


@jit_lean
def course_kernel(
    wanted: Floats, decided: int, n: int, p: Floats, table: Floats, work: Floats, cheapest: Floats
) -> int:
    """Change COURSE where it is not to be the row GOAL of n samples; windows that begin after `decided` wait.

    wanted[k] is asked of sample k. Returns how many samples windows took.
    """
    limits_kernel(n, p, table, work)
    k, took = 1, 0
    while k <= min(decided, n):
        begin = k - 1
        while k <= n and work[LOWEST, k] < work[HIGHEST, k]:
            k += 1
        if k > begin + 1:
            window_kernel(begin, min(k, n), wanted, p, table, work, cheapest)
            took += k - begin
        k += 1
    return took
