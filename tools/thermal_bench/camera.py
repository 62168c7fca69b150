"""The camera's cells: are temperatures and registration right, on frames in which the head stands before the part?

    layer 1       its whole recording, from matching points marked with half a pixel of error: temperatures
    layers 2..10  their laying alone, found by themselves one after another: registration
    layer 10      its whole recording: temperatures again

Judged against the simulated surface, which the tracking does not see, at every location and every frame since the
layer was laid, whether the head hid the location then or not. `scanned` is what the window's maximum said before the
cleaning, `seam` the one location over which the ring's end is laid. Registration: where the locations are in the frame
against where they were thought to be, px, the worst layer of all.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.thermal.frames import Frames
from gcodectl.thermal.perspective import fit_perspective
from gcodectl.thermal.register import Registered
from gcodectl.thermal.track import Tracked, locate, track
from plant_models.cooling import CoolingPart, cooling_part
from plant_models.cooling_camera import EMISSIVITY, Camera
from thermal_bench.interval import interval

Cell = dict[str, Any]
PARTS = ("wall", "chassis")
LAYERS = 10
TEMPERATURE, PIXELS = 2.0, 2.0
"""The targets: degC rms, px."""
_COLD = 80.0
"""degC; a location that is scanned as colder has the head before it: no road gets that cold here."""
_SETTLED = 8.0
"""s of frames after a layer is laid, where nothing but its place is asked."""


def camera_cells(seeds: Sequence[int], parts: Sequence[str] = PARTS) -> list[Cell]:
    """Return a cell a part and a seed."""
    return [_cell(part, seed) for part in parts for seed in seeds]


def camera_targets(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """Return the targets' rows: medians over the seeds, their 95 % intervals, and the worst."""
    rows = []
    for part in dict.fromkeys(cell["part"] for cell in cells):
        some = [cell for cell in cells if cell["part"] == part]
        for name, column, unit, target in (
            ("location temperatures, rms", "temperature_rms", "degC", TEMPERATURE),
            ("the same on frames with the head before the part", "occluded_frames_rms", "degC", TEMPERATURE),
            (f"registration over {LAYERS} layers, mean", "registration_px", "px", PIXELS),
        ):
            values = np.array([cell[column] for cell in some])
            rows.append(
                {
                    "name": f"camera, {part}: {name}", "value": float(np.median(values)), "unit": unit,
                    "target": f"<= {target:g}", "met": bool(np.median(values) <= target),
                    "interval": interval(values), "worst": float(values.max()),
                }
            )  # fmt: skip
    return rows


def _cell(name: str, seed: int) -> Cell:
    begun = time.process_time()
    part = cooling_part(name, seed)
    camera = Camera(part)
    reference: Registered | None = None
    perspective, marked = fit_perspective(*camera.matches())
    whole: list[dict[str, float]] = []
    errors: list[float] = []
    spent = 0.0
    for layer in range(LAYERS):
        start = float(part.deposited[0])
        judged = layer in (0, LAYERS - 1)
        end = start + part.setting.layer_time - 1.0 if judged else float(part.deposited[-1]) + _SETTLED
        frames = _held(camera.frames(np.arange(np.floor(start), end)))
        before = time.process_time()
        given = frames, part.road, reference or perspective, part.band, EMISSIVITY
        one = track(*given)[0] if judged else None
        reference = one.registered if one else locate(*given)[0][1]
        spent += time.process_time() - before
        away = reference.perspective.pixels(part.points) - camera.pixels(part.points)
        errors.append(float(np.linalg.norm(away, axis=1).mean()))
        if one:
            whole.append(_judged(one, part))
        part.print_layer(part.at_speed(start + part.setting.layer_time))
    return {
        "part": name, "seed": seed, "marked_rms_px": marked,
        **{key: float(np.mean([one[key] for one in whole])) for key in whole[0]},
        "registration_px": max(errors), "registration_first_px": errors[0], "registration_last_px": errors[-1],
        "track_cpu_s": spent, "cpu_s": time.process_time() - begun,
    }  # fmt: skip


def _judged(one: Tracked, part: CoolingPart) -> dict[str, float]:
    true = part.temperatures(one.times[None, :])
    error = one.temperatures - true
    late = one.times > part.deposited[-1]
    curve = one.surface.at(np.broadcast_to(one.times, true.shape), part.band.ambient) - true
    hidden = ~one.cleaned.kept & np.isfinite(error)
    occluded = error[:, late & (one.raw < _COLD).any(axis=0)]
    return {
        "temperature_rms": _rms(error), "without_seam_rms": _rms(error[1:-1]), "hidden_rms": _rms(error[hidden]),
        "occluded_frames_rms": _rms(occluded), "occluded_frames": float(occluded.shape[1]),
        "curve_rms": _rms(np.where(np.isfinite(error), curve, np.nan)), "bias": float(np.nanmean(error)),
        "scanned_rms": _rms(one.raw[:, late] - true[:, late]), "hidden_share": float(hidden.sum() / hidden.size),
        "lost": float(len(one.cleaned.lost)),
    }  # fmt: skip


def _rms(error: Floats) -> float:
    return float(np.sqrt(np.nanmean(error**2))) if np.isfinite(error).any() else 0.0


def _held(frames: Frames) -> Frames:
    """Return frames that are rendered once: tracking looks at them several times."""
    images = [frames[k] for k in range(len(frames))]
    return Frames(frames.times, frames.names, lambda k: images[k])
