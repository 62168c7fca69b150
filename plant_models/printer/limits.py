"""What a firmware's settings let one block do: its highest speed and its acceleration, one block at a time.

The same rules as `plant_models.gantry`, which applies them to a whole file at once; here the settings change as M201,
M203, M204 and M205 come in. Units: mm, s.
"""

from __future__ import annotations

import math

from gcodectl.config import Machine
from plant_models.gantry import Firmware

_CORNER = math.sin(math.pi / 4) / (1 - math.sin(math.pi / 4))


class Limits:
    """The motion settings in force; they begin as the machine's."""

    def __init__(self, machine: Machine, firmware: Firmware) -> None:
        e = machine.e_limits
        self.max_speed = list(machine.max_speed)
        self.accel, self.travel_accel, self.z_accel = machine.accel, machine.travel_accel, machine.z_accel
        self.accel_cap = math.inf
        """M201: the smaller of X and Y."""
        self.corner_speed = machine.corner_speed
        self.e_corner_speed = e.corner_speed if firmware.instant_e_speed is None else firmware.instant_e_speed
        self.max_flow = machine.max_flow
        self.e_speed, self.e_accel, self.e_alone_accel = e.max_speed, e.max_accel, machine.e_accel
        self.only_alone = e.alone
        """E's limits hold only where it moves alone or back (Klipper)."""

    def of_path(
        self, dx: float, dy: float, dz: float, path: float, e: float, feed: float, area: float
    ) -> tuple[float, float]:
        """Return the highest speed and the acceleration along a path; `area` is what E pushes, mm^2."""
        speed, most = feed, self.max_speed
        tilt = abs(dz) / path
        if dx:
            speed = min(speed, most[0] * path / abs(dx))
        if dy:
            speed = min(speed, most[1] * path / abs(dy))
        if not e:
            accel = min(self.travel_accel, self.accel_cap)
        else:
            alone = e < 0 or (dx == 0 and dy == 0)
            plunger = self.max_flow / area
            e_speed = min(plunger, self.e_speed) if alone or not self.only_alone else plunger
            e_accel = min(self.e_alone_accel, self.e_accel) if alone and self.only_alone else self.e_accel
            ratio = max(abs(e) / path, 1e-12)
            speed = min(speed, e_speed / ratio)
            accel = min(self.accel, self.accel_cap, e_accel / ratio)
        if tilt:
            speed, accel = min(speed, most[2] / tilt), min(accel, self.z_accel / tilt)
        return speed, accel

    def of_e(self, feed: float, area: float) -> tuple[float, float]:
        """Return the same for a move of E alone."""
        return min(feed, self.max_flow / area, self.e_speed), min(self.e_alone_accel, self.e_accel)

    def set_junction_deviation(self, deviation: float) -> None:
        """Carry out M205 J, mm: the corner speed at a right angle that it stands for."""
        self.corner_speed = math.sqrt(self.accel * deviation * _CORNER)
