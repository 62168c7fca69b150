"""Machine: what can be asked of the printer; frozen, validated once, read from TOML, some of them built in.

Beside the printer's own limits stand its firmware's: what the E axis may do in one move and at a junction, and what a
line may ask at all. A setting of 0 there means: as the firmware ships (`FIRMWARE`).
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from gcodectl.errors import UsageError


@dataclasses.dataclass(frozen=True)
class ELimits:
    """What a firmware lets the E axis do, mm and s of E; inf where it sets no limit.

    Sources: Klipper klippy/kinematics/extruder.py (check_move, calc_junction); Marlin Configuration.h,
    Configuration_adv.h and planner.cpp (_populate_block); RepRapFirmware Configuration.h and DDA.cpp.
    """

    corner_speed: float
    """Step of E's speed at a junction (Klipper: instantaneous_corner_velocity; Marlin: M205 E; others: M566)."""
    max_speed: float
    """Klipper: max_extrude_only_velocity; Marlin and RepRapFirmware: M203 E."""
    max_accel: float
    """Of E while the head moves too (Marlin, RepRapFirmware: M201 E; Klipper has none)."""
    longest: float
    """The most one line may move E (Klipper: max_extrude_only_distance; Marlin: EXTRUDE_MAXLENGTH)."""
    max_bead: float
    """Largest cross-section of a line, mm^2 (Klipper: max_extrude_cross_section)."""
    alone: bool
    """max_speed and longest hold only where E moves alone or back (Klipper)."""
    least_steps: int
    """A line of fewer steps on every axis is merged with the next (Marlin: MIN_STEPS_PER_SEGMENT)."""


_INF = math.inf
FIRMWARE = {
    "klipper": ELimits(1.0, 0.0, _INF, 50.0, 0.0, alone=True, least_steps=0),
    "marlin": ELimits(5.0, 25.0, 10_000.0, 200.0, _INF, alone=False, least_steps=6),
    "reprapfirmware": ELimits(5.0, 100.0, 500.0, _INF, _INF, alone=False, least_steps=1),
}
"""As each ships; 0: by the machine's geometry (`Machine.e_limits`)."""
DIALECTS = ("marlin", "klipper", "reprapfirmware")
MAY_BE_ZERO = (
    "corner_speed", "switch_dwell", "e_corner_speed", "e_max_speed", "e_max_accel", "e_longest", "max_bead",
)  # fmt: skip


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
    """Acceleration of the E axis alone (Klipper: max_extrude_only_accel; Marlin: M204 R)."""
    e_corner_speed: float = 0.0
    """Step of E's speed that the firmware allows at a junction; 0 here and below: as the firmware ships."""
    e_max_speed: float = 0.0
    """Fastest the firmware moves E."""
    e_max_accel: float = 0.0
    """Hardest the firmware speeds E up while the head moves."""
    e_longest: float = 0.0
    """The most E that the firmware takes in one line, mm."""
    max_bead: float = 0.0
    """Largest cross-section that the firmware lets a line lay, mm^2."""
    steps_per_mm: tuple[float, float, float] = (80.0, 80.0, 400.0)
    """Motor steps of X, Y, Z; lines of too few steps are merged by some firmware."""
    e_steps_per_mm: float = 500.0
    max_flow: float = 25.0
    """The most the plunger can move, either way, as a volume rate."""
    max_flow_slew: float = 2_000.0
    """How fast that rate may change, mm^3/s^2."""
    max_lines_per_second: float = 100.0
    """The most lines of G-code a second of motion may cost."""
    switch_dwell: float = 1.0
    """Seconds the head takes to bring another material's nozzle into place."""
    bed: tuple[float, float, float, float] = (0.0, 0.0, 200.0, 200.0)
    """Where the nozzle may print: least X and Y, most X and Y, mm; below zero where the origin is the bed's middle."""

    def __post_init__(self) -> None:
        if self.dialect not in DIALECTS:
            raise UsageError(f"machine {self.name!r}: dialect {self.dialect!r} is none of {', '.join(DIALECTS)}")
        x0, y0, x1, y1 = self.bed
        if not (all(map(math.isfinite, self.bed)) and x0 < x1 and y0 < y1):
            raise UsageError(
                f"machine {self.name!r}: bed is {list(self.bed)}; write it as [least x, y, most x, y] in mm"
            )
        for field in dataclasses.fields(self):
            if field.name == "bed":
                continue
            value = getattr(self, field.name)
            for number in value if isinstance(value, tuple) else (value,):
                wrong = not isinstance(number, str) and not (math.isfinite(number) and number >= 0)
                if wrong or (number == 0 and field.name not in MAY_BE_ZERO):
                    raise UsageError(f"machine {self.name!r}: {field.name} is {number}; it must be a positive number")

    @property
    def area(self) -> float:
        """Cross-section that E pushes, mm^2."""
        return math.pi * self.barrel_diameter**2 / 4

    @property
    def e_limits(self) -> ELimits:
        """What the firmware lets E do: the profile's own numbers, else as it ships.

        Klipper derives what printer.cfg leaves out from the nozzle: beads of 4 nozzle^2, and E as fast as the fastest
        head lays such a bead.
        """
        stock = FIRMWARE[self.dialect]
        thickest = 4.0 * self.nozzle**2
        return dataclasses.replace(
            stock,
            corner_speed=self.e_corner_speed or stock.corner_speed,
            max_speed=self.e_max_speed or stock.max_speed or max(self.max_speed[:2]) * thickest / self.area,
            max_accel=self.e_max_accel or stock.max_accel,
            longest=self.e_longest or stock.longest,
            max_bead=self.max_bead or stock.max_bead or thickest,
        )

    @property
    def followed_slew(self) -> float:
        """How fast the plunger's rate may change, mm^3/s^2, so that firmware does not slow down for E's steps."""
        return min(self.max_flow_slew, self.e_limits.corner_speed * self.area * self.max_lines_per_second)

    @property
    def carried_flow(self) -> float:
        """The most that lines carry however slowly the head moves, mm^3/s (Klipper: what it takes as tiny, in each)."""
        return self.most_at_once * self.max_lines_per_second

    @property
    def most_at_once(self) -> float:
        """Volume that the firmware lays within any path at all, however short, mm^3 (Klipper: nozzle x max bead)."""
        return self.nozzle * self.e_limits.max_bead


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
