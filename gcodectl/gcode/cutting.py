"""Cutting: where a move must end one line of G-code and begin another, so that its E comes at the right time.

A line of G-code spreads its E evenly over its path. What the signal adds is a volume over time, and the machine is at
some place at any time: so the volume added is a curve over the path, and each line of G-code a chord of it.

    volume |            ____o        from a cut on, the chord may point wherever it passes all points between by
     added |      __o--'             `most` mm^3 at the most: an angle that every further point narrows (a swinging
           |  ..--                   door); when the next point lies outside it, the line ends at the last one that
           | o                       lay inside
           +------------------ path

Where the machine stands still, time takes the path's place. A line lasts `shortest` seconds at least: the longer of
1 / max_lines_per_second and the time in which nominal flow moves E by 100 of its last digits (LONGEST_SHORTEST at the
most): below that the digits, not the signal, would decide the rate.

Source: the swinging door of E. H. Bristol's data compression (US patent 4,669,097, 1987, expired).
"""

from __future__ import annotations

import math

from gcodectl.columns import Floats
from gcodectl.gcode.packed import DURATION, A, J, S, T, V
from gcodectl.jit import jit

DIGIT = 0.01
"""The most that E's last digit may be of a shortest line."""
LONGEST_SHORTEST = 0.05
MISPLACED = 0.001
"""Seconds of nominal flow that a line may place wrongly on its way."""
STANDING = 1e-9
"""mm; a path this short is none."""


@jit
def path_kernel(phases: Floats, first: int, last: int, t: float) -> float:
    """How far along its move the machine is at time t, mm; phases first to last (not included) are the move's."""
    p = first
    while p < last - 1 and t >= phases[p, T] + phases[p, DURATION]:
        p += 1
    dt = min(max(t - phases[p, T], 0.0), phases[p, DURATION])
    return float(phases[p, S] + dt * (phases[p, V] + dt * (phases[p, A] / 2.0 + dt * phases[p, J] / 6.0)))


@jit
def cuts_kernel(
    rates: Floats, cell0: int, dt: float, begin: float, end: float, phases: Floats, first: int, last: int,
    moves: bool, most: float, shortest: float, cuts: Floats,
) -> int:  # fmt: skip
    """Fill `cuts` with the times that end each line from `begin` to `end`; returns how many lines there are.

    rates[n], mm^3/s, is what is added from (cell0 + n) dt on for dt. `moves`: whether the machine moves along the
    phases first to last (not included), or stands.
    """
    n = 0
    since, from_s, from_volume = begin, 0.0, 0.0
    volume, now = 0.0, begin
    low, high = -math.inf, math.inf
    inside, inside_s, inside_volume = begin, 0.0, 0.0  # the last edge, where the chord may end
    cell = max(int(math.floor(begin / dt)), cell0)
    while now < end and cell - cell0 < len(rates):
        edge = min(end, (cell + 1) * dt)
        volume += rates[cell - cell0] * (edge - now)
        s = path_kernel(phases, first, last, edge) if moves else edge - begin
        gone = s - from_s
        slope = (volume - from_volume) / gone if gone > STANDING else 0.0
        fits = gone <= STANDING or low <= slope <= high
        if not fits and inside - since >= 0.999 * shortest and end - inside >= 0.999 * shortest:
            cuts[n] = inside
            n += 1
            since, from_s, from_volume = inside, inside_s, inside_volume
            low, high = -math.inf, math.inf
            gone = s - from_s
        if gone > STANDING:
            low = max(low, (volume - from_volume - most) / gone)
            high = min(high, (volume - from_volume + most) / gone)
        inside, inside_s, inside_volume = edge, s, volume
        now = edge
        cell += 1
    cuts[n] = end
    return n + 1


@jit
def shortest_kernel(least: float, area: float, e_digits: int, nominal: float) -> float:
    """Seconds a line must last so that E's last digit is DIGIT of it; see the module."""
    digit = area * 10.0 ** (-e_digits)
    return max(least, min(LONGEST_SHORTEST, digit / (DIGIT * nominal))) if nominal > 0.0 else least
