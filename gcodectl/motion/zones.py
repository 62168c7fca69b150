"""Zones: the stretches of a road on which the plunger, not the gantry, says how hard the speed may change.

A road begins and ends at rest. Each end has a zone as long as the ramp between rest and the row's cruising speed takes
at the acceleration that the extruder can follow:

    speed |       ____________________
          |      /                    \\                before, after: path from a row to its road's ends
          |     /                      \\
          |____/________________________\\__
          | head |                  | tail |            at machine acceleration in between
          road's start             road's end

Rules:
1. a = cruise / (share x the extruder's seconds), to the nearest of 24 steps a decade, so that the rows of a curve share
   one; where what is asked for is no more than WORTH times that, there is no zone: lines at their mean speeds are a
   coarser ramp than the firmware's own. It is as long as the ramp to cruise at a.
2. Where head and tail overlap, the road is shared between them in proportion: two ramps from rest over d mm meet at
   the same speed just there, x of cruise, x^2 = d / (head + tail).
3. A road whose x would be less than `peak` gets faster ramps, so that x = peak; but SPARE seconds it may always take.
   One that would be over sooner, between travels or dwells, is passed at an even speed (a dot).
4. A road that a travel runs into, or that runs on into one, has no ramp of its own: flow would have to jump. There the
   first or last 1 / EDGE of the zone may be passed no faster than a ramp from rest would be where it ends.
Zones are found by row, from the row's own cruising speed and bead: a road of many short rows ramps as one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats
from gcodectl.jit import jit_lean
from gcodectl.motion.limits import DISTANCE
from gcodectl.motion.ramp import ramp_distance_kernel

EDGE = 9.0
"""A ninth of the path of a ramp from rest is where it has a third of the speed."""
STEPS = np.array(
    [10, 11, 12, 13, 15, 16, 18, 20, 22, 24, 27, 30, 33, 36, 39, 43, 47, 51, 56, 62, 68, 75, 82, 91, 100.0]
)
HALFWAY = 0.5 * np.log10(STEPS[1:] * STEPS[:-1]) - 1.0
COARSEST = 1.08
"""No acceleration is rounded by more than this factor: 13 to 15 is the widest step."""
SPARE = 0.25
"""s"""
WORTH = 1.3
"""Of melts under Marlin, as quick as the gantry: rmse 0.063 without, 0.053 with it."""
LAYS, BREAKS, BEGINS, FLYING, FLIES_IN, FLIES_OUT, KNOWN = 1, 2, 4, 8, 16, 32, 64
"""What is known of a row, as bits: it lays; it ends a road (other motion, rest); it begins one; it begins or ends one
without a stop; its road is run into and out of without a stop; its road's end has been seen."""
BEFORE, AFTER, LENGTHS = range(3)
"""Rows of what is measured: mm from the road's begin to the row, and from the row to the road's end."""
ON, FLIES, SINCE, RUN_INTO, CARRY = range(5)
"""What goes on from the rows before: whether they end inside a road, and in a move along a path; the path, mm, since
that road's begin, and whether it was run into."""
HEAD, TAIL, FIRST, LAST, ZONES = range(5)
"""mm of a row in its road's head, tail, very first and last bit: zones at its begin and end by turns."""
HEAD_ZONE, TAIL_ZONE, HEAD_ACCEL, TAIL_ACCEL, FIRST_SPEED, LAST_SPEED, ZONE = range(4, 11)
"""How long head and tail are, mm; their accelerations, inf where there is none; the speeds in the last two."""


@jit_lean
def stretch_kernel(
    limits: Floats, rests: Bools, deposits: Bools, path: Floats, ended: bool, carry: Floats,
    marks: NDArray[np.int8], road: Floats,
) -> None:  # fmt: skip
    """Fill what is known of every row, and measure from every row that lays to both ends of its road.

    A road begins and ends where a row breaks it, or where the file ends. Rows whose road's end has not been seen are
    not KNOWN: AFTER is what has been seen.
    """
    on, flies, since, run_into = carry[ON] > 0.0, carry[FLIES] > 0.0, carry[SINCE], carry[RUN_INTO] > 0.0
    n = len(path)
    for i in range(n):
        distance = limits[DISTANCE, i]
        marks[i] = 0
        if deposits[i] and distance > 0.0:
            if not on:
                since, run_into = 0.0, flies
            flying = path[i] > 0.0 if on else flies
            marks[i] = LAYS | (0 if on else BEGINS) | (FLYING if flying else 0) | (FLIES_IN if run_into else 0)
            road[BEFORE, i] = since
            since += distance
            on, flies = True, path[i] > 0.0
        elif distance > 0.0 or rests[i]:
            on, flies = False, distance > 0.0 and path[i] > 0.0
            marks[i] = BREAKS | (FLYING if flies else 0)
    seen, out = 0.0, KNOWN if ended else 0
    for i in range(n - 1, -1, -1):
        mark = marks[i]
        if mark & BREAKS:
            seen, out = 0.0, KNOWN | (FLIES_OUT if mark & FLYING else 0)
        elif mark & LAYS:
            road[AFTER, i] = seen
            marks[i] = mark | out
            seen += limits[DISTANCE, i]
            if mark & BEGINS:
                seen, out = 0.0, KNOWN | (FLIES_OUT if mark & FLYING else 0)


@jit_lean
def rounded_kernel(accel: float) -> float:
    """Return `accel` to the nearest of 24 steps a decade (IEC 60063's E24); inf where it is inf, 0 or NaN."""
    if not 0.0 < accel < math.inf:
        return math.inf
    digits = math.log10(accel)
    decade = math.floor(digits)
    step = 0
    while step < len(HALFWAY) and HALFWAY[step] < digits - decade:
        step += 1
    return float(STEPS[step] * 10.0 ** (decade - 1.0))


@jit_lean
def far_kernel(before: float, after: float, cruise: float, asked: float, up: float, down: float, jerk: float) -> bool:
    """Whether a row surely lies in no zone, for ramps of `up` and `down` seconds: most do, and this is quick to say."""
    round_off = asked / jerk
    head, tail = 0.5 * cruise * (COARSEST * up + round_off), 0.5 * cruise * (COARSEST * down + round_off)
    return before >= head and after >= tail and before + after >= head + tail


@jit_lean
def zone_kernel(
    before: float, length: float, after: float, mark: int, cruise: float, asked: float, up_s: float, down_s: float,
    jerk: float, peak: float, zone: Floats,
) -> float:  # fmt: skip
    """Fill the zones of a row that lays, for ramps of `up_s` and `down_s` seconds (0: none is needed).

    `peak` is the least share of its cruising speed that a short road reaches, less where it takes no more than
    SPARE seconds longer for it: a dot of a tenth of a second is laid as well as a road. Returns the path, mm, that must
    be known after the row.
    """
    up = rounded_kernel(cruise / up_s) if up_s > 0.0 else math.inf
    down = rounded_kernel(cruise / down_s) if down_s > 0.0 else math.inf
    up, down = math.inf if WORTH * up >= asked else up, math.inf if WORTH * down >= asked else down
    head = ramp_distance_kernel(0.0, cruise, min(up, asked), jerk)
    tail = ramp_distance_kernel(0.0, cruise, min(down, asked), jerk)
    need = head + tail if up < asked or down < asked else 0.0
    whole = before + length + after
    reached = math.sqrt(whole / (head + tail)) if head + tail > 0.0 else 1.0
    straight = whole / max(cruise, 1e-9)
    least = min(peak, 2.0 * straight / (straight + SPARE))
    faster = max(min(reached / max(least, 1e-9), 1.0), 1e-6) ** 2
    if faster < 1.0:
        up, down = rounded_kernel(up / faster), rounded_kernel(down / faster)
        head = ramp_distance_kernel(0.0, cruise, min(up, asked), jerk)
        tail = ramp_distance_kernel(0.0, cruise, min(down, asked), jerk)
    if whole < head + tail:
        head = whole * head / (head + tail)
        tail = whole - head
    up, down = up if up < asked else math.inf, down if down < asked else math.inf
    head, tail = 0.0 if math.isinf(up) else head, 0.0 if math.isinf(down) else tail
    first, last = head / EDGE if mark & FLIES_IN else 0.0, tail / EDGE if mark & FLIES_OUT else 0.0
    zone[HEAD], zone[TAIL] = min(max(head - before, 0.0), length), min(max(tail - after, 0.0), length)
    zone[FIRST], zone[LAST] = min(max(first - before, 0.0), length), min(max(last - after, 0.0), length)
    zone[HEAD_ZONE], zone[TAIL_ZONE], zone[HEAD_ACCEL], zone[TAIL_ACCEL] = head, tail, up, down
    zone[FIRST_SPEED] = math.sqrt(2.0 * first * up) if first > 0.0 else math.inf
    zone[LAST_SPEED] = math.sqrt(2.0 * last * down) if last > 0.0 else math.inf
    return need


@jit_lean
def dot_kernel(whole: float, cruise: float, ramps: float) -> float:
    """The most speed where a road of `whole` mm would be over in less than half its `ramps`, s, and SPARE; else inf."""
    least = min(0.5 * ramps, SPARE)
    return whole / least if whole < least * cruise else math.inf
