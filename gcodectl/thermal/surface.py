"""What heat is told in: the band a new road wants beneath it, and how each location along the path cools.

    T |\\                          dT/dt = b0 + b1 (T - T_env),  b1 < 0
      | \\                         T(t) = T_inf + (T0 - T_inf) exp(b1 (t - t0)),  T_inf = T_env - b0 / b1
      |  '\\.
    T_high -----'-.__ - - - - -   too hot: the new layer sags
    T_best .........''--.__...
    T_low  - - - - - - - - -''--  too cold: it does not bond
      +--------------------------- t
      t0 (T0)

Source: Fathizadan, dissertation (Arizona State University, 2022), eq. (3.1), (3.2), (4.10), (4.12); band of table 3.1.
Units: degC, s, and for `s` any one unit of length (mm in the product; the published plans are in pixels).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Columns, Floats, column
from gcodectl.errors import UsageError


@dataclasses.dataclass(frozen=True)
class Band:
    """Temperatures that a new road wants beneath it, and those between which everything cools; degC. Default: CF/PC."""

    low: float = 120.0
    best: float = 135.0
    high: float = 150.0
    ambient: float = 24.0
    deposition: float = 250.0

    def __post_init__(self) -> None:
        if not self.ambient < self.low < self.best < self.high < self.deposition:
            raise UsageError(
                "temperatures must rise from ambient over low, best and high to deposition, not "
                f"{self.ambient:g}, {self.low:g}, {self.best:g}, {self.high:g}, {self.deposition:g} degC"
            )


@dataclasses.dataclass(frozen=True)
class Head:
    """What the print head can do along the path: speeds (length/s) and acceleration (length/s^2)."""

    slowest: float
    fastest: float
    accel: float

    def __post_init__(self) -> None:
        if not (0.0 < self.slowest <= self.fastest and self.accel > 0.0):
            raise UsageError(
                f"a head's speeds must rise from above 0, its acceleration be above 0, not {self.slowest:g}, "
                f"{self.fastest:g}, {self.accel:g}"
            )


@dataclasses.dataclass(frozen=True)
class Surface(Columns):
    """One row a location of the surface, in the order in which the path passes them."""

    s: Floats = column(np.float64)
    """Where along the path, never falling."""
    b0: Floats = column(np.float64)
    """degC/s."""
    b1: Floats = column(np.float64)
    """1/s, below 0."""
    t0: Floats = column(np.float64)
    """When the location was last known (as a rule when it was last deposited), s on the plan's clock."""
    temp0: Floats = column(np.float64)
    """Its temperature then, degC."""

    def at(self, t: Floats, ambient: float) -> Floats:
        """Temperature of each location at its own time, degC; times before t0 are taken as t0.

        `t`: s, one a location, or locations x times.
        """
        age = np.asarray(t, dtype=np.float64)
        extra = (slice(None),) + (None,) * (age.ndim - 1)
        age = np.maximum(age - self.t0[extra], 0.0)
        return temperature(age, self.b0[extra], self.b1[extra], ambient, self.temp0[extra])


def temperature(age: Floats, b0: Floats, b1: Floats, ambient: float, deposition: Floats | float) -> Floats:
    """How hot a location is `age` s after its deposition, degC; eq. (3.2)."""
    rest = ambient - b0 / b1
    return np.asarray(rest + (deposition - rest) * np.exp(b1 * age))


def seconds_to(theta: float, b0: Floats, b1: Floats, ambient: float, deposition: float) -> Floats:
    """How long a location takes from its deposition to `theta`, s; it must come to rest below that."""
    rest = ambient - b0 / b1
    return np.asarray(np.log((theta - rest) / (deposition - rest)) / b1)
