"""Rectification: where a point of the bed is in a photograph, from the sheet's markers.

    bed (x, y, 0) -- R, t --> (X, Y, Z) --> (X, Y) / Z = n -- 1 + k1 r^2 + k2 r^4 --> d -- f, c --> pixel

One least-squares fit of focal length f, middle c, pose R, t and radial distortion k1, k2 to all corners that are seen.
A flat sheet seen straight from above says little of f and c, so each comes with what is known beforehand: f near 0.65
diagonals (a phone's 24 to 28 mm), c near the image's middle; they matter only where the corners leave them open. The
pose tells where the camera stood, and so how much of a bead's side it saw.

1. Markers are found, their corners to a fraction of a pixel (OpenCV).
2. A homography gives the first pose; Levenberg-Marquardt the rest.
3. Markers that are far off (a crease, a wrong number) are left out, and it is fitted once more.

Source: Zhang, "A Flexible New Technique for Camera Calibration" (2000); Brown's radial terms.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from gcodectl.columns import Floats, Ints
from gcodectl.errors import InputError
from gcodectl.vision.photo import SRGB, Photo
from gcodectl.vision.sheet import CELLS, Sheet, dictionary

LEAST_MARKERS = 6
MOST_RMS = 0.02
"""Rms of the corners that is allowed, in marker sides."""
FOCAL = 0.65
"""Diagonals."""
_CORNER = 0.3
"""px; how well a corner is found, against what is known beforehand:"""
_KNOWN = np.array([0.3, 0.05, 0.05, 0.3, 0.3])
"""log f, c (diagonals), k1, k2: standard deviations."""
_WINDOW = 0.7
"""Of a cell, to each side of a corner, that its place is found from."""
_FAR = 5.0
"""Robust deviations beyond which a marker is left out."""


@dataclasses.dataclass(frozen=True)
class Camera:
    """Where points of the bed are in one photograph."""

    focal: float
    """px"""
    middle: Floats
    """px, [2]"""
    turn: Floats
    """3 x 3; from the bed's axes to the camera's."""
    move: Floats
    """mm, [3]"""
    radial: tuple[float, float]
    rms: float = 0.0
    """px, of the corners."""
    markers: int = 0
    """Seen and fitted."""

    @property
    def position(self) -> Floats:
        """Where the camera stood, bed coordinates, mm, [3]."""
        return np.asarray(-self.turn.T @ self.move)

    def pixels(self, xy: Floats) -> Floats:
        """Return the pixels (column, row) of points of the bed, [..., 2]."""
        seen = xy @ self.turn[:, :2].T + self.move
        plain = seen[..., :2] / seen[..., 2:]
        square = np.sum(plain**2, axis=-1, keepdims=True)
        k1, k2 = self.radial
        return np.asarray(self.focal * plain * (1.0 + square * (k1 + square * k2)) + self.middle)


def find_camera(image: Photo, sheet: Sheet, name: str) -> Camera:
    """Return the camera of a photograph; raises InputError, named after `name`, where the sheet does not tell."""
    ids, pixels = _markers(image)
    known = sheet.corners
    good = ids < len(known)
    ids, pixels = ids[good], pixels[good]
    if len(ids) < LEAST_MARKERS:
        raise InputError(
            f"{len(ids) or 'none'} of the sheet's {len(known)} markers can be read, and it takes {LEAST_MARKERS}; is "
            "it the right sheet, is it in the picture, in focus and evenly lit?",
            source=name,
        )
    bed = known[ids]
    spread = np.linalg.svd(bed.mean(axis=1) - bed.mean(axis=(0, 1)), compute_uv=False)
    if spread[1] < 0.02 * spread[0]:
        raise InputError("the markers that can be read stand in one row; show those of two sides at least", source=name)
    camera = _fitted(bed, pixels, image.shape[:2])
    rest = np.linalg.norm(camera.pixels(bed) - pixels, axis=2).max(axis=1)
    kept = rest <= max(_FAR * 1.4826 * float(np.median(rest)), 3.0 * _CORNER)
    if not kept.all() and kept.sum() >= LEAST_MARKERS:
        camera = _fitted(bed[kept], pixels[kept], image.shape[:2])
    side = float(np.median(np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2)))
    if not camera.rms <= max(MOST_RMS * side, 1.5 * _CORNER):
        raise InputError(
            f"the markers are {camera.rms:.1f} px (rms) from where a flat sheet's would be; lay the sheet flat, and "
            "give the photograph as the camera took it",
            source=name,
        )
    return camera


def _markers(image: Photo) -> tuple[Ints, Floats]:
    """Return the numbers of the markers seen, [m], and their corners, [m, 4, 2] px."""
    import cv2

    settings = cv2.aruco.DetectorParameters()
    settings.minMarkerPerimeterRate = 0.02
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary(), settings).detectMarkers(grey)
    if ids is None or not len(ids):
        return np.empty(0, dtype=np.int64), np.empty((0, 4, 2))
    numbers, first = np.unique(np.ravel(ids), return_index=True)
    found = np.array([corners[k] for k in first], dtype=np.float32)[:, 0]
    lit = cv2.LUT(grey, SRGB)  # in what is stored, a blurred edge stands on its dark side
    until = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 0.005)
    for square in found:
        side = float(np.mean(np.linalg.norm(square - np.roll(square, 1, axis=0), axis=1)))
        window = int(np.clip(_WINDOW * side / CELLS, 2, 20))
        cv2.cornerSubPix(lit, square, (window, window), (-1, -1), until)
    return np.asarray(numbers, dtype=np.int64), found.astype(np.float64)


def _fitted(bed: Floats, pixels: Floats, shape: tuple[int, ...]) -> Camera:
    """Return the camera that brings corners, [m, 4, 2], nearest to the pixels they were found at."""
    diagonal = float(np.hypot(shape[0], shape[1]))
    middle = 0.5 * (np.array([shape[1], shape[0]], dtype=np.float64) - 1.0)
    flat, seen = bed.reshape(-1, 2), pixels.reshape(-1, 2)
    turn, move = _first_pose(flat, seen, FOCAL * diagonal, middle)

    def camera(p: Floats) -> Camera:
        return Camera(
            FOCAL * diagonal * float(np.exp(p[0])), middle + diagonal * p[1:3],
            np.asarray(Rotation.from_rotvec(p[5:8]).as_matrix()), np.asarray(p[8:11] * move[2]),
            (float(p[3]), float(p[4])),
        )  # fmt: skip

    def rest(p: Floats) -> Floats:
        return np.concatenate([(camera(p).pixels(flat) - seen).ravel() / _CORNER, p[:5] / _KNOWN])

    begin = np.concatenate([np.zeros(5), Rotation.from_matrix(turn).as_rotvec(), move / move[2]])
    found = least_squares(rest, begin, method="lm", x_scale="jac", max_nfev=2000)
    fitted = camera(np.asarray(found.x))
    rms = float(np.sqrt(np.mean(np.sum((fitted.pixels(flat) - seen) ** 2, axis=1))))
    return dataclasses.replace(fitted, rms=rms, markers=len(bed))


def _first_pose(flat: Floats, seen: Floats, focal: float, middle: Floats) -> tuple[Floats, Floats]:
    """Return R and t of a camera without distortion."""
    import cv2

    matrix, _ = cv2.findHomography(flat, (seen - middle) / focal, 0)
    columns = np.asarray(matrix / np.sqrt(np.linalg.norm(matrix[:, 0]) * np.linalg.norm(matrix[:, 1])))
    columns = columns * np.sign(columns[2] @ [*flat.mean(axis=0), 1.0])
    u, _, vt = np.linalg.svd(np.column_stack([columns[:, :2], np.cross(columns[:, 0], columns[:, 1])]))
    return np.asarray(u @ vt), np.asarray(columns[:, 2])
