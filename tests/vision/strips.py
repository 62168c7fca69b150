"""A small strip to be photographed in tests: three lanes, thick, thin, interrupted, and its datum road."""

from __future__ import annotations

import functools

import numpy as np

from gcodectl.vision.sheet import Sheet, sheet_around
from plant_models.photo_scene import Scene
from plant_models.photograph import Strip, photograph

NOZZLE = 0.84
SIZE = (1800, 1100)
LIGHT = Scene(
    3, "silicone", "dark glass", shift=(1.8, -1.3, 0.9), tilt=(3.0, -2.0), roll=2.0, radial=(-0.06, 0.01),
    vignetting=0.25, gradient=(0.1, -0.08), texture=0.02, shadow=0.2, shadow_side=70.0, flank=0.05, gloss=0.1, blur=0.9,
    jpeg=92,
)  # fmt: skip
DARK = Scene(
    4, "graphite paste", "paper", shift=(-1.5, 2.1, -0.8), tilt=(-2.0, 3.0), roll=-1.0, radial=(0.03, 0.0),
    vignetting=0.2, gradient=(-0.1, 0.1), texture=0.02, shadow=0.15, shadow_side=200.0, flank=0.05, gloss=0.05,
    blur=0.9, jpeg=92,
)  # fmt: skip


def lanes(count: int = 3, length: float = 60.0, pitch: float = 7.0) -> np.ndarray:
    points: list[tuple[float, float]] = []
    for k in range(count):
        begin, end = (0.0, length) if k % 2 == 0 else (length, 0.0)
        points += [(begin, k * pitch), (end, k * pitch)]
        if k < count - 1:
            side = 1.0 if k % 2 == 0 else -1.0
            for angle in np.linspace(-90, 90, 40)[1:-1]:
                a = np.radians(angle)
                points.append((end + side * pitch / 2 * np.cos(a), (k + 0.5) * pitch + pitch / 2 * np.sin(a)))
    return np.array(points)


@functools.cache
def strip(height: float = 0.0) -> Strip:
    path = lanes()
    s = np.arange(0.0, 205.0, 0.2)
    steps = np.select([s < 20, s < 55, s < 85, s < 100, s < 130, s < 160], [0.0, 1.0, 0.5, 0.0, 1.6, 0.8], 0.3)
    kernel = np.ones(25) / 25
    width = NOZZLE * np.convolve(np.pad(steps, 12, mode="edge"), kernel, mode="valid")
    return Strip(path, s, width, np.array([[-12.0, -6.0], [-12.0, 20.0]]), NOZZLE, height)


@functools.cache
def sheet() -> Sheet:
    one = strip()
    return sheet_around(np.concatenate([one.path, one.datum]), 7.0)


@functools.cache
def picture(scene: Scene, height: float = 0.0, size: tuple[int, int] = SIZE) -> np.ndarray:
    return photograph(strip(height), sheet(), scene, size=size)


def errors(widths, height: float = 0.0) -> np.ndarray:
    """Measured minus true, over the nozzle."""
    one = strip(height)
    return np.asarray((widths.width - np.interp(widths.s, one.s, one.width)) / NOZZLE)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
