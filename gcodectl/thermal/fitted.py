"""Fitted: a heat profile from the layers that a recording shows.

    layers seen                 profile
    T |\\ \\  \\  curves of         b0, b1 of each place: the mean over the layers
      | \\ \\  \\ each location     deposition: where the curves come from, at the time at which their road was laid
      |  '.'.  '.               sigma: how far a layer's curve is from the profile's when that reaches T_best, rms over
      +------------ t                  layers and places, with what the readings scatter about the curves

One layer alone says nothing of how the next may differ; its sigma is the scatter of its readings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from gcodectl.columns import Floats, column_fields
from gcodectl.errors import InputError
from gcodectl.thermal.cooling import Cooling
from gcodectl.thermal.profile import HeatProfile
from gcodectl.thermal.road import Road
from gcodectl.thermal.surface import Band, seconds_to, temperature
from gcodectl.thermal.track import Tracked

MOST_PLACES = 200


def fitted_profile(layers: Sequence[Tracked], road: Road, base: HeatProfile | None = None) -> HeatProfile:
    """The profile of what was tracked; band, head and objective are those of `base`, where there is one."""
    if not layers:
        raise InputError("no layer is laid in these frames: record from before a layer begins until it has cooled")
    band = base.band if base is not None else Band()
    b0 = np.mean([one.surface.b0 for one in layers], axis=0)
    b1 = np.mean([one.surface.b1 for one in layers], axis=0)
    starts = np.concatenate([_starts(one, road, band.ambient) for one in layers])
    band = dataclasses.replace(band, deposition=round(float(np.median(starts)), 1))
    scatter = float(np.sqrt(np.mean([one.residual**2 for one in layers])))
    sigma = float(np.hypot(scatter, _between(layers, b0, b1, band)))
    kept = np.linspace(0, len(road) - 1, min(len(road), MOST_PLACES)).round().astype(int)
    at = np.column_stack([road.xy[kept].round(2), b0[kept].round(6), b1[kept].round(8)])
    known = {"head": base.head, "time": base.time, "alpha": base.alpha} if base is not None else {}
    return HeatProfile(
        b0=round(float(b0.mean()), 6), b1=round(float(b1.mean()), 8), band=band, sigma=round(sigma, 3), at=at,
        bead=road.bead, **known,  # type: ignore[arg-type]
    )  # fmt: skip


def _starts(layer: Tracked, road: Road, ambient: float) -> Floats:
    """What each location's curve says of the time at which its road was laid, degC."""
    first, last = layer.times[0], layer.times[layer.laying.last - layer.laying.first]
    laid = first + (last - first) * road.s / road.s[-1]
    surface = layer.surface
    rest = ambient - surface.b0 / surface.b1
    return np.asarray(rest + (surface.temp0 - rest) * np.exp(surface.b1 * (laid - surface.t0)))


def _between(layers: Sequence[Tracked], b0: Floats, b1: Floats, band: Band) -> float:
    """How far layers lie from their mean when that comes to the best temperature, degC rms."""
    falls = band.ambient - b0 / b1 < band.best
    if len(layers) < 2 or not falls.any():
        return 0.0
    age = seconds_to(band.best, b0[falls], b1[falls], band.ambient, band.deposition)
    off = [
        temperature(age, one.surface.b0[falls], one.surface.b1[falls], band.ambient, band.deposition) - band.best
        for one in layers
    ]
    return float(np.sqrt(np.sum(np.square(off)) / (falls.sum() * (len(layers) - 1))))


def whole_cooling(layer: Tracked) -> Cooling:
    """How every location of a layer cools; those that were not seen, or have no curve, as their neighbours do."""
    found = layer.cleaned.cooling
    seen = np.flatnonzero(np.isfinite(layer.raw).any(axis=1))
    good = np.isfinite(found.b1)
    at, every = seen[good], np.arange(len(layer.raw))
    columns: dict[str, Floats] = {}
    for field in column_fields(Cooling):
        known = np.asarray(getattr(found, field.name)[good], dtype=np.float64)
        wide = np.stack([np.interp(every, at, one) for one in known.reshape(len(at), -1).T], axis=1)
        columns[field.name] = wide if known.ndim > 1 else wide[:, 0]
    return Cooling(**{**columns, "freedom": columns["freedom"].astype(np.int64)})  # type: ignore[arg-type]
