"""Frames: what an infrared camera recorded, as degC, one after another, read as they are asked for.

    folder of images   PNG or TIFF, one channel, in the order of their names;  |
                       `times.txt` in it, a number of s a line, if there is    |  16-bit integers: K = 0.01 n, as
    one TIFF           a page a frame                                          |  most thermal cameras export
    one NPZ            `frames` [n, height, width], `times` [n] if it has any  |  floats: degC as they are

Another 16-bit scale is said with `scale` and `offset` (degC = scale n + offset). Frames come 1 s apart unless their
times are known. What cannot be temperatures of a printer (below -60, above 600 degC) is refused with a guess at the
scale that was meant. A few NaN pixels are filled from their neighbours, and counted; more are refused.
"""

from __future__ import annotations

import dataclasses
import math
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats
from gcodectl.errors import InputError, UsageError

Image = NDArray[np.float32]
"""degC, [height, width]."""
CENTIKELVIN = (0.01, -273.15)
_SCALES = {
    "centi-kelvin": CENTIKELVIN,
    "K / 0.04": (0.04, -273.15),
    "K x 10": (0.1, -273.15),
    "K": (1.0, -273.15),
    "degC x 100": (0.01, 0.0),
    "degC x 10": (0.1, 0.0),
    "degC": (1.0, 0.0),
}
"""Scales that are found in the field."""
PLAUSIBLE = (-60.0, 600.0)
MOST_NAN = 0.01
"""Share of a frame's pixels that may be NaN."""
SUFFIXES = (".png", ".tif", ".tiff")


@dataclasses.dataclass
class Frames:
    """A recording; `frames[k]` is frame k in degC, checked. `mended` counts the NaN pixels filled, by frame name."""

    times: Floats
    """s, rising."""
    names: tuple[str, ...]
    """What a frame is called in a message."""
    read: Callable[[int], NDArray[Any]]
    shape: tuple[int, int] = (0, 0)
    """Height and width; that of the first frame where it is not given."""
    mended: dict[str, int] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if not len(self.times):
            raise InputError("there is no frame to read")
        if len(self.times) != len(self.names):
            raise InputError(f"there are {len(self.names)} frames, but {len(self.times)} times; give each frame one")
        wrong = np.flatnonzero(~(np.diff(self.times) > 0))
        if not np.isfinite(self.times).all() or len(wrong):
            k = int(wrong[0]) + 1 if len(wrong) else int(np.flatnonzero(~np.isfinite(self.times))[0])
            before = f" after {self.times[k - 1]:g} s" if k else ""
            raise InputError(
                f"its time is {self.times[k]:g} s{before}: times must rise; sort the frames, or mend their times",
                source=self.names[k],
            )

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, k: int) -> Image:
        image = np.asarray(self.read(k))
        name = self.names[k]
        if image.ndim != 2:
            raise InputError(
                "this is a colour picture: colours are no temperatures; export radiometric frames, 16 bits a pixel",
                source=name,
            )
        if self.shape == (0, 0):
            self.shape = (image.shape[0], image.shape[1])
        if image.shape != self.shape:
            raise InputError(
                f"it is {image.shape[1]} x {image.shape[0]} pixels, the frames before {self.shape[1]} x "
                f"{self.shape[0]}; all must be of one size, from one camera that stood still",
                source=name,
            )
        return self._mend(image.astype(np.float32, copy=False), name)

    def part(self, rows: slice) -> Frames:
        """Return some of the frames."""
        numbers = range(len(self))[rows]
        return Frames(self.times[rows], self.names[rows], lambda k: self.read(numbers[k]), self.shape, self.mended)

    def _mend(self, image: Image, name: str) -> Image:
        """Fill a few NaN pixels with the mean of their neighbours; refuse many."""
        bad = ~np.isfinite(image)
        count = int(np.count_nonzero(bad))
        if not count:
            return image
        if count > MOST_NAN * image.size:
            raise InputError(
                f"{count} of {image.size} pixels ({100 * count / image.size:.1f} %) are no numbers; up to "
                f"{100 * MOST_NAN:g} % are filled in, more is a fault: leave the frame out, or export it again",
                source=name,
            )
        self.mended[name] = count
        return filled(image, bad)


def filled(image: Image, bad: NDArray[np.bool_]) -> Image:
    """Return the image with its bad pixels replaced by the mean of the good ones around them, nearest first."""
    import cv2

    good = (~bad).astype(np.float32)
    values = np.where(bad, np.float32(0), image)
    size = 3
    while not good.all():
        weight = cv2.blur(good, (size, size), borderType=cv2.BORDER_CONSTANT)
        total = cv2.blur(values, (size, size), borderType=cv2.BORDER_CONSTANT)
        found = (good == 0) & (weight > 1e-6)
        values = np.where(found, total / np.maximum(weight, np.float32(1e-6)), values)
        good = np.where(found, np.float32(1), good)
        size += 2
    return np.asarray(values, dtype=np.float32)


def read_frames(
    path: Path, *, times: Floats | None = None, scale: float | None = None, offset: float | None = None
) -> Frames:
    """Return the recording in a folder of images, a TIFF, a PNG or an NPZ; raises InputError that names the frame.

    `scale` and `offset`: of 16-bit frames, degC = scale n + offset; None: centi-kelvin.
    """
    if (scale is None) != (offset is None):
        raise UsageError("the scale of 16-bit frames takes both numbers: degC = scale n + offset")
    if not path.exists():
        raise InputError("there is no such file or folder", source=str(path))
    if path.suffix.lower() == ".npz":
        stack, found = _npz(path)
        names = tuple(f"{path}, frame {k}" for k in range(len(stack)))
        times = found if times is None else times
        read: Callable[[int], NDArray[Any]] = lambda k: stack[k]  # noqa: E731
    elif path.is_dir():
        files = sorted(one for one in path.iterdir() if one.suffix.lower() in SUFFIXES)
        if not files:
            raise InputError(f"there is no frame in it: no file ends in {', '.join(SUFFIXES)}", source=str(path))
        names = tuple(str(one) for one in files)
        read = lambda k: _image(files[k])  # noqa: E731
        times = _times(path / "times.txt") if times is None else times
    else:
        pages = _pages(path)
        names = tuple(f"{path}, page {k + 1}" for k in range(pages))
        read = lambda k: _image(path, k)  # noqa: E731
    when = np.arange(len(names), dtype=np.float64) if times is None else np.asarray(times, dtype=np.float64)
    frames = Frames(when, names, lambda k: _degrees(read(k), names[k], scale, offset))
    frames[0]
    return frames


def _times(path: Path) -> Floats | None:
    """Return the times in a file that need not be there."""
    if not path.exists():
        return None
    found = []
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), start=1):
        try:
            found.append(float(line))
        except ValueError:
            raise InputError(
                "a line has one number, the time of a frame in s", line=number, text=line, source=str(path)
            ) from None
    return np.array(found)


def _npz(path: Path) -> tuple[NDArray[Any], Floats | None]:
    try:
        with np.load(path, allow_pickle=False) as file:
            if "frames" not in file:
                raise InputError(
                    f"it has no array `frames`, only {', '.join(file.files) or 'nothing'}", source=str(path)
                )
            stack, times = file["frames"], file.get("times")
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"it cannot be read as NPZ ({error}); write it with numpy.savez", source=str(path)) from error
    if stack.ndim != 3:
        raise InputError(f"`frames` must be [frames, height, width], not {stack.shape}", source=str(path))
    return stack, times


def _pages(path: Path) -> int:
    import cv2

    count = int(cv2.imcount(str(path), cv2.IMREAD_UNCHANGED)) if path.stat().st_size else 0
    if count < 1:
        raise _unreadable(path)
    return count


def _image(path: Path, page: int = 0) -> NDArray[Any]:
    """Return an image as it is in the file."""
    import cv2

    try:
        if path.suffix.lower() == ".png":
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        else:
            _, pages = cv2.imreadmulti(str(path), page, 1, flags=cv2.IMREAD_UNCHANGED)
            image = pages[0] if pages else None
    except cv2.error as error:
        raise _unreadable(path) from error
    if image is None:
        raise _unreadable(path)
    return np.asarray(image)


def _unreadable(path: Path) -> InputError:
    return InputError(
        "it cannot be read as an image: it is damaged, cut short, or neither PNG nor TIFF", source=str(path)
    )


def _degrees(image: NDArray[Any], name: str, scale: float | None, offset: float | None) -> NDArray[Any]:
    """Return an image in degC; raises InputError where that cannot be temperatures of a printer."""
    if image.ndim != 2:
        return image
    if image.dtype == np.uint8:
        raise InputError(
            "it has 8 bits a pixel: that is a picture, not temperatures; export 16 bits or floats", source=name
        )
    whole = np.issubdtype(image.dtype, np.integer)
    factor, shift = (scale, offset) if scale is not None and offset is not None else CENTIKELVIN if whole else (1, 0)
    degrees = image.astype(np.float32) * np.float32(factor) + np.float32(shift)
    known = degrees[np.isfinite(degrees)]
    low, high = (float(known.min()), float(known.max())) if known.size else (math.nan, math.nan)
    if known.size and not (low >= PLAUSIBLE[0] and high <= PLAUSIBLE[1]):
        raise InputError(f"it would be {low:.0f} to {high:.0f} degC; {_guess(image, whole)}", source=name)
    return degrees


def _guess(image: NDArray[Any], whole: bool) -> str:
    """Say which scales would make sense of an image: a room's temperature for its coldest pixel, a part's at most."""
    known = image[np.isfinite(image)].astype(np.float64)
    low, high = float(known.min()), float(known.max())
    fits = [
        f"{what} (scale {scale:g}, offset {offset:g})"
        for what, (scale, offset) in _SCALES.items()
        if -20.0 <= low * scale + offset <= 60.0 and high * scale + offset <= 400.0
    ]
    assumed = "16-bit frames are taken for centi-kelvin" if whole else "floats are taken for degC"
    return f"{assumed}: say which scale and offset they have" + (f", perhaps {' or '.join(fits)}" if fits else "")
