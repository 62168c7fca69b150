"""Recordings of the simulated camera, in the forms that `gcodectl thermal` reads: 16-bit centi-kelvin, or floats."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from gcodectl.errors import UsageError
from gcodectl.thermal.frames import CENTIKELVIN, Frames


def write_frames(frames: Frames, path: Path) -> None:
    """Write frames to `path`: `.npz` (floats, with times), `.tiff` (a page a frame), no suffix: a folder of PNGs.

    Raises UsageError for another suffix.
    """
    scale, offset = CENTIKELVIN
    if path.suffix == ".npz":
        np.savez_compressed(path, frames=np.stack([frames[k] for k in range(len(frames))]), times=frames.times)
        return
    counts = [
        np.clip(np.round((frames[k].astype(np.float64) - offset) / scale), 0, 65535).astype(np.uint16)
        for k in range(len(frames))
    ]
    if path.suffix in (".tif", ".tiff"):
        cv2.imwritemulti(str(path), counts)
    elif not path.suffix:
        path.mkdir(parents=True, exist_ok=True)
        for k, image in enumerate(counts):
            cv2.imwrite(str(path / f"frame_{k:05d}.png"), image)
        (path / "times.txt").write_text("".join(f"{t:.6g}\n" for t in frames.times))
    else:
        raise UsageError(f"frames are written as .npz, .tiff or to a folder, not as {path.suffix}")
