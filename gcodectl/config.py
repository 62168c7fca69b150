"""Machine: what can be asked of the printer; frozen, validated once, read from TOML, some of them built in."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from gcodectl.errors import UsageError

DIALECTS = ("marlin", "klipper", "reprapfirmware")


@dataclasses.dataclass(frozen=True)
class Machine:
    """Limits and geometry of one printer. Lengths mm, speeds mm/s, accelerations mm/s^2, jerk mm/s^3, flows mm^3/s."""

    name: str
    dialect: str = "marlin"
    """Whose G-code it speaks: marlin, klipper or reprapfirmware."""
    barrel_diameter: float = 15.8
    """Inner diameter of the syringe barrel, or the filament's diameter: what the E axis pushes."""
    nozzle: float = 0.84
    """Nozzle diameter."""
    max_speed: tuple[float, float, float] = (200.0, 200.0, 20.0)
    """Fastest each of X, Y, Z may move."""
    accel: float = 500.0
    """Acceleration along the path while extruding."""
    travel_accel: float = 500.0
    z_accel: float = 100.0
    jerk: float = 20_000.0
    """Jerk along the path; firmware has none, so what is asked of it is only as smooth as this."""
    corner_speed: float = 5.0
    """Square corner velocity: the speed at which a 90 degree corner may be taken."""
    e_accel: float = 500.0
    """Acceleration of the E axis alone."""
    max_flow: float = 25.0
    """The most the plunger can move, either way, as a volume rate."""
    max_flow_slew: float = 2_000.0
    """How fast that rate may change, mm^3/s^2."""
    max_lines_per_second: float = 100.0
    """The most lines of G-code a second of motion may cost."""
    switch_dwell: float = 1.0
    """Seconds the head takes to bring another material's nozzle into place."""

    def __post_init__(self) -> None:
        if self.dialect not in DIALECTS:
            raise UsageError(f"machine {self.name!r}: dialect {self.dialect!r} is none of {', '.join(DIALECTS)}")
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            for number in value if isinstance(value, tuple) else (value,):
                wrong = not isinstance(number, str) and not (math.isfinite(number) and number >= 0)
                if wrong or (number == 0 and field.name not in ("corner_speed", "switch_dwell")):
                    raise UsageError(f"machine {self.name!r}: {field.name} is {number}; it must be a positive number")

    @property
    def area(self) -> float:
        """Cross-section that E pushes, mm^2."""
        return math.pi * self.barrel_diameter**2 / 4


def machine_names() -> tuple[str, ...]:
    """Names of the built-in machine profiles."""
    folder = resources.files("gcodectl") / "data" / "machines"
    return tuple(sorted(Path(str(entry)).stem for entry in folder.iterdir() if entry.name.endswith(".toml")))


def load_machine(name: str) -> Machine:
    """Return the built-in machine called `name`, or the one that the TOML file at that path describes.

    Raises UsageError where there is none, or where the file has a key or value it should not have.
    """
    path = Path(name)
    if path.suffix == ".toml":
        if not path.is_file():
            raise UsageError(f"there is no machine profile {name}")
        text, known_as = path.read_bytes(), path.stem
    elif name in machine_names():
        entry = resources.files("gcodectl") / "data" / "machines" / f"{name}.toml"
        text, known_as = entry.read_bytes(), name
    else:
        raise UsageError(
            f"there is no machine {name!r}; built in: {', '.join(machine_names())}, or give a path to a .toml file"
        )
    try:
        table = tomllib.loads(text.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"machine profile {name}: {error}") from error
    return machine_from_table({"name": known_as, **table})


def machine_from_table(table: dict[str, Any]) -> Machine:
    """Make a Machine of a TOML table; raises UsageError on a key or a type that does not belong."""
    fields = {field.name: field for field in dataclasses.fields(Machine)}
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in fields:
            raise UsageError(f"machine {table['name']!r}: no such setting as {key!r}; there are {', '.join(fields)}")
        default = fields[key].default
        if isinstance(default, tuple):
            numbers = isinstance(value, list) and all(type(number) in (int, float) for number in value)
            if not numbers or len(value) != len(default):
                raise UsageError(f"machine {table['name']!r}: {key} takes {len(default)} numbers")
            values[key] = tuple(float(number) for number in value)
        elif isinstance(default, float):
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise UsageError(f"machine {table['name']!r}: {key} takes a number, not {value!r}")
            values[key] = float(value)
        else:
            values[key] = str(value)
    return Machine(**values)
