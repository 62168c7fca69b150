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
   one; where that is no less than what is asked for, there is no zone. It is as long as the ramp to cruise at a.
2. Where head and tail overlap, the road is shared between them in proportion: two ramps from rest over d mm meet at
   the same speed just there, x of cruise, x^2 = d / (head + tail).
3. A road whose x would be less than `peak` gets faster ramps, so that x = peak; but SPARE seconds it may always take.
   One that would be over sooner, between travels or dwells, is passed at an even speed (a dot).
4. A road that a travel runs into, or that runs on into one, has no ramp of its own: flow would have to jump. There the
   first or last 1 / EDGE of the zone may be passed no faster than a ramp from rest would be where it ends.
Zones are found by row, from the row's own cruising speed and bead: a road of many short rows ramps as one.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Bools, Floats
from gcodectl.jit import jit

EDGE = 9.0
"""A ninth of the path of a ramp from rest is where it has a third of the speed."""
STEPS = np.array(
    [10, 11, 12, 13, 15, 16, 18, 20, 22, 24, 27, 30, 33, 36, 39, 43, 47, 51, 56, 62, 68, 75, 82, 91, 100.0]
)
HALFWAY = 0.5 * np.log10(STEPS[1:] * STEPS[:-1]) - 1.0
SPARE = 0.25
"""s"""


@jit
def stretch_kernel(
    distance: Floats, lays: Bools, breaks: Bools, begins: Bools, flying: Bools, ended: bool,
    since: float, flies: bool, before: Floats, flies_in: Bools, after: Floats, flies_out: Bools, known: Bools,
) -> None:  # fmt: skip
    """Measure from every row that lays to both ends of its road, mm, and say whether it is run into and out of.

    A road begins where `begins` and ends there too, where a row breaks it, or where the file ends; `flying` says of
    such a row whether that is without a stop. Rows whose road's end has not been seen are not `known`: `after` is what
    has been seen. `since`, `flies`: the path since the begin of the road before the rows, and whether it is run into.
    """
    for i in range(len(distance)):
        if not lays[i]:
            continue
        if begins[i]:
            since, flies = 0.0, flying[i]
        before[i], flies_in[i] = since, flies
        since += distance[i]
    seen, flies, sure = 0.0, False, ended
    for i in range(len(distance) - 1, -1, -1):
        if breaks[i]:
            seen, flies, sure = 0.0, flying[i], True
        if not lays[i]:
            continue
        after[i], flies_out[i], known[i] = seen, flies, sure
        seen += distance[i]
        if begins[i]:
            seen, flies, sure = 0.0, flying[i], True


def rounded(accel: Floats) -> Floats:
    """`accel` to the nearest of 24 steps a decade (IEC 60063's E24); inf where it is inf or 0."""
    fine = np.isfinite(accel) & (accel > 0)
    digits = np.log10(np.where(fine, accel, 1.0))
    decade = np.floor(digits)
    step = np.searchsorted(HALFWAY, digits - decade)
    return np.where(fine, STEPS[step] * 10.0 ** (decade - 1), np.inf)


def ramp_length(speed: Floats, accel: Floats, jerk: float) -> Floats:
    """Path of the ramps from rest to each speed, mm; as `ramp.ramp_distance_kernel`, for arrays."""
    with np.errstate(invalid="ignore"):
        seconds = np.where(speed * jerk >= accel * accel, speed / accel + accel / jerk, 2.0 * np.sqrt(speed / jerk))
    return np.where(speed > 0, 0.5 * speed * seconds, 0.0)


@dataclasses.dataclass(frozen=True)
class Zones:
    """By row: how much of it, mm, lies in the zones at its road's begin and end, and how long these are.

    `head_accel` and `tail_accel` are inf where there is no zone; `need` is the path, mm, to be known after a row.
    """

    head: Floats
    tail: Floats
    head_zone: Floats
    tail_zone: Floats
    head_accel: Floats
    tail_accel: Floats
    need: Floats

    def edges(self, road: Stretch, length: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """How much of each row, mm, lies in its road's first and last bit, and how fast these may be passed, mm/s."""
        begin = np.where(road.flies_in, self.head_zone / EDGE, 0.0)
        end = np.where(road.flies_out, self.tail_zone / EDGE, 0.0)
        with np.errstate(invalid="ignore"):
            first = np.where(begin > 0, np.sqrt(2.0 * begin * self.head_accel), np.inf)
            last = np.where(end > 0, np.sqrt(2.0 * end * self.tail_accel), np.inf)
        inside = np.clip(begin - road.before, 0.0, length), np.clip(end - road.after, 0.0, length)
        return *inside, first, last


@dataclasses.dataclass(frozen=True)
class Rows:
    """Rows and what their zones are found from."""

    lays: Bools
    breaks: Bools
    """Rows that end a road: other motion, and where the machine rests."""
    begins: Bools
    """Rows that begin one."""
    length: Floats
    """mm; 0 where nothing is laid."""
    cruise: Floats
    asked: Floats
    """Acceleration in force without us, mm/s^2."""
    flow: Floats
    """At cruising speed, mm^3/s."""
    rise: Floats
    fall: Floats
    """Seconds that the extruder takes up to that flow and down from it; 0 where it does not count."""


@dataclasses.dataclass(frozen=True)
class Stretch:
    """Where rows lie between the ends of their road, mm, and whether it is run into and out of without a stop."""

    before: Floats
    flies_in: Bools
    after: Floats
    flies_out: Bools
    known: Bools


def measure(rows: Rows, flying: Bools, carry: tuple[float, bool], *, ended: bool) -> Stretch:
    """Measure rows along their roads; `carry`: path of the road before them, whether it is run into; stretch_kernel."""
    n = len(rows.length)
    out = Stretch(np.zeros(n), np.zeros(n, np.bool_), np.zeros(n), np.zeros(n, np.bool_), np.zeros(n, np.bool_))
    stretch_kernel(
        rows.length, rows.lays, rows.breaks, rows.begins, flying, ended, *carry,
        out.before, out.flies_in, out.after, out.flies_out, out.known,
    )  # fmt: skip
    return out


def zones(road: Stretch, rows: Rows, rise: Floats, fall: Floats, jerk: float, peak: float) -> Zones:
    """The zones of rows that lay: `rise` and `fall` are the seconds that ramps must take, 0 where they need none.

    `peak` is the least share of its cruising speed that a short road reaches, less where it takes no more than
    SPARE seconds longer for it: a dot of a tenth of a second is laid as well as a road.
    """
    length, cruise, asked = rows.length, rows.cruise, rows.asked
    with np.errstate(divide="ignore", invalid="ignore"):
        up, down = rounded(cruise / rise), rounded(cruise / fall)
    head, tail = _lengths(up, down, cruise, asked, jerk)
    limited = (up < asked) | (down < asked)
    need = np.where(limited, head + tail, 0.0)
    whole = road.before + length + road.after
    with np.errstate(divide="ignore", invalid="ignore"):
        reached = np.sqrt(np.where(head + tail > 0, whole / (head + tail), 1.0))
    straight = whole / np.maximum(cruise, 1e-9)
    least = np.minimum(peak, 2.0 * straight / (straight + SPARE))
    faster = np.maximum(np.minimum(reached / np.maximum(least, 1e-9), 1.0), 1e-6) ** 2
    up, down = np.where(faster < 1, rounded(up / faster), up), np.where(faster < 1, rounded(down / faster), down)
    head, tail = _lengths(up, down, cruise, asked, jerk)
    both = head + tail
    short = whole < both
    with np.errstate(divide="ignore", invalid="ignore"):
        head = np.where(short, whole * head / both, head)
    tail = np.where(short, whole - head, tail)
    up, down = np.where(up < asked, up, np.inf), np.where(down < asked, down, np.inf)
    head, tail = np.where(np.isfinite(up), head, 0.0), np.where(np.isfinite(down), tail, 0.0)
    return Zones(
        head=np.clip(head - road.before, 0.0, length),
        tail=np.clip(tail - road.after, 0.0, length),
        head_zone=head, tail_zone=tail, head_accel=up, tail_accel=down, need=need,
    )  # fmt: skip


def _lengths(up: Floats, down: Floats, cruise: Floats, asked: Floats, jerk: float) -> tuple[Floats, Floats]:
    """How long the two ramps are, none at more than what is asked for."""
    return ramp_length(cruise, np.minimum(up, asked), jerk), ramp_length(cruise, np.minimum(down, asked), jerk)


def dot_speed(road: Stretch, rows: Rows, ramps: Floats) -> Floats:
    """The most speed of rows whose road would be over in less than half of its `ramps`, s, and SPARE; inf elsewhere."""
    whole = road.before + rows.length + road.after
    least = np.minimum(0.5 * ramps, SPARE)
    dots = rows.lays & road.known & (whole < least * rows.cruise)
    return np.where(dots, whole / np.where(least > 0, least, 1.0), np.inf)
