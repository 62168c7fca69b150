"""Photographs: read, checked, and turned into light.

A camera writes sRGB: what it stores is not the light, but near its root. A blurred edge stands in its middle in light
only, so all that is measured is measured in light, 0 to 1. Colours stand as OpenCV has them: blue, green, red.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gcodectl.errors import InputError

Photo = NDArray[np.uint8]
"""[height, width] or [height, width, 3]."""
Light = NDArray[np.float32]
"""[height, width, 3], 0 to 1."""
LEAST_SIDE = 200
"""px"""
_CODES = np.arange(256) / 255.0
SRGB = np.where(_CODES <= 0.04045, _CODES / 12.92, ((_CODES + 0.055) / 1.055) ** 2.4).astype(np.float32)
"""Light by code (IEC 61966-2-1)."""


def read_photograph(path: Path) -> Photo:
    """Return a photograph, [height, width, 3]; raises InputError where it cannot be read as one."""
    import cv2

    if not path.is_file():
        raise InputError("there is no such photograph", source=str(path))
    try:
        image = cv2.imdecode(np.fromfile(path, dtype=np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:  # an empty file
        image = None
    if image is None:
        raise InputError("it is not an image that can be read; give a PNG, JPEG or TIFF", source=str(path))
    return np.asarray(image, dtype=np.uint8)


def write_photograph(path: Path, image: Photo) -> None:
    """Write an image in the format that its suffix names; raises InputError where there is none such."""
    import cv2

    try:
        written, data = cv2.imencode(path.suffix, image)
    except cv2.error as error:
        raise InputError("an image is written as .png, .jpg or .tif", source=str(path)) from error
    assert written, "an image of bytes can be encoded"
    path.write_bytes(data.tobytes())


def checked(image: Photo, name: str) -> Photo:
    """Return an image as [height, width, 3]; raises InputError, named after `name`, where it cannot be a photograph."""
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise InputError(
            f"an image of {image.dtype} and shape {image.shape} is no photograph; give 8 bits, grey or three colours",
            source=name,
        )
    if min(image.shape[:2]) < LEAST_SIDE:
        raise InputError(
            f"it is {image.shape[1]} x {image.shape[0]} px, too small to measure a road in; give the photograph as the "
            "camera took it",
            source=name,
        )
    return image if image.ndim == 3 else np.repeat(image[:, :, None], 3, axis=2)


def light(image: Photo) -> Light:
    """Return the light of an image, [height, width, 3]."""
    import cv2

    return np.asarray(cv2.LUT(image, SRGB))
