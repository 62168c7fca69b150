"""The parts that the simulated surface comes in: their outline, their published settings, how they cool on average.

    wall      start 0 ------------ 36 in ------------ 1      chassis   a 154 x 80 in outline with bevelled corners;
                    |                               | 8 in             then a box and two ribs inside it, whose ends
                    3 ------------------------------2                  run along the outline: there it is heated again

    drifting  the wall of chapter 3: deposited at 260 degC, b0 = 1.007, b1 = -0.01003, 260 s, and cooling ever faster

Published (tables 3.1, 3.2, 4.1, 4.2): sizes, temperatures, speeds, acceleration, layer times, bead. Not published, and
so set here: how the wall and the chassis of chapter 4 cool. The wall's law is that which has its published window
(it lies between 120 and 150 degC for print times of 143 to 204 s) and is some 20 K too cold at 250 s, as its published
objective tells; the chassis' is that of the measured hexagon, which has the published optimum near 95 s.
The later segments of the chassis are laid at the head's fastest: laid slower, no layer could take less than 126 s.
Source: Fathizadan, dissertation (Arizona State University, 2022), chapters 3 and 4. Units: mm, s, degC.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType

from gcodectl.errors import UsageError
from gcodectl.thermal.surface import Band, Head

INCH = 25.4
MINUTE = 60.0
Points = tuple[tuple[float, float], ...]


@dataclasses.dataclass(frozen=True)
class Setting:
    """A part and how it is printed."""

    name: str
    outline: Points
    """Corners of the closed outline in the order of printing, mm; the first is where it starts and ends."""
    b0: float
    """degC/s, of a plain stretch in the first layer."""
    b1: float
    """1/s."""
    layer_time: float
    """The fixed policy's, s from start to start."""
    trend: float
    """Change of log(-b1) from layer to layer."""
    walk: float
    """Standard deviation of its random step from layer to layer."""
    pivot: float
    """Temperature above ambient at which drift leaves the cooling rate alone, K: b0 moves by -pivot times b1's move."""
    later: Points = ()
    """What the head does after the outline, mm; it need not be seen by the camera."""
    later_speed: float = 535 * INCH / MINUTE
    contact: float = 0.0
    """Share of the way to the deposition temperature that a touching later segment heats the outline."""
    speed: float = 535 * INCH / MINUTE
    band: Band = dataclasses.field(default_factory=Band)
    head: Head = dataclasses.field(default_factory=lambda: Head(320 * INCH / MINUTE, 850 * INCH / MINUTE, 5.35 * INCH))
    bead: float = 0.8 * INCH
    """Bead width, and the distance between locations."""
    thickness: float = 0.2 * INCH


def _inches(*corners: tuple[float, float]) -> Points:
    return tuple((x * INCH, y * INCH) for x, y in corners)


_WALL = _inches((0, 8), (36, 8), (36, 0), (0, 0))
_SECOND = _inches((36, -19), (36, -27), (0, -27), (0, -19), (36, -19))
"""The other wall, printed after this one and nearer to the camera, which looks past it: only the head is in the way."""
_CHASSIS = _inches((10, 0), (0, 10), (0, 70), (10, 80), (144, 80), (154, 70), (154, 10), (144, 0))
_RIB = 0.7
"""Inches from the outline's centre line to a rib's that runs along it: the beads touch."""
_INSIDE = _inches(
    (47, 25), (47, 55), (107, 55), (107, 25), (107, 55), (122, 80 - _RIB), (134, 80 - _RIB), (107, 25), (47, 25),
    (66, _RIB), (54, _RIB), (47, 25),
)  # fmt: skip

SETTINGS: Mapping[str, Setting] = MappingProxyType(
    {
        one.name: one
        for one in (
            Setting("wall", _WALL, 0.383, -0.0066, 250.0, -0.003, 0.004, 150.0, later=_SECOND),
            Setting(
                "chassis", _CHASSIS, 1.12, -0.0150, 126.0, -0.003, 0.004, 150.0, later=_INSIDE,
                later_speed=850 * INCH / MINUTE, contact=0.3,
            ),
            Setting(
                "drifting", _WALL, 1.00700, -0.01003, 260.0, -0.03, 0.006, 170.0, later=_SECOND,
                band=Band(deposition=260.0), speed=227.0,
            ),
        )
    }
)  # fmt: skip


def setting_of(name: str) -> Setting:
    """Return a stock part's setting; UsageError that lists what there is."""
    if name not in SETTINGS:
        raise UsageError(f"there is no part {name!r}; there are {', '.join(SETTINGS)}")
    return SETTINGS[name]
