"""Slowing: how a layer must be slowed, and how long waited for, so that little of it comes to lie on what is too hot.

    time |                 . slowest          ready: when a location has cooled; nothing may come below it
         |              .  ___--- plan
         |           . _--'    o              need_j: the earliest that partition j may begin, if the head is as slow
         |   need  ._--  o o                  as it can be from there on, and still is late enough
         |     :  / o o        . . . fastest  the plan begins at need_0 (the wait), and is nowhere faster than `ready`
         |  wait:/     . . .                  and need_j allow: of all that keep to `ready`, it is the earliest
         +--------------------------------- path

Partition j lasts f_j dep_j + fix_j seconds, with 1 <= f_j <= most_j: what is deposited may be slowed, travels may not.

    need_j = max(ready_i - most_j dep_i - fix_i for its locations,  need_j+1 - most_j dep_j - fix_j)
    f_j    = max(floor,  (ready_i - begin_j - fix_i) / dep_i,  (need_j+1 - begin_j - fix_j) / dep_j)

`floor` slows all of it alike: the layer's own roads must cool, too, to T_best before the next one comes, and what it is
slowed by now, that one need not stand and wait for. So slowing comes first, and a wait makes up for what is left.

How hot is asked for, is one number theta a layer. What waits for its hottest location waits with all the others:

    T |  hot o     a corner that cools slowly    candidates: theta from T_best to T_high less z sigma, from there up
      |- - - - - - - - - - - - - - T_high        to the hottest as sliced, and the layer as sliced
      |  ooooo     all others                        kept to share alpha: no more locations too hot or too cold than
      |- - - - - - - - - - - - - - T_low             that, when they are come to; of these the one of least
      |            where they are if the corner
      |  ooooo     is waited for                  sum over partitions of their mean (T - T_best)^2  +  weight * seconds

Where none keeps to alpha, it is the one of least degrees outside the band, summed over locations. As sliced is the last
resort, because it gives the layer's own roads no time: where no other is as good.

Source: the objective is Fathizadan's (dissertation, 2022, eq. (4.17)), alpha that of its chance constraints; the
solution here is our own.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.thermal.surface import Band, seconds_to, temperature

LEVELS = 13
"""Temperatures that are tried up to the hottest that is asked for."""
ABOVE = 6
"""And from there to the hottest as sliced."""
ROUNDING = 0.01
"""degC"""
HALVINGS = 30
DEP, FIX, MOST, LAYER = range(4)
"""Rows of `parts`: seconds that deposit, seconds that do not, by how much the first may be stretched."""
READY, OWN_DEP, OWN_FIX, PART, LOCATION = range(5)
"""Rows of `places`: when a location has cooled (-inf: long ago), its seconds from its partition's begin, and that."""


@jit_lean
def need_kernel(places: Floats, parts: Floats, need: Floats) -> None:
    """Fill the earliest time that each partition may begin, s; one more than there are partitions."""
    count = parts.shape[1]
    need[count] = -math.inf
    for j in range(count):
        need[j] = -math.inf
    for i in range(places.shape[1]):
        j = int(places[PART, i])
        need[j] = max(need[j], places[READY, i] - parts[MOST, j] * places[OWN_DEP, i] - places[OWN_FIX, i])
    for j in range(count - 1, -1, -1):
        need[j] = max(need[j], need[j + 1] - parts[MOST, j] * parts[DEP, j] - parts[FIX, j])


@jit_lean
def forward_kernel(places: Floats, parts: Floats, need: Floats, floor: float, begin: float, stretch: Floats) -> float:
    """Fill the least stretch of each partition, none below `floor` where it can be; returns when the layer ends, s."""
    now, i, count = begin, 0, places.shape[1]
    for j in range(parts.shape[1]):
        least, dep, fix = min(floor, parts[MOST, j]), parts[DEP, j], parts[FIX, j]
        if dep > 0.0:
            least = max(least, (need[j + 1] - now - fix) / dep)
        while i < count and places[PART, i] == j:
            if places[OWN_DEP, i] > 0.0:
                least = max(least, (places[READY, i] - now - places[OWN_FIX, i]) / places[OWN_DEP, i])
            i += 1
        stretch[j] = max(1.0, min(least, parts[MOST, j]))
        now += stretch[j] * dep + fix
    return now


@jit_lean
def slow_kernel(
    places: Floats, parts: Floats, most_wait: float, lasts: float, need: Floats, stretch: Floats
) -> tuple[float, float]:
    """Fill the stretch of each partition: (the wait before the layer, when it ends without what `floor` adds), s.

    `lasts`: how long it is to take behind the wait at least; `most_wait`: no longer wait (0 where none may be).
    """
    need_kernel(places, parts, need)
    wait = min(max(need[0], 0.0), most_wait)
    end = forward_kernel(places, parts, need, 1.0, wait, stretch)
    lasts += wait
    if end < lasts:
        low, high = 1.0, 1.0
        for j in range(parts.shape[1]):
            high = max(high, parts[MOST, j])
        if forward_kernel(places, parts, need, high, wait, stretch) > lasts:
            for _ in range(HALVINGS):
                floor = 0.5 * (low + high)
                if forward_kernel(places, parts, need, floor, wait, stretch) < lasts:
                    low = floor
                else:
                    high = floor
            forward_kernel(places, parts, need, high, wait, stretch)
    return wait, end


@dataclasses.dataclass(frozen=True)
class Layer:
    """A layer as it would be printed if nothing slowed it; times in s from where it may begin."""

    part: Ints
    """The partition of each location."""
    dep: Floats
    fix: Floats
    """Seconds of deposition, and of anything else, from the partition's begin to each location."""
    part_dep: Floats
    part_fix: Floats
    """The same of whole partitions."""
    most: Floats
    """By how much each partition may be stretched."""
    b0: Floats
    b1: Floats
    """How what lies beneath each location cools."""
    since: Floats
    """When that was laid, s (before 0); NaN where nothing lies beneath."""
    cools: float
    """How long the layer's own locations take to the best temperature, the middle one, s."""


@dataclasses.dataclass(frozen=True)
class Slowing:
    """What a layer is slowed by."""

    wait: float
    """s before it."""
    stretch: Floats
    """By partition."""
    hot: int = 0
    """Locations that it leaves too hot."""


@dataclasses.dataclass(frozen=True)
class _Candidate:
    slowing: Slowing
    share: float
    """Locations outside the band."""
    outside: float
    """degC that a location lies outside on average."""
    cost: float


def slow_layer(
    layer: Layer, band: Band, hottest: float, time: float, alpha: float, most_wait: float = math.inf
) -> Slowing:
    """Slow a layer at the least cost that has no more than a share of `alpha` below band.low or above `hottest`, degC.

    `time`: degC^2 that a second is worth; `most_wait`: s, 0 where none may be.
    """
    beneath = np.isfinite(layer.since)
    asis = np.ones(len(layer.most))
    if not beneath.any():
        return Slowing(0.0, asis)
    part, dep, fix = layer.part[beneath], layer.dep[beneath], layer.fix[beneath]
    b0, b1, since = layer.b0[beneath], layer.b1[beneath], layer.since[beneath]
    share = 1.0 / np.bincount(part, minlength=len(layer.most))[part]

    def meets(wait: float, stretch: Floats) -> Floats:
        begins = wait + np.concatenate([[0.0], np.cumsum(stretch * layer.part_dep + layer.part_fix)[:-1]])
        age = begins[part] + stretch[part] * dep + fix - since
        return temperature(age, b0, b1, band.ambient, band.deposition)

    def judged(wait: float, stretch: Floats, end: float) -> _Candidate:
        found = meets(wait, stretch)
        over, under = found - hottest, band.low - found
        hot = int((over > ROUNDING).sum())
        return _Candidate(
            Slowing(wait, stretch.copy(), hot), (hot + int((under > ROUNDING).sum())) / len(found),
            float(np.maximum(np.maximum(over, under), 0.0).mean()),
            float((share * (found - band.best) ** 2).sum()) + time * end,
        )  # fmt: skip

    parts = np.stack([layer.part_dep, layer.part_fix, layer.most])
    places = np.stack([np.zeros(len(part)), dep, fix, part.astype(np.float64)])
    need, stretch = np.empty(len(layer.most) + 1), np.ones(len(layer.most))
    tried = []
    for theta in _levels(float((band.ambient - b0 / b1).max()), band.best, hottest, float(meets(0.0, asis).max())):
        places[READY] = since + seconds_to(theta, b0, b1, band.ambient, band.deposition)
        wait, end = slow_kernel(places, parts, most_wait, layer.cools, need, stretch)
        tried.append(judged(wait, stretch, end))
    return _chosen(tried, judged(0.0, asis, float((layer.part_dep + layer.part_fix).sum())), alpha)


def _levels(coolest: float, best: float, hottest: float, sliced: float) -> Floats:
    """Temperatures to try, degC; `coolest`: none can be asked for at or below it, `sliced`: the hottest as sliced."""
    levels = np.linspace(max(best, coolest + 0.1 * (hottest - coolest)), hottest, LEVELS)
    return np.append(levels, np.linspace(hottest, sliced, ABOVE + 1)[1:]) if sliced > hottest else levels


def _chosen(tried: list[_Candidate], sliced: _Candidate, alpha: float) -> Slowing:
    """The candidate of least cost of those that keep to alpha; where none does, of those least outside the band."""
    kept = [one for one in tried if one.share <= alpha] or [sliced] * (sliced.share <= alpha)
    if not kept:
        least = min(one.outside for one in tried)
        if sliced.outside < least - ROUNDING:
            return sliced.slowing
        kept = [one for one in tried if one.outside <= least + ROUNDING]
    return min(kept, key=lambda one: one.cost).slowing
