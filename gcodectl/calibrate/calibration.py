"""Calibration: what describes a road (attributes), and how its ends were driven (twelve control parameters).

     plunger rate      pushoutspeed                                   path speed
          |    inputaccel .----.                                                  outputaccel .-----------. outputdecel
          |              /|    |\\__inputspeed________ inputdecel                  __________/ outputspeed  \\____
        0 |_____________/ |    |                    \\         ________
          |               |    |       pullbackspeed \\_______/
                        |pushout|                    |pullback|
                        |time   |                    |time    |
                        |<-- acceldelay -->| path sets off   |<-- deceldelay -->| path begins to brake

Every delay counts from the plunger: the path sets off `acceldelay` after the plunger did, and brakes `deceldelay` after
the plunger began to. Units are the house's: the plunger's rates as volume rates, mm^3/s and mm^3/s^2; the path's in
mm/s and mm/s^2; magnitudes, so that what is negative in the paper's table I (OUTPUTDECEL, PULLBACKSPEED) is positive
here. Anything but the material's name may be unknown (None).

Source: Malone and Purwin, "Application of Machine Learning Methods to the Open-Loop Control of a Freeform Fabrication
System", tables I and II. Its Fig. 3, which draws the profile, did not survive: where the delays count from is our
reading.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from typing import Any

from gcodectl.errors import UsageError

LEVELS = ("low", "medium", "high")
NOZZLES = ("needle", "taper")
GRADES = ("very early", "early", "ok", "late", "very late")
GOOD_ENOUGH = ("early", "ok", "late")
"""Grades of a calibration that is learned from, as in the paper; nothing known is taken for ok."""
UNITS = {
    "age": "h", "nozzle_diameter": "mm", "nozzle_length": "mm", "path_width": "mm", "path_height": "mm",
    "acceldelay": "s", "inputaccel": "mm^3/s^2", "pushoutspeed": "mm^3/s", "pushouttime": "s", "inputspeed": "mm^3/s",
    "outputaccel": "mm/s^2", "outputdecel": "mm/s^2", "outputspeed": "mm/s", "deceldelay": "s",
    "inputdecel": "mm^3/s^2", "pullbackspeed": "mm^3/s", "pullbacktime": "s",
}  # fmt: skip
COUNTS = ("phases",)
TEXTS = ("material", "procedure", "tool", "piston")
CHOICES = {
    **dict.fromkeys(("elasticity", "friction", "stability", "clogging", "shrinking", "flowing", "trapped_gas"), LEVELS),
    "nozzle_type": NOZZLES, "start_error": GRADES, "stop_error": GRADES,
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Attributes:
    """Material, its preparation, the tool and the road; None: not known."""

    material: str
    phases: int | None = None
    """How many there are in it: 2 for a powder in a binder."""
    elasticity: str | None = None
    friction: str | None = None
    stability: str | None = None
    clogging: str | None = None
    shrinking: str | None = None
    flowing: str | None = None
    trapped_gas: str | None = None
    age: float | None = None
    """h since it was prepared."""
    procedure: str | None = None
    """How it was prepared."""
    tool: str | None = None
    nozzle_diameter: float | None = None
    nozzle_type: str | None = None
    nozzle_length: float | None = None
    piston: str | None = None
    """What the piston is made of."""
    path_width: float | None = None
    path_height: float | None = None
    start_error: str | None = None
    """How the road began, against the path: very early ... very late."""
    stop_error: str | None = None

    def __post_init__(self) -> None:
        for name in TEXTS:
            value = getattr(self, name)
            if not isinstance(value, str) and (value is not None or name == "material"):
                raise UsageError(f"{name} is {value!r}; it must be a name")
        if not self.material.strip():
            raise UsageError("a calibration needs its material's name")
        for name, allowed in CHOICES.items():
            value = getattr(self, name)
            if value is not None and value not in allowed:
                raise UsageError(f"{name} is {value!r}; it is one of {', '.join(allowed)}")
        _check_numbers(self, least_zero=("age",))

    @property
    def good_enough(self) -> bool:
        """Whether the road was near enough to be learned from."""
        return all(one is None or one in GOOD_ENOUGH for one in (self.start_error, self.stop_error))


@dataclasses.dataclass(frozen=True)
class Parameters:
    """The twelve control parameters; see the top of this file. None: not known."""

    acceldelay: float | None = None
    inputaccel: float | None = None
    pushoutspeed: float | None = None
    pushouttime: float | None = None
    inputspeed: float | None = None
    outputaccel: float | None = None
    outputdecel: float | None = None
    outputspeed: float | None = None
    deceldelay: float | None = None
    inputdecel: float | None = None
    pullbackspeed: float | None = None
    pullbacktime: float | None = None

    def __post_init__(self) -> None:
        _check_numbers(self, least_zero=("pushouttime", "pullbacktime"), any_sign=("acceldelay", "deceldelay"))


@dataclasses.dataclass(frozen=True)
class Calibration:
    """One calibration of one material, and where it comes from."""

    attributes: Attributes
    parameters: Parameters
    source: str = ""
    """A file's name, or whatever tells it from another one of the same numbers."""

    @property
    def material(self) -> str:
        """The material's name, by which it is told from others: `Clay` and `clay` are one."""
        return " ".join(self.attributes.material.lower().split())


ATTRIBUTES = tuple(field.name for field in dataclasses.fields(Attributes))
PARAMETERS = tuple(field.name for field in dataclasses.fields(Parameters))


def from_words(words: Mapping[str, str], source: str = "") -> Calibration:
    """Make a calibration of names and values as a person writes them, units allowed; UsageError says what is wrong."""
    told: dict[str, Any] = {}
    for name, text in words.items():
        if name not in ATTRIBUTES and name not in PARAMETERS:
            raise UsageError(
                f"there is no attribute or parameter {name!r}; there are {', '.join((*ATTRIBUTES, *PARAMETERS))}"
            )
        told[name] = _value(name, text)
    if "material" not in told:
        raise UsageError("which material? give material=NAME")
    attributes = Attributes(**{name: value for name, value in told.items() if name in ATTRIBUTES})
    return Calibration(
        attributes, Parameters(**{name: value for name, value in told.items() if name in PARAMETERS}), source
    )


def _value(name: str, text: str) -> str | int | float:
    text = text.strip()
    if name == "phases":
        if not text.isdigit():
            raise UsageError(f"{name} is {text!r}; it must be a whole number")
        return int(text)
    if name not in UNITS:
        return text.lower().replace("_", " ") if name in CHOICES else text
    found = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)", text)
    if not found:
        raise UsageError(f"{name} is {text!r}; it must be a number of {UNITS[name]}")
    if found[2] not in ("", UNITS[name]):
        raise UsageError(f"{name} is {text!r}; its unit is {UNITS[name]}: please convert")
    return float(found[1])


def _check_numbers(record: Any, *, least_zero: tuple[str, ...] = (), any_sign: tuple[str, ...] = ()) -> None:
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if value is None or (field.name not in UNITS and field.name not in COUNTS):
            continue
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise UsageError(f"{field.name} is {value!r}; it must be a number")
        enough = field.name in any_sign or value > 0 or (value == 0 and field.name in least_zero)
        if not (math.isfinite(value) and enough):
            unit = f" {UNITS[field.name]}" if field.name in UNITS else ""
            wanted = "a number" if field.name in any_sign else "positive"
            raise UsageError(f"{field.name} is {value:g}{unit}; it must be {wanted}")
