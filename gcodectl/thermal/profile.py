"""The heat profile: how a material cools on a part, what a new road wants beneath it, what the head may do; TOML.

EXAMPLE has all there is. Only [cooling] b0 and b1 must be there; the rest has the values of CF/PC (Fathizadan 2022,
table 4.1).
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.thermal.surface import Band, Head

EXAMPLE = """\
bead = 20.0                       # optional, mm; how wide a road is, where the slicer does not mark it

[band]                            # degC
low = 120.0                       # colder than this, the new road does not bond
best = 135.0
high = 150.0                      # hotter, the layer sags
ambient = 24.0
deposition = 250.0

[cooling]                         # dT/dt = b0 + b1 (T - ambient)
b0 = 1.007                        # degC/s
b1 = -0.01003                     # 1/s
sigma = 0.9                       # degC; standard error of a prediction
# at = [[0.0, 0.0, 1.1, -0.0099]] # optional: measured places, x y b0 b1; each location takes the nearest

# [cooling.corner]                # optional: other numbers along `reach` mm of path about a turn
# b0 = 1.05
# b1 = -0.0098
# reach = 60.0

# [head]                          # optional, mm/s, mm/s^2; in the filter the file's own speeds stay the most, and
# slowest = 135.0                 # without this half of them is the least
# fastest = 360.0
# accel = 136.0

[objective]                       # partitions' mean (T - best)^2 + time * seconds
time = 1.0
alpha = 0.05                      # share of a layer's locations that may be outside the band
"""
WIDER = 1.4
"""A road is so many times as wide as its nozzle, where nobody says better: what slicers take for pellets."""


@dataclasses.dataclass(frozen=True)
class Corner:
    """How a part cools about its corners."""

    b0: float
    b1: float
    reach: float
    """mm of path on either side of a turn."""


@dataclasses.dataclass(frozen=True)
class HeatProfile:
    """All that is known of a part's heat before it is printed."""

    b0: float
    """degC/s."""
    b1: float
    """1/s, below 0."""
    band: Band = dataclasses.field(default_factory=Band)
    sigma: float = 0.0
    """Standard error of a predicted temperature, degC."""
    corner: Corner | None = None
    at: Floats = dataclasses.field(default_factory=lambda: np.zeros((0, 4)))
    """Measured places, shape (n, 4): x, y (mm), b0, b1."""
    head: Head | None = None
    time: float = 1.0
    """degC^2 that a second is worth."""
    alpha: float = 0.05
    bead: float = 0.0
    """mm; 0: as the slicer marks the first road, else WIDER times the nozzle."""
    name: str = ""

    def __post_init__(self) -> None:
        for where, value in (("sigma", self.sigma), ("time", self.time), ("bead", self.bead)):
            if not (math.isfinite(value) and value >= 0.0):
                raise UsageError(f"{self._called} {where} is {value:g}; it must be 0 or more")
        if not 0.0 < self.alpha < 0.5:
            raise UsageError(f"{self._called} alpha is {self.alpha:g}; it must be above 0 and below 0.5")
        if self.corner is not None and not self.corner.reach > 0.0:
            raise UsageError(f"{self._called} corner reach is {self.corner.reach:g}; it must be above 0 mm")
        if not np.isfinite(self.at).all():
            raise UsageError(f"{self._called} [cooling] at has a place that is no number: x, y, b0 and b1 must be some")
        for where, b0, b1 in self._rates():
            if not (math.isfinite(b0) and math.isfinite(b1) and b1 < 0.0):
                raise UsageError(f"{self._called} {where}: b0 {b0:g}, b1 {b1:g}; b1 must be below 0, or nothing cools")
            rests = self.band.ambient - b0 / b1
            if rests >= self.hottest:
                raise UsageError(
                    f"{self._called} {where}: with b0 {b0:g} and b1 {b1:g} the surface never cools below {rests:.1f} "
                    f"degC, and {self.hottest:.1f} is the most beneath a road: measure b0 and b1 again, or raise high"
                )

    @property
    def hottest(self) -> float:
        """Predicted temperature that is too hot but for a share of alpha, degC."""
        from statistics import NormalDist

        hottest = self.band.high - NormalDist().inv_cdf(1.0 - self.alpha) * self.sigma
        if hottest <= self.band.best:
            raise UsageError(
                f"{self._called} with sigma {self.sigma:g} degC a surface predicted at best ({self.band.best:g} degC) "
                f"is over high ({self.band.high:g}) in more than {self.alpha:g} of all cases: measure better, or widen "
                "the band"
            )
        return hottest

    @property
    def _called(self) -> str:
        return f"heat profile {self.name}:" if self.name else "heat profile:"

    def _rates(self) -> list[tuple[str, float, float]]:
        rates = [("[cooling]", self.b0, self.b1)]
        if self.corner is not None:
            rates.append(("[cooling.corner]", self.corner.b0, self.corner.b1))
        return rates + [(f"[cooling] at X{x:g} Y{y:g}", b0, b1) for x, y, b0, b1 in self.at.tolist()]


_SECTIONS = {
    "band": ("low", "best", "high", "ambient", "deposition"),
    "head": ("slowest", "fastest", "accel"),
    "objective": ("time", "alpha"),
    "cooling": ("b0", "b1", "sigma", "corner", "at"),
}


def load_profile(path: Path) -> HeatProfile:
    """Read a heat profile; UsageError names the file, the key and what to do."""
    if not path.is_file():
        raise UsageError(f"there is no heat profile {path}: write one (gcodectl filter --help), or fit one to frames")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"heat profile {path}: {error}") from error
    return profile_from_table(table, str(path))


def profile_from_table(table: dict[str, Any], name: str) -> HeatProfile:
    """Make a profile of a TOML table; `name` is for messages."""
    for key in table:
        if key != "bead" and key not in _SECTIONS:
            raise UsageError(f"heat profile {name}: no such setting as {key!r}; there are bead, {', '.join(_SECTIONS)}")
    found = {section: _section(table.get(section, {}), section, known, name) for section, known in _SECTIONS.items()}
    cooling = found["cooling"]
    for key in ("b0", "b1"):
        if key not in cooling:
            raise UsageError(f"heat profile {name}: [cooling] has no {key}: fit it (gcodectl thermal fit)")
    try:
        band = Band(**found["band"])
        head = _head(found["head"], name)
    except UsageError as error:
        raise UsageError(f"heat profile {name}: {error}") from error
    bead = _number(table.get("bead", 0.0), "bead", name)
    return HeatProfile(
        band=band, head=head, bead=bead, name=name, **found["objective"],
        **{key: value for key, value in cooling.items() if key not in ("corner", "at")},
        corner=_corner(cooling.get("corner"), name), at=_places(cooling.get("at", []), name),
    )  # fmt: skip


def _section(values: Any, section: str, known: tuple[str, ...], name: str) -> dict[str, Any]:
    if not isinstance(values, dict):
        raise UsageError(f"heat profile {name}: {section} is a section: write [{section}]")
    for key in values:
        if key not in known:
            raise UsageError(f"heat profile {name}: [{section}] has no {key!r}; there are {', '.join(known)}")
    return {
        key: value if key in ("corner", "at") else _number(value, f"[{section}] {key}", name)
        for key, value in values.items()
    }


def _number(value: Any, where: str, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"heat profile {name}: {where} takes a number, not {value!r}")
    return float(value)


def _head(values: dict[str, float], name: str) -> Head | None:
    if values and len(values) < 3:
        raise UsageError(f"heat profile {name}: [head] takes slowest, fastest and accel")
    return Head(**values) if values else None


def _corner(values: Any, name: str) -> Corner | None:
    if values is None:
        return None
    found = _section(values, "cooling.corner", ("b0", "b1", "reach"), name)
    if len(found) < 3:
        raise UsageError(f"heat profile {name}: [cooling.corner] takes b0, b1 and reach")
    return Corner(**found)


def _places(rows: Any, name: str) -> Floats:
    if not isinstance(rows, list) or any(not isinstance(row, list) or len(row) != 4 for row in rows):
        raise UsageError(f"heat profile {name}: [cooling] at takes places of four numbers: x, y, b0, b1")
    return np.array([[_number(one, "[cooling] at", name) for one in row] for row in rows]).reshape(-1, 4)


def profile_text(profile: HeatProfile, comment: str = "") -> str:
    """A profile as TOML, which `load_profile` reads back as the same."""
    rows = [f"# {line}" for line in comment.splitlines()]
    if profile.bead:
        rows.append(f"bead = {profile.bead!r}")
    band = dataclasses.asdict(profile.band)
    rows += ["", "[band]", *(f"{key} = {float(value)!r}" for key, value in band.items())]
    rows += ["", "[cooling]", f"b0 = {profile.b0!r}", f"b1 = {profile.b1!r}", f"sigma = {profile.sigma!r}"]
    if len(profile.at):
        rows += ["at = [", *(f"    [{', '.join(map(repr, row))}]," for row in profile.at.tolist()), "]"]
    if profile.corner is not None:
        rows += ["", "[cooling.corner]", *(f"{k} = {v!r}" for k, v in dataclasses.asdict(profile.corner).items())]
    if profile.head is not None:
        head = dataclasses.asdict(profile.head)
        rows += ["", "[head]", *(f"{key} = {float(value)!r}" for key, value in head.items())]
    rows += ["", "[objective]", f"time = {profile.time!r}", f"alpha = {profile.alpha!r}"]
    return "\n".join(rows).lstrip("\n") + "\n"
