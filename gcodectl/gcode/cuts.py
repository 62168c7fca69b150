"""Cuts: where a move is cut into lines of G-code, so that the signal over it is said closely enough.

The plunger's volume along a move is what the reference gives to each millimetre of path plus what the signal adds over
time; a line of G-code spreads its E evenly over its path. So the move is cut where the added rate would be farther than
TOLERANCE of the nominal flow from its mean over the line, but never into lines shorter than `shortest` seconds:

    added rate |      ____
               |     |    |__                     one line of G-code from cut to cut; E is the volume between
               |_____|       |_______________     two cuts, rounded to the file's digits, the rest carried on
               cut  cut  cut                 cut

The lines beside a corner are long enough for the arc that rounds it: a firmware takes a junction no faster than
v^2 = a d tan(angle/2) / 2 for the length d of either line (Klipper toolhead.py, calc_junction), the plan for the whole
move's. With v^2 = R (sqrt 2 - 1) c^2, c the square corner velocity, that is d >= 2 (sqrt 2 - 1) c^2 / a sqrt(1 + 2 R).

`shortest` is the longer of 1 / max_lines_per_second and the time in which nominal flow moves E by 100 of its last
digits (at most LONGEST_SHORTEST): below that the digits, not the signal, would decide the rate.
"""

from __future__ import annotations

import math

from gcodectl.columns import Floats, Ints
from gcodectl.gcode.packed import (
    ACCEL,
    CORNER_SPEED,
    DISTANCE,
    DURATION,
    END,
    FLAGS,
    PHASE,
    PHASES,
    START,
    A,
    J,
    S,
    T,
    V,
)
from gcodectl.jit import jit
from gcodectl.records import Flag

TOLERANCE = 0.01
LONGEST_SHORTEST = 0.05
LONGEST_CORNER = 0.1
"""s; where the arc takes longer, the signal counts for more than the corner's speed."""
PART, GOES_ON = int(Flag.PART), int(Flag.GOES_ON)


@jit
def added_kernel(rates: Floats, cell0: int, dt: float, begin: float, end: float) -> float:
    """Volume that the signal adds between two times, mm^3; `rates[n]`, mm^3/s, holds from (cell0 + n) dt on for dt."""
    cell = max(int(math.floor(begin / dt)), cell0)
    volume = 0.0
    while cell * dt < end and cell - cell0 < len(rates):
        volume += rates[cell - cell0] * max(0.0, min(end, (cell + 1) * dt) - max(begin, cell * dt))
        cell += 1
    return volume


@jit
def path_kernel(phases: Floats, first: int, last: int, t: float) -> float:
    """How far along its move the machine is at time t, mm; phases first to last (not included) are the move's."""
    p = first
    while p < last - 1 and t >= phases[p, T] + phases[p, DURATION]:
        p += 1
    dt = min(max(t - phases[p, T], 0.0), phases[p, DURATION])
    return float(phases[p, S] + dt * (phases[p, V] + dt * (phases[p, A] / 2.0 + dt * phases[p, J] / 6.0)))


@jit
def fastest_kernel(phases: Floats, first: int, last: int, begin: float, end: float) -> float:
    """Highest speed between two times of a move, mm/s."""
    best = 0.0
    for p in range(first, last):
        low = max(begin - phases[p, T], 0.0)
        high = min(end - phases[p, T], phases[p, DURATION])
        if high < low:
            continue
        for dt in (low, high):
            best = max(best, phases[p, V] + dt * (phases[p, A] + dt * phases[p, J] / 2.0))
    return best


@jit
def corners_kernel(floats: Floats, ints: Ints, phases: Floats, dt: float) -> tuple[float, float]:
    """When the first line of a move may end and the last may begin so that its corners can be taken as planned, s."""
    first, last = ints[PHASE], ints[PHASES]
    begin, end = phases[first, T], phases[last - 1, T] + phases[last - 1, DURATION]
    rounding = 2.0 * (math.sqrt(2.0) - 1.0) * floats[CORNER_SPEED] ** 2 / floats[ACCEL]
    soonest, latest = begin, end
    for at_end in range(2):
        v = phases[first, V]
        if at_end:
            p = last - 1
            v = phases[p, V] + phases[p, DURATION] * (phases[p, A] + phases[p, DURATION] * phases[p, J] / 2.0)
        straight = ints[FLAGS] & GOES_ON if at_end else (ints[FLAGS] & PART and ints[START] == ints[END])
        if v <= 1e-6 or straight or rounding <= 0.0:
            continue
        reach = rounding * math.sqrt(1.0 + 4.0 * v * v / (rounding * floats[ACCEL]))
        if at_end:
            while (
                latest > max(begin, end - LONGEST_CORNER)
                and floats[DISTANCE] - path_kernel(phases, first, last, latest) < reach
            ):
                latest -= dt
        else:
            while soonest < min(end, begin + LONGEST_CORNER) and path_kernel(phases, first, last, soonest) < reach:
                soonest += dt
    return soonest, latest


@jit
def cuts_kernel(
    rates: Floats, cell0: int, dt: float, begin: float, end: float, soonest: float, latest: float, most: float,
    shortest: float, cuts: Floats,
) -> int:  # fmt: skip
    """Fill `cuts` with the times that end each line from `begin` to `end`; returns how many lines there are.

    Within a line the rate is at most `most` from its mean, mm^3/s, where lines of `shortest` seconds allow it, and no
    cut before `soonest` or after `latest`.
    """
    n = 0
    since = begin
    tail = min(latest, end - 0.999 * shortest)
    cell = max(int(math.floor(begin / dt)), cell0)
    low = high = total = rates[min(cell - cell0, len(rates) - 1)]
    cells = 1
    while (cell + 1) * dt < end and cell + 1 - cell0 < len(rates):
        cell += 1
        edge, rate = cell * dt, rates[cell - cell0]
        mean = (total + rate) / (cells + 1)
        fits = max(high, rate) - mean <= most and mean - min(low, rate) <= most
        if not fits and soonest <= edge <= tail and edge - since >= 0.999 * shortest:
            cuts[n] = edge
            n += 1
            since = edge
            low = high = total = rate
            cells = 1
        elif not fits and edge > tail and tail - since >= shortest and tail >= soonest:
            cuts[n] = max(since + shortest, math.floor(tail / dt) * dt)  # what is odd stays alone
            n += 1
            break
        else:
            low, high, total = min(low, rate), max(high, rate), total + rate
            cells += 1
    cuts[n] = end
    return n + 1


@jit
def shortest_kernel(least: float, area: float, e_digits: int, nominal: float) -> float:
    """Seconds a line must last so that E's last digit is 1 % of it; see the module."""
    digit = area * 10.0 ** (-e_digits)
    return max(least, min(LONGEST_SHORTEST, digit / (TOLERANCE * nominal))) if nominal > 0.0 else least
