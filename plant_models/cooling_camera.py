"""An infrared camera above the simulated surface: what it reads of every pixel, one frame after another.

        [camera]                 pixel = K [r1 r2 r3 t] (x, y, z, 1): a pinhole, so a layer's plane z = n h has the
          \\  \\                           homography K [r1 r2 t + n h r3], which moves from layer to layer
           \\   \\    |head|
            \\    \\  |____|      every layer is a ribbon: its two sides first, then its top, from the lowest upwards
         ____\\__==\\==__\\/___

    radiance   emissivity T^4 + (1 - emissivity) T_env^4, T in K: a grey body that mirrors its surroundings
    a pixel    the mean radiance of its sub-pixels, blurred by the lens; the print head (cold) covers what is behind it
    a reading  (radiance)^(1/4) + noise: what a camera says that takes everything for black, 237 where it is 250 degC

Layers below the top go on cooling as they did (no heat flows between layers); nothing else in view is warm.
Deterministic: the noise of a frame depends on the part's seed, its layer and its time alone. Units: mm, px, s, degC.
"""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats, Ints
from gcodectl.thermal.frames import Frames
from plant_models.cooling import CoolingPart

KELVIN = 273.15
EMISSIVITY = 0.9
NOISE = 0.5
"""Standard deviation of a pixel, degC: ten times that of a microbolometer's data sheet."""
BLUR = 0.5
"""Standard deviation of the lens' blur, px."""
HEAD = (240.0, 240.0, 800.0)
"""Width, depth and height of the print head, mm."""
HEAD_TEMPERATURE = 45.0
CLICK = 0.5
"""Standard deviation of a point that somebody marks in a frame, px."""
_TAPE = 4
"""Frames of noise that are drawn once; every frame takes its own from somewhere in them."""
_SHIFT = 4
"""Binary digits after the point in which polygons are drawn."""


@dataclasses.dataclass(frozen=True)
class View:
    """Where a camera stands and what it is."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    focal: float
    """px"""
    width: int = 640
    height: int = 512
    fine: int = 3
    """Sub-pixels a pixel, each way."""


VIEWS = {
    "wall": View((380.0, -1000.0, 1150.0), (470.0, 85.0, 30.0), 790.0),
    "drifting": View((380.0, -1000.0, 1150.0), (470.0, 85.0, 30.0), 790.0),
    "chassis": View((1800.0, -2600.0, 3900.0), (1960.0, 850.0, 0.0), 1480.0, 1280, 1024, 2),
}
"""A 640 x 512 camera with a 45 degree lens; the chassis, four times as long, has one with twice the pixels each way."""


@dataclasses.dataclass(frozen=True)
class _Scene:
    """What a layer's frames are made of: the sub-pixels in which the part is, and whose they are."""

    pixel: Ints
    """Index of each pixel in which the part is."""
    first: Ints
    """Where its sub-pixels begin in what follows."""
    above: Ints
    """Layer x locations + location that is seen when the layer lies there, -1: nothing."""
    below: Ints
    """The same while it does not."""
    new: Ints
    """Location of the layer itself that is seen, the number of locations where it is not that layer."""


class Camera:
    """The camera of a part."""

    def __init__(self, part: CoolingPart, view: View | None = None) -> None:
        self.part = part
        self.view = view or VIEWS[part.setting.name]
        self._projection = _projection(self.view)
        self._scenes: dict[int, _Scene] = {}
        noise = np.random.default_rng([part.seed, 6]).standard_normal(_TAPE * self.view.width * self.view.height, "f")
        self._tape = np.float32(NOISE) * noise

    def pixels(self, xy: Floats, layer: int = -1, up: float = 1.0) -> Floats:
        """Return where points of a layer are seen, [n, 2] px; `up`: layer heights above its foot (1: its top)."""
        number = layer if layer >= 0 else self.part.layers + layer
        z = np.full(len(xy), (number + up) * self.part.setting.thickness)
        seen = np.column_stack([xy, z, np.ones(len(xy))]) @ self._projection.T
        return np.asarray(seen[:, :2] / seen[:, 2:])

    def matches(self) -> tuple[Floats, Floats]:
        """Return points of the first layer, mm, and where somebody marked them, px: corners and mid-edges."""
        corners = np.array(self.part.setting.outline)
        known = np.concatenate([corners, 0.5 * (corners + np.roll(corners, -1, axis=0))])
        rng = np.random.default_rng([self.part.seed, 4])
        return known, self.pixels(known, 0) + CLICK * rng.standard_normal(known.shape)

    def frames(self, times: Floats) -> Frames:
        """Return the frames of the top layer at `times`, rendered as they are asked for."""
        layer = self.part.layers - 1
        return Frames(
            np.asarray(times, dtype=np.float64), tuple(f"frame {k} ({t:g} s)" for k, t in enumerate(times)),
            lambda k: self.frame(float(times[k]), layer),
        )  # fmt: skip

    def frame(self, t: float, layer: int = -1) -> NDArray[np.float32]:
        """Return the reading at `t` while a layer is the top one, degC [height, width], all taken for black."""
        number = layer if layer >= 0 else self.part.layers + layer
        view, part = self.view, self.part
        scene = self._scene(number)
        temperatures = np.stack([part.temperatures(t, layer=one) for one in range(number + 1)])
        laid = np.isfinite(temperatures[number])
        room = part.band.ambient
        extra = self._radiance(np.append(np.nan_to_num(temperatures, nan=room), room)) - self._ground
        shown = scene.above
        if not laid.all():
            shown = np.where(np.append(laid, True)[scene.new], scene.above, scene.below)
        share = 1.0 / view.fine**2
        image = np.full((view.height, view.width), self._ground, dtype=np.float32)
        image.ravel()[scene.pixel] += (share * np.add.reduceat(extra[shown], scene.first)).astype(np.float32)
        self._cover(image, t, number)
        blurred = cv2.GaussianBlur(image, (0, 0), BLUR)
        reading = np.sqrt(np.sqrt(blurred)) * np.float32(100.0) - np.float32(KELVIN)
        begin = int(
            np.random.default_rng([part.seed, 5, number, round(1000 * t)]).integers(len(self._tape) - image.size)
        )
        return np.asarray(reading + self._tape[begin : begin + image.size].reshape(image.shape), dtype=np.float32)

    @property
    def _ground(self) -> float:
        return float(self._radiance(np.array(self.part.band.ambient)))

    def _radiance(self, temperature: Floats) -> Floats:
        """Return radiance in units of a black body's at 100 K."""
        mirrored = ((self.part.band.ambient + KELVIN) / 100.0) ** 4
        return np.asarray(EMISSIVITY * ((temperature + KELVIN) / 100.0) ** 4 + (1.0 - EMISSIVITY) * mirrored)

    def _cover(self, image: NDArray[np.float32], t: float, number: int) -> None:
        """Draw the print head over what is behind it."""
        at = self.part.head_at(t, number)
        if at is None:
            return
        half = 0.5 * np.array(HEAD[:2])
        corners = np.array([at + half * (i, j) for i in (-1, 1) for j in (-1, 1)])
        foot = self.pixels(corners, number, 5.0)
        tall = self.pixels(corners, number, 5.0 + HEAD[2] / self.part.setting.thickness)
        hull = cv2.convexHull(np.concatenate([foot, tall]).astype(np.float32))
        black = float(self._radiance(np.array(HEAD_TEMPERATURE)))
        cv2.fillConvexPoly(image, np.round(hull * 2**_SHIFT).astype(np.int32), black, shift=_SHIFT)

    def _scene(self, number: int) -> _Scene:
        if number not in self._scenes:
            size = (self.view.height * self.view.fine, self.view.width * self.view.fine)
            below = np.full(size, -1, dtype=np.int32)
            for layer in range(number):
                self._draw(below, layer)
            above = below.copy()
            self._draw(above, number)
            rows, columns = np.nonzero((above >= 0) | (below >= 0))
            pixel = (rows // self.view.fine) * self.view.width + columns // self.view.fine
            order = np.argsort(pixel, kind="stable")
            rows, columns = rows[order], columns[order]
            pixel, first = np.unique(pixel[order], return_index=True)
            shown = above[rows, columns].astype(np.int64)
            count = len(self.part.s)
            new = np.where(shown >= number * count, shown - number * count, count)
            self._scenes = {number: _Scene(pixel, first, shown, below[rows, columns].astype(np.int64), new)}
        return self._scenes[number]

    def _draw(self, image: NDArray[np.int32], layer: int) -> None:
        """Draw a layer's sides and top, every piece of it in the colour of its location."""
        owner, edges = _pieces(self.part)
        count = len(owner)
        foot = self.pixels(edges.reshape(-1, 2), layer, 0.0).reshape(count, 4, 2)
        top = self.pixels(edges.reshape(-1, 2), layer, 1.0).reshape(count, 4, 2)
        left = np.stack([foot[:, 0], foot[:, 1], top[:, 1], top[:, 0]], axis=1)
        right = np.stack([foot[:, 3], foot[:, 2], top[:, 2], top[:, 3]], axis=1)
        first = layer * len(self.part.s)
        for quads in (left, right, top):
            fine = np.round(((quads + 0.5) * self.view.fine - 0.5) * 2**_SHIFT).astype(np.int32)
            for quad, location in zip(fine, owner, strict=True):
                cv2.fillConvexPoly(image, quad, int(first + location), shift=_SHIFT)


def _projection(view: View) -> Floats:
    """Return the 3 x 4 matrix that maps (x, y, z, 1) to a pixel, homogeneous; image rows run downwards."""
    eye, target = np.array(view.eye), np.array(view.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    inside = np.array([[view.focal, 0.0, (view.width - 1) / 2], [0.0, view.focal, (view.height - 1) / 2], [0, 0, 1.0]])
    return np.asarray(inside @ np.column_stack([rotation, -rotation @ eye]))


def _pieces(part: CoolingPart) -> tuple[Ints, Floats]:
    """Return the straight pieces of the road: whose location each is, and its corners, [n, 4, 2] mm.

    Corners: begin left, end left, end right, begin right; edges reach half a bead past the outline's corners.
    """
    half = 0.5 * part.setting.bead
    spacing = part.length / len(part.s)
    owner, quads = [], []
    outline = np.array([*part.setting.outline, part.setting.outline[0]])
    for edge in range(len(outline) - 1):
        begin, end = part.corners[edge], part.corners[edge + 1]
        along = (outline[edge + 1] - outline[edge]) / (end - begin)
        left = half * np.array([-along[1], along[0]])
        first, last = int(begin / spacing + 1e-9), int(np.ceil(end / spacing - 1e-9))
        for location in range(first, last):
            low = max(location * spacing, begin) - begin - (half if location == first else 0.0)
            high = min((location + 1) * spacing, end) - begin + (half if location == last - 1 else 0.0)
            a, b = outline[edge] + low * along, outline[edge] + high * along
            owner.append(location)
            quads.append([a + left, b + left, b - left, a - left])
    return np.array(owner, dtype=np.int64), np.array(quads)
