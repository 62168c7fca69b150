"""Cleaning: what the camera saw of a location, without what was not the location.

    T |  o                     1. frames from before the road was laid, and while it was: left out
      |   o o  dropped         2. cold marks, where the head stood in between: left out
      |    |   o o o
      |    |         x  o o    3. the cooling curve is fitted; what is more than 3 standard deviations from it is left
      |    |       o      o o     out; again, until nothing is
      +----|--ooo-----------> t

    heated again   three frames that lie more than RISE above where the ten before them were heading begin a new
                   curve, and the location's own t0: what came before says nothing about what comes

A location of which too little is left, or that does not cool, has no curve; more than a tenth of those is a fault.

The paper fills cold marks from their neighbours by a polynomial before it fits: then what was made up counts as seen,
the variance comes out too small, and so do the intervals. Here the fit goes without, and the curve fills them.
Source: Fathizadan, dissertation (2022), section 4.1.3, steps 1 to 3.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.errors import InputError
from gcodectl.thermal.cooling import LEAST, Cooling, fit, standardised

RISE = 6.0
"""degC"""
MOST_LOST = 0.1
"""Share of the locations that may be without a curve."""
_Z = 3.0
_LATE = 0.2
"""Share of the frames, the last ones, from which is told how cold the surface gets."""
_AFTER, _HALF = 3, 5


@dataclasses.dataclass(frozen=True)
class Cleaned:
    """A layer's temperatures, put right; [locations, times] where nothing else is said."""

    temperatures: Floats
    """degC; as observed, or as the curve has it where nothing valid was seen; NaN before t0, or without a curve."""
    kept: Bools
    """Which are observations."""
    cooling: Cooling
    """A row a location; t0 is the first time that is kept. NaN for a location without a curve."""
    cold: int
    """How many observations were cold marks,"""
    outlying: int
    """and how many were too far from the curve."""
    heated: Ints
    """Locations that were heated again,"""
    lost: Ints
    """and those without a curve, never seen or seen too little."""


def clean(times: Floats, raw: Floats, laid: float, ambient: float) -> Cleaned:
    """Return a layer's temperatures without dropped frames, cold marks and outliers, and the curves fitted to them.

    `raw`: degC, [locations, times], NaN where nothing was seen; `laid`: when the last of the road was laid, s. Raises
    InputError where too little is left of a location.
    """
    late = times > laid
    seen = np.isfinite(raw) & late
    kept = seen & (np.nan_to_num(raw, nan=ambient) > _coldest(raw, seen, ambient))
    kept &= ~_dips(raw, kept)
    cold = int(np.count_nonzero(seen & ~kept))
    begin, heated = _begins(times, raw, kept)
    kept &= np.arange(len(times)) >= begin[:, None]
    cooling, kept, outlying = _fitted(times, raw, kept, ambient)
    visible = int(np.isfinite(raw).any(axis=1).sum())
    lost = np.flatnonzero(~np.isfinite(cooling.b1))
    if len(lost) - (len(raw) - visible) > MOST_LOST * visible:
        lost = lost[np.isfinite(raw[lost]).any(axis=1)]
        raise InputError(
            f"{len(lost)} of {visible} locations show no cooling (location {lost[0]} has {kept[lost[0]].sum()} of "
            f"{len(times)} frames after the road was laid, at {laid:g} s): record for longer, or see what hides them"
        )
    curve, _ = cooling.predict(np.broadcast_to(times, raw.shape), ambient)
    temperatures = np.where(times >= cooling.t0[:, None], np.where(kept, raw, curve), np.nan)
    return Cleaned(temperatures, kept, cooling, cold, outlying, heated, lost)


def _coldest(raw: Floats, seen: Bools, ambient: float) -> float:
    """Return the reading half-way from ambient to what the surface has cooled to in the end: colder is not surface."""
    rows = np.flatnonzero(seen.any(axis=0))
    last = rows[-max(1, int(_LATE * len(rows))) :] if len(rows) else rows
    values = raw[:, last][seen[:, last]]
    return ambient + 0.5 * (float(np.median(values)) - ambient) if values.size else ambient


def _dips(raw: Floats, kept: Bools) -> Bools:
    """Return what lies more than RISE below the median of the five around it: the head hid a part of the window."""
    dips = np.zeros_like(kept)
    for location in range(len(raw)):
        rows = np.flatnonzero(kept[location])
        if len(rows) > _HALF:
            values = raw[location, rows]
            around = _medians(np.pad(values, _HALF // 2, mode="reflect"), _HALF)
            dips[location, rows] = values < around - RISE
    return dips


def _begins(times: Floats, raw: Floats, kept: Bools) -> tuple[Ints, Ints]:
    """Return the frame from which each location only cools, and which locations were heated again."""
    begin, heated = np.zeros(len(raw), dtype=np.int64), []
    for location in range(len(raw)):
        rows = np.flatnonzero(kept[location])
        if len(rows) < 2 * _HALF + _AFTER:
            continue
        t, level = times[rows], _medians(raw[location, rows], _HALF)
        middle = t[_HALF // 2 : len(t) - _HALF // 2]
        first, second = slice(0, -_HALF - _AFTER), slice(_HALF, -_AFTER)
        slope = np.minimum((level[second] - level[first]) / (middle[second] - middle[first]), 0.0)
        after = _medians(raw[location, rows], _AFTER)[2 * _HALF :]
        expected = level[second] + slope * (t[2 * _HALF + 1 : len(t) - _AFTER + 2] - middle[second])
        rise = after - expected
        if rise.max() > RISE:
            last = int(np.flatnonzero(rise > RISE)[-1])
            peak = max(last - _AFTER, 0) + int(np.argmax(rise[max(last - _AFTER, 0) : last + 1]))
            begin[location] = rows[2 * _HALF + peak]
            heated.append(location)
    return begin, np.array(heated, dtype=np.int64)


def _medians(values: Floats, width: int) -> Floats:
    return np.asarray(np.median(sliding_window_view(values, width), axis=1))


def _fitted(times: Floats, raw: Floats, kept: Bools, ambient: float) -> tuple[Cooling, Bools, int]:
    """Return the curves, what is left to fit them to, and how many outliers went; only what changed is fitted again."""
    kept = kept.copy()
    observed = np.where(kept, raw, np.nan)
    cooling = _curves(times, observed, ambient)
    outlying = 0
    rows = np.flatnonzero(np.isfinite(cooling.b1))
    while len(rows):
        z = np.abs(np.nan_to_num(standardised(cooling[rows], times, observed[rows], ambient)))
        wrong = z > _Z
        if not wrong.any():
            break
        outlying += int(np.count_nonzero(wrong))
        kept[rows] &= ~wrong
        rows = rows[wrong.any(axis=1)]
        observed = np.where(kept, raw, np.nan)
        cooling = _exchanged(cooling, rows, _curves(times, observed[rows], ambient))
    return cooling, kept, outlying


def _curves(times: Floats, observed: Floats, ambient: float) -> Cooling:
    """Return the fitted curves, NaN for a location that has none: found by halves, since most have one."""
    none = Cooling.empty(1).replace(**{name: [np.nan] for name in ("b0", "b1", "t0", "temp0", "sigma2")})
    enough = np.isfinite(observed).sum(axis=1) >= LEAST
    if not enough.all():
        curves = _curves(times, observed[enough], ambient) if enough.any() else none
        order = np.where(enough, np.cumsum(enough) - 1, len(curves))
        return Cooling.concat([curves, none])[order]
    try:
        return fit(times, observed, ambient)
    except InputError:
        if len(observed) == 1:
            return none
    half = len(observed) // 2
    return Cooling.concat([_curves(times, part, ambient) for part in (observed[:half], observed[half:])])


def _exchanged(cooling: Cooling, rows: Ints, some: Cooling) -> Cooling:
    """Return the curves with some rows exchanged."""
    order = np.arange(len(cooling))
    order[rows] = len(cooling) + np.arange(len(rows))
    return Cooling.concat([cooling, some])[order]
