"""Track: from a recording to how every location of every layer cools.

    frames -> layings -> hottest image -> registered -> scanned -> emissivity -> cleaned -> Surface
              which      of a layer       where it is   readings   temperatures  curves
              layers

Only the first layer needs help: its perspective, from matching points. Each layer after it is found by itself, and
its perspective may be handed to the next call, so that layers can be tracked one by one as they are printed.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.thermal.cleaning import Cleaned, clean
from gcodectl.thermal.frames import Frames
from gcodectl.thermal.fresh import Laying, hottest, layings
from gcodectl.thermal.perspective import Perspective
from gcodectl.thermal.radiance import apparent, corrected
from gcodectl.thermal.register import Registered, inside, register
from gcodectl.thermal.road import Road
from gcodectl.thermal.scan import scan
from gcodectl.thermal.surface import Band, Surface


@dataclasses.dataclass(frozen=True)
class Tracked:
    """One layer."""

    laying: Laying
    times: Floats
    """s; of the frames from the first that shows it being laid."""
    registered: Registered
    raw: Floats
    """degC, [locations, times], as the window's maximum has it, emissivity corrected; NaN outside the frame."""
    temperatures: Floats
    """degC, [locations, times]; cleaned, `cleaned.lost` made of their neighbours; NaN before `surface.t0`."""
    cleaned: Cleaned
    surface: Surface
    """How each location cools; those of `cleaned.lost` (outside the frame, or hidden) as their neighbours do."""
    residual: float
    """degC, rms of what is kept about the curves."""

    @property
    def unseen(self) -> int:
        """How many locations have no curve of their own."""
        return len(self.cleaned.lost)


def track(
    frames: Frames, road: Road, reference: Perspective | Registered, band: Band | None = None, emissivity: float = 1.0
) -> list[Tracked]:
    """Return the layers that a recording shows, in order; raises InputError that names what is wrong with the frames.

    `reference`: the perspective of the first layer, from matching points marked on it, or the last layer tracked as it
    was `registered`; `emissivity`: 1 where the camera corrects for it. A layer that the recording's end cuts off while
    it is laid is left out.
    """
    band = band or Band()
    found = locate(frames, road, reference, band, emissivity)
    return [_layer(frames, laying, road, registered, band, emissivity) for laying, registered in found]


def locate(
    frames: Frames, road: Road, reference: Perspective | Registered, band: Band | None = None, emissivity: float = 1.0
) -> list[tuple[Laying, Registered]]:
    """Return when and where the layers of a recording were laid, in order; as `track`, short of the temperatures."""
    band = band or Band()
    hot = apparent(0.5 * (band.high + band.deposition), emissivity, band.ambient)
    warm = apparent(band.high, emissivity, band.ambient)
    known = reference.perspective if isinstance(reference, Registered) else reference
    inside(known, road, frames[0].shape, frames.names[0])
    found = layings(frames, hot)
    if len(found) > 1 and found[-1].until - found[-1].last < found[-1].last - found[-1].first:
        found = found[:-1]
    located = []
    for laying in found:
        reference = register(hottest(frames, laying), road, reference, warm, frames.names[laying.last])
        located.append((laying, reference))
    return located


def _layer(
    frames: Frames, laying: Laying, road: Road, registered: Registered, band: Band, emissivity: float
) -> Tracked:
    part = frames.part(slice(laying.first, laying.until))
    raw = corrected(scan(part, registered.perspective, road), emissivity, band.ambient)
    try:
        cleaned = clean(part.times, raw, float(frames.times[laying.last]), band.ambient)
    except InputError as error:
        raise InputError(error.reason, source=f"{frames.names[laying.first]} and after") from error
    cooling = cleaned.cooling
    good = np.isfinite(cooling.b1)
    columns = {
        name: np.interp(road.s, road.s[good], getattr(cooling, name)[good]) for name in ("b0", "b1", "t0", "temp0")
    }
    surface = Surface(s=road.s, **columns)
    curves = surface.at(np.broadcast_to(part.times, raw.shape), band.ambient)
    without = ~good[:, None] & (part.times >= surface.t0[:, None])
    temperatures = np.where(without, curves, cleaned.temperatures)
    residual = float(np.sqrt(np.average(cooling.sigma2[good], weights=cooling.freedom[good])))
    return Tracked(laying, part.times, registered, raw, temperatures, cleaned, surface, residual)
