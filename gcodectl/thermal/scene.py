"""The scene: what a camera's recording is of, which no frame says; TOML, as EXAMPLE has it."""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.thermal.perspective import Perspective, fit_perspective
from gcodectl.thermal.road import Road

EXAMPLE = """\
bead = 20.3                                # mm; how wide the road is
path = [[0.0, 0.0], [914.4, 0.0]]          # mm; corners of a layer's tool path, in the order of printing, in the
                                           # coordinates of the G-code; a ring ends where it began
matches = [[0.0, 0.0, 212.5, 340.0]]       # x, y (mm) and column, row (px): four points or more of the first
                                           # layer, marked by hand in one frame
emissivity = 0.9                           # optional; 1: the camera corrects for it
scale = 0.04                               # optional: degC = scale n + offset for 16-bit frames; without, n is
offset = -273.15                           # in hundredths of a kelvin
"""
FAR = 5.0
"""px; matching points that fit worse than that were marked wrongly."""


@dataclasses.dataclass(frozen=True)
class Scene:
    """What is seen, and from where."""

    bead: float
    path: Floats
    """Shape (n, 2), mm."""
    matches: Floats
    """Shape (n, 4): mm, px."""
    emissivity: float = 1.0
    scale: float | None = None
    offset: float | None = None
    name: str = ""

    def road(self) -> Road:
        """The locations along the path."""
        return Road.along(self.path, self.bead)

    def perspective(self) -> Perspective:
        """The perspective of the first layer."""
        found, left = fit_perspective(self.matches[:, :2], self.matches[:, 2:])
        if left > FAR:
            raise UsageError(
                f"scene {self.name}: no camera sees these matches, they are {left:.1f} px off (rms): check that x, y "
                "are mm on the part, and column and row not exchanged"
            )
        return found


def load_scene(path: Path) -> Scene:
    """Read a scene; UsageError names the file, the key and what to do."""
    if not path.is_file():
        raise UsageError(f"there is no scene {path}: write one, as gcodectl thermal example --scene prints it")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"scene {path}: {error}") from error
    known = [field.name for field in dataclasses.fields(Scene) if field.name != "name"]
    for key in table:
        if key not in known:
            raise UsageError(f"scene {path}: no such setting as {key!r}; there are {', '.join(known)}")
    for key in ("bead", "path", "matches"):
        if key not in table:
            raise UsageError(f"scene {path}: it has no {key}, see gcodectl thermal example --scene")
    numbers = {key: _number(table[key], key, path) for key in ("bead", "emissivity", "scale", "offset") if key in table}
    if not 0.0 < numbers.get("emissivity", 1.0) <= 1.0:
        raise UsageError(
            f"scene {path}: emissivity is {numbers['emissivity']:g}; it must be above 0, and 1 at the most"
        )
    if not numbers["bead"] > 0.0:
        raise UsageError(f"scene {path}: bead is {numbers['bead']:g}; it must be above 0 mm")
    path_of, matches = _rows(table["path"], 2, "path", path), _rows(table["matches"], 4, "matches", path)
    return Scene(path=path_of, matches=matches, name=str(path), **numbers)


def _number(value: Any, key: str, path: Path) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"scene {path}: {key} takes a number, not {value!r}")
    return float(value)


def _rows(rows: Any, width: int, key: str, path: Path) -> Floats:
    if not isinstance(rows, list) or any(not isinstance(row, list) or len(row) != width for row in rows):
        raise UsageError(f"scene {path}: {key} takes rows of {width} numbers")
    return np.array([[_number(one, key, path) for one in row] for row in rows]).reshape(-1, width)


def scene_text(scene: Scene) -> str:
    """A scene as TOML, which `load_scene` reads back as the same."""
    rows = [f"bead = {float(scene.bead)!r}"]
    for key in ("path", "matches"):
        rows += [f"{key} = [", *(f"    [{', '.join(map(repr, row))}]," for row in getattr(scene, key).tolist()), "]"]
    for key in ("emissivity", "scale", "offset"):
        if (value := getattr(scene, key)) is not None:
            rows.append(f"{key} = {float(value)!r}")
    return "\n".join(rows) + "\n"
