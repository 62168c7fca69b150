"""The simulated photograph: what a camera sees of a strip that was laid on the bed, and of the sheet around it.

    widths along the path --> outline, mm --> sheet's frame --> camera --> polygons, px --> shares of every pixel
                              its far side seen further out                                        |
    8 bits <- gamma <- noise <- blur <- light x (ground or paper, texture, shadow | material, flanks, highlights)

A bead is half an ellipse: seen from `m` mm aside for every mm above, its far side reaches out to sqrt(a^2 + (h m)^2)
where it touches the ground at a. Thin beads are as much lower. All polygons are painted with the exact shares of the
pixels that they cover, in the picture itself; nothing is rectified, sampled along a path, or known to the one who
measures but the sheet's markers. All is linear light until the camera's curve (sRGB).
"""

from __future__ import annotations

import dataclasses
import itertools

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.vision.sheet import Sheet
from plant_models.photo_canvas import Canvas, Plane, covered
from plant_models.photo_scene import GROUNDS, MATERIALS, Scene

SIZE = (4000, 3000)
"""px, width and height: a phone's."""
PAPER, INK = 0.85, 0.04
_BANDS = 16
"""Across the bead, each of its own shade."""
_EMPTY = 1e-3
"""Of the nominal width, below which there is nothing."""
_MARGIN = 0.03
"""Of the picture, that is left around what is looked at."""


@dataclasses.dataclass(frozen=True)
class Strip:
    """What was laid: a strip of varying width along a path, and a steady datum road beside it; mm."""

    path: Floats
    """[n, 2]"""
    s: Floats
    """Places along the path, [k], rising."""
    width: Floats
    """[k]"""
    datum: Floats
    """[2, 2]"""
    nominal: float
    """Width of the datum road."""
    height: float = 0.0
    """Of the bead at its nominal width; 0: flat, as ink is."""

    def __post_init__(self) -> None:
        if len(self.s) != len(self.width) or len(self.s) < 2 or not np.all(np.diff(self.s) > 0):
            raise UsageError("a strip takes two places along its path at least, rising, and a width at each")
        if not (np.isfinite(self.width).all() and self.width.min() >= 0 and self.nominal > 0 and self.height >= 0):
            raise UsageError("a strip's widths must be numbers and not negative, its nominal width positive")


def photograph(
    strip: Strip, sheet: Sheet, scene: Scene, *, size: tuple[int, int] = SIZE, looking_at: Floats | None = None
) -> NDArray[np.uint8]:
    """Return the photograph of a strip, [height, width, 3], blue, green, red.

    `looking_at`: lower left and upper right corner of the bed's part that fills the picture (None: the whole sheet).
    """
    eye = _Eye(scene, size, np.stack(sheet.paper) if looking_at is None else looking_at)
    rng = np.random.default_rng([scene.seed, 12])
    pieces = [piece for outline in _outlines(strip, sheet, scene, eye) for piece in outline.pieces]
    bead = covered(*size, [eye.pixels(np.concatenate([one.left, one.right[::-1]])) for one in pieces])
    shade = _shade(pieces, eye, scene, rng)
    paper, ink = _paper(sheet, eye)
    ground = np.array(GROUNDS[scene.ground], dtype=np.float32)
    seen = np.empty((size[1], size[0], 3), dtype=np.float32)
    own = _texture(size, scene.texture, rng)
    bottom = own * (1.0 - np.float32(scene.shadow) * _cast(bead, pieces, eye, scene))
    for channel, colour in enumerate(MATERIALS[scene.material]):
        flat = (1.0 - paper) * ground[channel] + paper * np.float32(PAPER) * (1.0 - ink) + paper * ink * np.float32(INK)
        seen[:, :, channel] = flat * bottom * (1.0 - bead) + bead * np.float32(colour) * shade * own
    seen += (bead * _highlights(pieces, eye, scene, rng))[:, :, None]
    seen *= (scene.exposure / PAPER * _light(size, scene))[:, :, None]
    return _taken(seen, scene, rng)


class _Eye:
    """The camera: bed (on the sheet's frame) to pixels."""

    def __init__(self, scene: Scene, size: tuple[int, int], looking_at: Floats) -> None:
        self.size, self.scene = size, scene
        self.focal = scene.focal * float(np.hypot(*size))
        low, high = looking_at
        self._middle = 0.5 * (low + high)
        down = Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))
        turn = Rotation.from_euler("xyz", [*scene.tilt, scene.roll], degrees=True) * down
        self._turn = np.asarray(turn.as_matrix())
        corners = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])])
        near, far = 0.0, 100.0 * float(np.max(high - low))
        for _ in range(60):
            self._away = 0.5 * (near + far)
            inside = np.abs(self.pixels(corners) / np.array(size) - 0.5).max() <= 0.5 - _MARGIN
            near, far = (near, self._away) if inside and self._before(corners) else (self._away, far)

    @property
    def position(self) -> Floats:
        """Where it stands, mm."""
        return np.asarray(np.append(self._middle, 0.0) - self._away * self._turn[2])

    def pixels(self, xy: Floats) -> Floats:
        """Return where points are seen, [n, 2]."""
        at = self._camera(xy)
        x, y = at[:, 0] / at[:, 2], at[:, 1] / at[:, 2]
        r2 = x * x + y * y
        grown = self.focal * (1.0 + self.scene.radial[0] * r2 + self.scene.radial[1] * r2 * r2)
        return np.column_stack([x * grown + (self.size[0] - 1) / 2, y * grown + (self.size[1] - 1) / 2])

    def per_mm(self) -> float:
        """Return pixels a mm in the middle."""
        return self.focal / self._away

    def _camera(self, xy: Floats) -> Floats:
        flat = np.column_stack([xy - self._middle, np.zeros(len(xy))])
        return np.asarray(flat @ self._turn.T + [0.0, 0.0, self._away])

    def _before(self, xy: Floats) -> bool:
        return bool(np.all(self._camera(xy)[:, 2] > 0.2 * self._away))


@dataclasses.dataclass(frozen=True)
class _Piece:
    """An unbroken run of the strip: its edges as seen, mm on the sheet."""

    left: Floats
    right: Floats

    def between(self, low: float, high: float) -> Floats:
        """Return the polygon from share `low` to `high` of the way from left to right."""
        across = self.right - self.left
        return np.concatenate([self.left + low * across, (self.left + high * across)[::-1]])


@dataclasses.dataclass(frozen=True)
class _Outline:
    """A road's outline."""

    pieces: list[_Piece]


def _outlines(strip: Strip, sheet: Sheet, scene: Scene, eye: _Eye) -> list[_Outline]:
    """Return the strip's and the datum road's outlines on the sheet."""
    steps = np.linalg.norm(np.diff(strip.path, axis=0), axis=1)
    at = np.append(0.0, np.cumsum(steps))
    s = np.unique(np.concatenate([strip.s, at[(at > strip.s[0]) & (at < strip.s[-1])]]))
    line = np.column_stack([np.interp(s, at, strip.path[:, axis]) for axis in (0, 1)])
    width = np.interp(s, strip.s, strip.width)
    datum = strip.datum[0] + np.linspace(0.0, 1.0, 50)[:, None] * (strip.datum[1] - strip.datum[0])
    roads = ((line, width), (datum, np.full(50, strip.nominal)))
    return [_outline(_on_sheet(points, sheet, scene), wide, strip, eye) for points, wide in roads]


def _on_sheet(points: Floats, sheet: Sheet, scene: Scene) -> Floats:
    middle = 0.5 * (np.asarray(sheet.low) + sheet.high)
    angle = np.radians(scene.shift[2])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.asarray((points - middle) @ turn.T + middle + scene.shift[:2])


def _outline(points: Floats, width: Floats, strip: Strip, eye: _Eye) -> _Outline:
    along = np.gradient(points, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None]
    left = np.column_stack([-along[:, 1], along[:, 0]])
    foot = 0.5 * width
    tall = strip.height * np.minimum(1.0, width / strip.nominal)
    position = eye.position
    slope = np.sum((points - position[:2]) * left, axis=1) / position[2]
    far = np.sqrt(foot**2 + (tall * slope) ** 2)
    one = points + np.where(slope > 0, far, foot)[:, None] * left
    other = points - np.where(slope < 0, far, foot)[:, None] * left
    there = np.append(np.append(False, width > _EMPTY * strip.nominal), False)
    begin, end = np.flatnonzero(there[1:] & ~there[:-1]), np.flatnonzero(there[:-1] & ~there[1:])
    return _Outline([_Piece(one[a:b], other[a:b]) for a, b in zip(begin, end, strict=True) if b - a > 1])


def _shade(pieces: list[_Piece], eye: _Eye, scene: Scene, rng: np.random.Generator) -> Plane:
    """Return the light that the material gives back by where it is across the bead, 1 on its top."""
    canvas = Canvas(*eye.size)
    top = 1.0 + scene.flank
    lit = float(rng.uniform(-1.0, 1.0))
    edges = np.linspace(-0.5, 1.0, _BANDS + 9)
    for begin, end in itertools.pairwise(edges):
        u = float(np.clip(begin + end - 1.0, -1.0, 1.0))
        level = 1.0 - scene.flank * (u**4 - 0.5 * lit * u**3)
        canvas.paint([eye.pixels(one.between(begin, 1.5)) for one in pieces], level / top)
    return np.asarray(canvas.plane * np.float32(top))


def _highlights(pieces: list[_Piece], eye: _Eye, scene: Scene, rng: np.random.Generator) -> Plane:
    """Return the light of highlights: dashes along the bead, where its side mirrors a lamp."""
    canvas = Canvas(*eye.size)
    place = float(rng.uniform(0.3, 0.7))
    thick = float(rng.uniform(0.03, 0.1))
    for piece in pieces:
        begin = 0
        while begin + 2 < len(piece.left):
            end = begin + int(rng.integers(3, 60))
            dash = _Piece(piece.left[begin:end], piece.right[begin:end])
            canvas.paint([eye.pixels(dash.between(place - thick, place + thick))], float(rng.uniform(0.0, 1.0)))
            begin = end + int(rng.integers(3, 120))
    return np.asarray(cv2.GaussianBlur(canvas.plane, (0, 0), 1.0) * np.float32(scene.gloss))


def _cast(bead: Plane, pieces: list[_Piece], eye: _Eye, scene: Scene) -> Plane:
    """Return how much of the shadow falls on each pixel, 0 to 1."""
    wide = np.median(np.concatenate([np.linalg.norm(one.left - one.right, axis=1) for one in pieces]))
    reach = 0.35 * float(wide) * eye.per_mm()
    angle = np.radians(scene.shadow_side)
    move = np.array([[1.0, 0.0, reach * np.cos(angle)], [0.0, 1.0, reach * np.sin(angle)]])
    return np.asarray(cv2.GaussianBlur(cv2.warpAffine(bead, move, eye.size), (0, 0), max(0.5 * reach, 0.5)))


def _paper(sheet: Sheet, eye: _Eye) -> tuple[Plane, Plane]:
    """Return the shares of paper and of ink."""
    low, high = sheet.paper
    paper = covered(*eye.size, [eye.pixels(_rectangle(low, high))])
    paper -= covered(*eye.size, [eye.pixels(_rectangle(np.array(sheet.low), np.array(sheet.high)))])
    corners = sheet.corners
    black = []
    for number, square in enumerate(corners):
        bits = sheet.bits(number)
        cell = sheet.marker / len(bits)
        for row, column in zip(*np.nonzero(bits == 0), strict=True):
            x, y = square[0, 0] + column * cell, square[0, 1] - row * cell
            black.append(eye.pixels(np.array([[x, y - cell], [x + cell, y - cell], [x + cell, y], [x, y]])))
    return paper, covered(*eye.size, black)


def _rectangle(low: Floats, high: Floats) -> Floats:
    """Return a rectangle's outline with points along its sides: a lens bends them."""
    t = np.linspace(0.0, 1.0, 40)[:, None]
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    return np.concatenate([a + t * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])


def _texture(size: tuple[int, int], deviation: float, rng: np.random.Generator) -> Plane:
    """Return a surface's grain: a third each of 2, 8 and 40 px, mean 1."""
    total = np.zeros((size[1], size[0]), dtype=np.float32)
    for grain in (2, 8, 40):
        coarse = rng.standard_normal((size[1] // grain + 2, size[0] // grain + 2), dtype=np.float32)
        total += cv2.resize(coarse, size, interpolation=cv2.INTER_LINEAR)
    return np.asarray(np.maximum(1.0 + deviation / max(float(total.std()), 1e-9) * total, 0.0))


def _light(size: tuple[int, int], scene: Scene) -> Plane:
    """Return the light that falls on each pixel and comes through the lens, 1 in the middle."""
    x = np.linspace(-1.0, 1.0, size[0], dtype=np.float32)[None, :]
    y = np.linspace(-1.0, 1.0, size[1], dtype=np.float32)[:, None]
    falls = 1.0 + np.float32(scene.gradient[0]) * x + np.float32(scene.gradient[1]) * y
    r2 = (x * x * size[0] ** 2 + y * y * size[1] ** 2) / float(size[0] ** 2 + size[1] ** 2)
    return np.asarray(falls * (1.0 - np.float32(scene.vignetting) * r2))


def _taken(seen: NDArray[np.float32], scene: Scene, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return what the camera makes of the light."""
    seen = np.asarray(cv2.GaussianBlur(seen, (0, 0), scene.blur), dtype=np.float32)
    grain = rng.standard_normal(seen.shape, dtype=np.float32)
    seen = np.clip(seen + np.float32(scene.noise) * np.sqrt(np.maximum(seen, 0.0) + 1e-3) * grain, 0.0, 1.0)
    curve = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * np.maximum(seen, 1e-6) ** (1 / 2.4) - 0.055)
    image = np.round(255.0 * curve).astype(np.uint8)
    if scene.jpeg:
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, scene.jpeg])
        image = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)
    return image
