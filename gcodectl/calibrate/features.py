"""Attributes as numbers, and parameters as targets: what the learners see.

Attributes. Lengths enter by their logarithms, age as log(1 + h), levels (low, medium, high) as 0, 1/2, 1, kinds
(nozzle, piston, procedure, tool) as one column a kind. A material's name says something of it too: each word that at
least two known materials share (`silicone`, `epoxy`) is a column; a name as a whole is none, as it could only recall.
What is not known is set to the known ones' mean, and what is the same everywhere is left out.

Targets. Everything that is a scale is learned as its logarithm, two of them after what is known of them is divided out:

    inputspeed   / (outputspeed path_width path_height)      fill: 1 where the road gets its own volume
    times        + 0.01 s, so that none at all has a logarithm
    acceldelay   / pushouttime,   deceldelay / pullbacktime  as shares (these two are no scales, and stay as they are)

Source: Malone and Purwin, table II, and its normalisation by the range for k-NN.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from gcodectl.calibrate.calibration import CHOICES, GRADES, LEVELS, PARAMETERS, Attributes, Calibration, Parameters
from gcodectl.columns import Floats

LENGTHS = ("nozzle_diameter", "nozzle_length", "path_width", "path_height")
LEVELLED = tuple(name for name, choice in CHOICES.items() if choice is LEVELS)
KINDS = ("nozzle_type", "piston", "procedure", "tool")
SHARES = {"acceldelay": "pushouttime", "deceldelay": "pullbacktime"}
TIMES = ("pushouttime", "pullbacktime")
SHORT = 0.01
"""s; added to a time before its logarithm is taken."""
assert set(CHOICES) == {*LEVELLED, "nozzle_type"} | {name for name, choice in CHOICES.items() if choice is GRADES}


@dataclasses.dataclass(frozen=True)
class Features:
    """Columns that were made for some calibrations, to put others into."""

    columns: tuple[tuple[str, Callable[[Attributes], float]], ...]
    middle: Floats
    """What an unknown value is taken for, one a column."""

    @property
    def names(self) -> tuple[str, ...]:
        """What the columns are."""
        return tuple(name for name, _ in self.columns)

    def of(self, attributes: Sequence[Attributes]) -> Floats:
        """Return [calibration, column]; never NaN."""
        found = _filled(self.columns, attributes)
        return np.where(np.isnan(found), self.middle, found)


def make_features(known: Sequence[Attributes]) -> Features:
    """Return the columns in which the known ones differ."""
    columns: list[tuple[str, Callable[[Attributes], float]]] = [
        (name, _logged(name)) for name in LENGTHS
    ]  # fmt: skip
    columns += [("age", _aged), ("phases", _number("phases"))]
    columns += [(name, _levelled(name)) for name in LEVELLED]
    for name in KINDS:
        columns += [
            (f"{name}={kind}", _kind(name, kind)) for kind in sorted({getattr(one, name) for one in known} - {None})
        ]
    materials = {one.material for one in known}
    shared = Counter(word for name in materials for word in set(_words(name)))
    columns += [(f"word={word}", _worded(word)) for word, times in sorted(shared.items()) if 1 < times < len(materials)]
    found = _filled(columns, known)
    kept = [k for k in range(len(columns)) if len(set(found[:, k][~np.isnan(found[:, k])])) > 1]
    return Features(tuple(columns[k] for k in kept), np.nanmean(found[:, kept], axis=0))


def targets(known: Sequence[Calibration]) -> dict[str, Floats]:
    """Return what is learned of each parameter, one a calibration, NaN where it is not known."""
    return {name: np.array([coded(name, one.attributes, one.parameters) for one in known]) for name in PARAMETERS}


def coded(name: str, attributes: Attributes, parameters: Parameters) -> float:
    """Return a parameter as it is learned; NaN where it, or what it is measured by, is not known."""
    value = getattr(parameters, name)
    if value is None:
        return math.nan
    if name in SHARES:
        time = getattr(parameters, SHARES[name])
        return float(value / time) if time else math.nan
    if name in TIMES:
        return math.log(value + SHORT)
    if name == "inputspeed":
        asked = asked_flow(attributes, parameters.outputspeed)
        return math.log(value / asked) if asked else math.nan
    return math.log(value)


def decoded(values: dict[str, float], attributes: Attributes) -> Parameters:
    """Return the parameters that were learned as `values`; what is missing, or cannot be scaled, stays unknown."""
    found: dict[str, float] = {}
    for name, value in values.items():
        if name in SHARES or name == "inputspeed":
            continue
        found[name] = max(math.exp(value) - SHORT, 0.0) if name in TIMES else math.exp(value)
    asked = asked_flow(attributes, found.get("outputspeed"))
    if asked and "inputspeed" in values:
        found["inputspeed"] = asked * math.exp(values["inputspeed"])
    for name, time in SHARES.items():
        if name in values and time in found:
            found[name] = values[name] * found[time]
    return Parameters(**found)


def asked_flow(attributes: Attributes, speed: float | None) -> float | None:
    """Return the flow that such a road asks for at a speed (mm/s), mm^3/s; None where that is not known."""
    if speed is None or attributes.path_width is None or attributes.path_height is None:
        return None
    return speed * attributes.path_width * attributes.path_height


def _filled(columns: Sequence[tuple[str, Callable[[Attributes], float]]], known: Sequence[Attributes]) -> Floats:
    return np.array([[value(one) for _, value in columns] for one in known], dtype=np.float64).reshape(len(known), -1)


def _words(name: str) -> list[str]:
    return name.lower().replace("_", " ").replace("-", " ").split()


def _number(name: str) -> Callable[[Attributes], float]:
    def value(one: Attributes) -> float:
        found = getattr(one, name)
        return math.nan if found is None else float(found)

    return value


def _logged(name: str) -> Callable[[Attributes], float]:
    plain = _number(name)
    return lambda one: math.log(plain(one))


def _aged(one: Attributes) -> float:
    return math.nan if one.age is None else math.log1p(one.age)


def _levelled(name: str) -> Callable[[Attributes], float]:
    def value(one: Attributes) -> float:
        level = getattr(one, name)
        return math.nan if level is None else LEVELS.index(level) / (len(LEVELS) - 1)

    return value


def _kind(name: str, kind: str) -> Callable[[Attributes], float]:
    def value(one: Attributes) -> float:
        found = getattr(one, name)
        return math.nan if found is None else float(found == kind)

    return value


def _worded(word: str) -> Callable[[Attributes], float]:
    return lambda one: float(word in _words(one.material))
