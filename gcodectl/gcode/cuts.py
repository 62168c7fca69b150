"""Cuts: where a move is cut into lines of G-code, so that its E, and its speed, come at the right time.

A line of G-code spreads its E evenly over its path. What the signal adds is a volume over time, and the machine is at
some place at any time: so the volume added is a curve over the path, and each line of G-code a chord of it.

    volume |            ____o        from a cut on, the chord may point wherever it passes all points between by
     added |      __o--'             `most` mm^3 at the most: an angle that every further point narrows (a swinging
           |  ..--                   door); when the next point lies outside it, the line ends at the last one that
           | o                       lay inside
           +------------------ path

Where the machine stands still, time takes the path's place. Where it is to change its speed more slowly than firmware
would, time over path is a second such curve, LATE seconds wide: each line runs at its mean speed, and what the firmware
does at its own acceleration is a stair beside the ramp. (Other accelerations, by M204, would do it in fewer lines; but
firmware takes corners by them, too, and would slow down at every one.)

The lines beside a corner are long enough for the arc that rounds it: a firmware takes a junction no faster than
v^2 = a d tan(angle/2) / 2 for the length d of either line (Klipper toolhead.py, calc_junction), the plan for the whole
move's. With v^2 = R (sqrt 2 - 1) c^2, c the square corner velocity, that is d >= 2 (sqrt 2 - 1) c^2 / a sqrt(1 + 2 R).

A line lasts `shortest` seconds at least: the longer of 1 / max_lines_per_second and the time in which nominal flow
moves E by 100 of its last digits (LONGEST_SHORTEST at the most): below that the digits, not the signal, would decide.

Source: the swinging door of E. H. Bristol's data compression (US patent 4,669,097, 1987, expired).
"""

from __future__ import annotations

import math

from gcodectl.columns import Floats
from gcodectl.gcode.bounds import DT, LEAST_TIME
from gcodectl.gcode.packed import (
    ACCEL,
    AREA,
    BEGIN,
    CORNER_SPEED,
    DISTANCE,
    DURATION,
    E_DIGITS,
    END,
    FINISH,
    FLAGS,
    NOMINAL,
    PHASES,
    START,
    A,
    J,
    S,
    T,
    V,
)
from gcodectl.gcode.write import SCALES
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Flag

DIGIT = 0.01
"""The most that E's last digit may be of a shortest line."""
LONGEST_SHORTEST = 0.05
MISPLACED = 0.001
"""Seconds of nominal flow that a line may place wrongly on its way."""
LATE = 0.004
"""s; how far from its time a slow ramp may be anywhere."""
SIXTH = 1.0 / 6.0
STANDING = 1e-9
"""mm; a path this short is none."""
LONGEST_CORNER = 0.1
"""s; where the arc takes longer, the signal counts for more than the corner's speed."""
UNTIL, PATH, ADDED, N_CUT = 0, 1, 2, 3
"""Columns of `cuts`: when a line ends, how far along its move (mm; s where it stands), and what was added by then."""
PART, GOES_ON = int(Flag.PART), int(Flag.GOES_ON)


@jit_lean
def added_kernel(rates: Floats, cell0: int, dt: float, begin: float, end: float) -> float:
    """Volume that the signal adds between two times, mm^3; `rates[n]`, mm^3/s, holds from (cell0 + n) dt on for dt."""
    cell = max(int(math.floor(begin / dt)), cell0)
    volume, edge = 0.0, cell * dt
    while edge < end and cell - cell0 < len(rates):
        following = (cell + 1) * dt
        volume += rates[cell - cell0] * max(0.0, min(end, following) - max(begin, edge))
        edge = following
        cell += 1
    return volume


@jit_lean
def phase_kernel(phases: Floats, first: int, last: int, t: float) -> int:
    """The phase at time t of a move whose phases are first to last (not included)."""
    while first < last - 1 and t >= phases[first, T] + phases[first, DURATION]:
        first += 1
    return first


@jit_lean
def phase_terms_kernel(phases: Floats, p: int) -> tuple[float, float, float, float, float, float]:
    """When a phase begins, how long it lasts, and its path over time: the factors of 1, x, x^2 and x^3."""
    a, j = phases[p, A], phases[p, J]
    return phases[p, T], phases[p, DURATION], phases[p, S], phases[p, V], a / 2.0, j * SIXTH


@jit_lean
def path_kernel(phases: Floats, first: int, last: int, t: float) -> float:
    """How far along its move the machine is at time t, mm; phases first to last (not included) are the move's."""
    p = phase_kernel(phases, first, last, t)
    dt = min(max(t - phases[p, T], 0.0), phases[p, DURATION])
    return float(phases[p, S] + dt * (phases[p, V] + dt * (phases[p, A] / 2.0 + dt * (phases[p, J] * SIXTH))))


@jit_lean
def speeds_kernel(phases: Floats, first: int, last: int, begin: float, end: float) -> tuple[float, float, float]:
    """Return a move's speed at `begin`, its highest speed and its hardest acceleration from there to `end`."""
    entry, top, hardest = 0.0, 0.0, 0.0
    seen = False
    for p in range(first, last):
        low = max(begin - phases[p, T], 0.0)
        high = min(end - phases[p, T], phases[p, DURATION])
        if high <= low:
            if seen:
                break
            continue
        v, a, j = phases[p, V], phases[p, A], phases[p, J]
        v0, v1 = v + low * (a + low * j / 2.0), v + high * (a + high * j / 2.0)
        if not seen:
            entry, seen = v0, True
        top = max(top, v0, v1)
        hardest = max(hardest, abs(a + low * j), abs(a + high * j))
    return entry, top, hardest


@jit_inline
def corners_kernel(state: Floats, phases: Floats) -> tuple[float, float]:
    """When the first line of a move may end and the last may begin so that its corners can be taken as planned, s."""
    last, flags, dt = int(state[PHASES]), int(state[FLAGS]), state[DT]
    soonest, latest = state[BEGIN], state[FINISH]
    rounding = 2.0 * (math.sqrt(2.0) - 1.0) * state[CORNER_SPEED] ** 2 / state[ACCEL]
    if rounding <= 0.0:
        return soonest, latest
    v = phases[0, V]
    if v > 1e-6 and not (flags & PART and state[START] == state[END]):
        reach = rounding * math.sqrt(1.0 + 4.0 * v * v / (rounding * state[ACCEL]))
        until = min(state[FINISH], state[BEGIN] + LONGEST_CORNER)
        while soonest < until and path_kernel(phases, 0, last, soonest) < reach:
            soonest += dt
    p = last - 1
    v = phases[p, V] + phases[p, DURATION] * (phases[p, A] + phases[p, DURATION] * phases[p, J] / 2.0)
    if v > 1e-6 and not flags & GOES_ON:
        reach = rounding * math.sqrt(1.0 + 4.0 * v * v / (rounding * state[ACCEL]))
        until = max(state[BEGIN], state[FINISH] - LONGEST_CORNER)
        while latest > until and state[DISTANCE] - path_kernel(phases, 0, last, latest) < reach:
            latest -= dt
    return soonest, latest


@jit_inline
def cuts_kernel(
    rates: Floats, cell0: int, dt: float, begin: float, end: float, phases: Floats, last: int,
    moves: bool, slow: bool, soonest: float, latest: float, most: float, shortest: float, cuts: Floats,
) -> int:  # fmt: skip
    """Fill `cuts` with the ends of each line from `begin` to `end`; returns how many lines there are.

    rates[n], mm^3/s, is what is added from (cell0 + n) dt on for dt; no line misplaces more than `most` mm^3 of it
    where lines of `shortest` seconds allow that, and no cut is before `soonest` or after `latest`. `moves`: the machine
    moves along its phases, `last` of them, else it stands; `slow`: at each line's mean speed.
    """
    n = 0
    tail = min(latest, end - 0.999 * shortest)
    since, from_s, from_volume = begin, 0.0, 0.0
    volume, now, s = 0.0, begin, 0.0
    low, high, early, late = -math.inf, math.inf, -math.inf, math.inf
    inside, inside_s, inside_volume = begin, 0.0, 0.0  # the last edge, where the chord may end
    cell = int(math.floor(begin / dt))
    p = 0
    from_t, lasts, begins, v, half_a, sixth_j = phase_terms_kernel(phases, p)
    while now < end:
        edge = min(end, (cell + 1) * dt)
        if 0 <= cell - cell0 < len(rates):
            volume += rates[cell - cell0] * (edge - now)
        if moves:
            while p < last - 1 and edge >= from_t + lasts:
                p += 1
                from_t, lasts, begins, v, half_a, sixth_j = phase_terms_kernel(phases, p)
            x = min(max(edge - from_t, 0.0), lasts)
            s = begins + x * (v + x * (half_a + x * sixth_j))
        else:
            s = edge - begin
        gone = s - from_s
        fits = True
        if gone > STANDING:  # the doors' own division below is not waited for
            fits = low * gone <= volume - from_volume <= high * gone
            fits = fits and not (slow and not early * gone <= edge - since <= late * gone)
        if not fits and soonest <= inside <= tail and inside - since >= 0.999 * shortest:
            cuts[n, UNTIL], cuts[n, PATH], cuts[n, ADDED] = inside, inside_s, inside_volume
            n += 1
            since, from_s, from_volume = inside, inside_s, inside_volume
            low, high, early, late = -math.inf, math.inf, -math.inf, math.inf
            gone = s - from_s
        if gone > STANDING:
            per = 1.0 / gone
            low = max(low, (volume - from_volume - most) * per)
            high = min(high, (volume - from_volume + most) * per)
            if slow:
                early = max(early, (edge - since - LATE) * per)
                late = min(late, (edge - since + LATE) * per)
        inside, inside_s, inside_volume = edge, s, volume
        now = edge
        cell += 1
    cuts[n, UNTIL], cuts[n, PATH], cuts[n, ADDED] = end, s, volume
    return n + 1


@jit_lean
def shortest_kernel(state: Floats) -> float:
    """Seconds a line must last so that E's last digit is DIGIT of it; see the module."""
    least, nominal = state[LEAST_TIME], state[NOMINAL]
    digit = state[AREA] / SCALES[int(state[E_DIGITS])]
    return float(max(least, min(LONGEST_SHORTEST, digit / (DIGIT * nominal))) if nominal > 0.0 else least)
