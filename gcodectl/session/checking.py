"""Checking: is what was measured the flow of this trial? What is wrong is said with what to do about it.

    short       it ends before the routine does, or begins after it          say what is missing
    missing     a hole of more than HOLE seconds                             say where
    saturated   a flat top that is reached all at once                       say at what value
    scale       it flowed 60 or 1000 times as much as was pushed, or         say which unit that would be
                backwards, or beads are as tall as no nozzle lays them
    misaligned  it flowed before the plunger moved, or later than others,    say by how much
                or is as long as the routine and counted from elsewhere

A hole shorter than that is bridged. Alignment: the nominal model is fitted with a delay that may be negative; no
extruder answers before it is pushed, and one that answers later than in its other trials has been measured from another
begin.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.learn.model import identify
from gcodectl.learn.reference import Routine
from gcodectl.session.measured import Series

HOLE = 0.3
"""s"""
CLIPPED = 0.03
"""Share of the samples with flow that a flat top is made of, at least."""
ABRUPT, GRAINS = 0.002, 2.5
"""A step onto a flat top that what levels off by itself does not make: a share of the top, and of the finest step."""
EARLY, APART, LATEST = 0.1, 0.25, 1.0
"""s; how much sooner than the plunger, apart from another trial, and later than the plunger it may flow."""
SEARCHED = 2.0
"""s; how far off a begin is looked for, either way."""
FOLLOWS = 0.97
"""Share of SEARCHED that a delay has not been found within, but was only looked for up to."""
TOO_LONG = 5.0
"""Times the path that nobody measures on behind it."""
GAIN = 6.0
"""The measured volume over the pushed one, either way, that no extruder explains."""
RESTS = 0.05
"""Share of the nominal flow that may be read where nothing should flow yet."""
FACTORS = {"t": {60.0: "min", 1000.0: "ms"}, "s": {10.0: "cm", 1000.0: "m or um", 25.4: "in"}}


@dataclasses.dataclass(frozen=True)
class Fault:
    """What is wrong with a measurement, and what to do about it."""

    what: str
    sentence: str


def resample(series: Series, routine: Routine, speed: float, height: float, shift: float = 0.0) -> Floats:
    """Return the flow on the routine's samples, mm^3/s, each the mean over its sample; holes are bridged.

    `shift` (s) is added to the times.
    """
    t, q = series.flow(speed, height)
    known = np.isfinite(t) & np.isfinite(q)
    t, index = np.unique(t[known] + shift, return_index=True)
    q = q[known][index]
    edges = np.arange(len(routine.t) + 1) * routine.dt
    grid = np.union1d(t[(t > edges[0]) & (t < edges[-1])], edges)
    on_grid = np.interp(grid, t, q)
    volume = np.concatenate([[0.0], np.cumsum(np.diff(grid) * (on_grid[1:] + on_grid[:-1]) / 2.0)])
    return np.asarray(np.diff(np.interp(edges, grid, volume)) / routine.dt, dtype=np.float64)


def extent(series: Series, routine: Routine, speed: float, shift: float = 0.0) -> list[Fault]:
    """Return what is wrong with where the measurement begins and ends, and with its holes."""
    x, unit = series.kind.split(",")[0], ("s" if series.kind == "t,q" else "mm")
    scale = 1.0 if unit == "s" else speed
    known = series.x[np.isfinite(series.x) & np.isfinite(series.y)] / scale + shift
    if len(known) < 2:
        raise InputError("has no row with both numbers", source=series.source)
    total = routine.duration
    begin, end = float(known[0]), float(known[-1])
    for factor, name in FACTORS[x].items():
        for times in (factor, 1.0 / factor):
            if 0.85 < (end - begin) * times / total < 1.15:
                return [Fault("scale", f"{x} goes over {(end - begin) * scale:.4g}, and the path over "
                               f"{total * scale:.4g} {unit}: it looks like another unit; say it in the heading, as in "
                               f"`{x} [{name}]`")]  # fmt: skip
    if end - begin > TOO_LONG * total:
        return [Fault("scale", f"{x} goes over {(end - begin) * scale:.4g}, and the path over {total * scale:.4g} "
                       f"{unit}: see to its unit, and cut off what belongs to other measurements")]  # fmt: skip
    faults = []
    if max(abs(begin), abs(end - total)) > HOLE and abs(end - begin - total) < HOLE:
        faults.append(Fault("misaligned", f"covers {x} from {begin * scale:.4g} to {end * scale:.4g} {unit} of 0 to "
                            f"{total * scale:.4g}: as long as the path, so it looks counted from another begin: "
                            f"correct it with --shift {shift - begin:.2f}"))  # fmt: skip
    elif begin > HOLE or end < total - HOLE:
        faults.append(Fault("short", f"covers {x} from {begin * scale:.4g} to {end * scale:.4g} {unit} of 0 to "
                            f"{total * scale:.4g}: measure the rest"))  # fmt: skip
    apart = np.diff(known)
    if (usual := float(np.median(apart))) > HOLE:
        return [*faults, Fault("missing", f"has a row every {usual * scale:.3g} {unit}, and at least one every "
                               f"{HOLE * scale:.3g} {unit} is needed")]  # fmt: skip
    holes = [(known[k], known[k + 1]) for k in np.flatnonzero(apart > HOLE)]
    if holes:
        said = ", ".join(f"{low * scale:.4g} to {high * scale:.4g}" for low, high in itertools.islice(holes, 4))
        more = f" and {len(holes) - 4} more" if len(holes) > 4 else ""
        faults.append(Fault("missing", f"has holes at {x} = {said} {unit}{more}: measure these places, too"))
    return faults


def saturation(series: Series) -> list[Fault]:
    """Return whether the top is flat, and was reached all at once."""
    y = series.y[np.isfinite(series.y)]
    top = float(y.max())
    if top <= 0.0:
        return []
    flat = y >= top * (1.0 - 1e-9)
    flowing = int((y > 0.05 * top).sum())
    levels = np.unique(y)
    grain = float(np.diff(levels).min()) if len(levels) > 1 else 0.0
    change = np.diff(flat.astype(np.int64))
    onto = np.flatnonzero(change > 0)
    runs = np.split(flat, np.flatnonzero(change) + 1)
    long = sum(len(run) for run in runs if run[0] and len(run) >= 3)
    if long < CLIPPED * flowing or not len(onto):
        return []
    if np.median(y[onto + 1] - y[onto]) < max(ABRUPT * top, GRAINS * grain):
        return []
    name = series.kind.split(",")[1]
    return [Fault("saturated", f"is cut off at {name} = {top:.4g} over {long} rows: widen the range of what measures")]


def tallness(series: Series, height: float) -> list[Fault]:
    """Return whether the beads of a nozzle at `height` mm can be as tall as the table says."""
    if series.height is None or not np.isfinite(series.height).any():
        return []
    told = float(np.nanmedian(series.height))
    if height / GAIN < told < height * GAIN or told == 0.0:
        return []
    return [Fault("scale", f"has beads {told:.4g} mm tall, and the nozzle was {height:.4g} mm above the bed: say the "
                   "unit in the heading, as in `height [um]`")]  # fmt: skip


def scale(q: Floats, u: Floats) -> list[Fault]:
    """Return whether so much flowed (mm^3/s, the routine's samples) as no plunger rate u explains."""
    ratio = float(q.sum() / u.sum()) if u.sum() > 0 else np.inf
    if 1.0 / GAIN < ratio < GAIN:
        return []
    if ratio < -1.0 / GAIN:
        return [Fault("scale", f"shows {ratio:.3g} times the volume that was pushed: it flows the wrong way: turn the "
                      "sign of its column")]  # fmt: skip
    if ratio <= 0.01:
        return [
            Fault(
                "scale", f"shows {100 * ratio:.2g} % of the volume that was pushed: see that the extruder pushes at all"
            )
        ]
    for factor, name in ((60.0, "mm^3/min"), (1.0 / 60.0, "ml/min"), (1000.0, "ul/s, or um"), (0.001, "ml/s, or m")):
        if 0.4 < ratio / factor < 2.5:
            return [Fault("scale", f"shows {ratio:.3g} times the volume that was pushed: it looks like {name}; say the "
                           "unit in the heading, as in `q [mm^3/min]`")]  # fmt: skip
    return [Fault("scale", f"shows {ratio:.3g} times the volume that was pushed: see to its unit, and to `height`")]


def resting(q: Floats, u: Floats, dt: float, flow: float) -> tuple[str, ...]:
    """Return a note where a print shows flow before the plunger moves for the first time.

    q and u: mm^3/s, samples of dt s; `flow` is the nominal one, mm^3/s.
    """
    still = q[: int(np.argmax(np.abs(u) > 1e-6 * flow))]
    level = float(np.median(still)) if len(still) * dt > EARLY else 0.0
    if abs(level) < RESTS * flow:
        return ()
    return (f"reads {level:.2g} mm^3/s before the plunger moves: see to the zero of what measures; where it does flow, "
            "start again with a longer --lag",)  # fmt: skip


def delay_of(u: Floats, q: Floats, dt: float) -> float:
    """Return how late the flow comes after the plunger, s, its lag aside; negative: before it."""
    pad = np.zeros(round(SEARCHED / dt))
    found = identify(np.concatenate([u, pad]), np.concatenate([pad, q]), dt, max_delay=2.0 * SEARCHED)
    return found.delay - SEARCHED


def alignment(delay: float, others: list[float], shift: float = 0.0) -> list[Fault]:
    """Return whether a print's `delay` (s) can be its extruder's, beside those of other prints of the session.

    `shift` (s) is what was added to its times already.
    """
    if abs(delay) > FOLLOWS * SEARCHED:
        return [Fault("misaligned", f"does not follow the plunger, {SEARCHED:g} s sooner or later: see that it is this "
                      "trial's, and that its begin is the path's")]  # fmt: skip
    if others and abs(delay - float(np.median(others))) > APART:
        off = delay - float(np.median(others))
        way = "later" if off > 0 else "sooner"
        return [Fault("misaligned", f"comes {abs(off):.2f} s {way} than in the session's other prints: see that it is "
                      "this trial's, and where its begin is, or correct it with --shift "
                      f"{shift - off:.2f}")]  # fmt: skip
    if delay < -EARLY:
        return [Fault("misaligned", f"comes {-delay:.2f} s before the plunger moves: see where its begin is, or "
                      f"correct it with --shift {shift - delay:.2f}")]  # fmt: skip
    if delay > LATEST:
        return [Fault("misaligned", f"comes {delay:.2f} s after the plunger, its lag aside: see where its begin is, or "
                      f"correct it with --shift {shift - delay:.2f}")]  # fmt: skip
    return []
