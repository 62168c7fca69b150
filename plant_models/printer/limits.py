"""What a firmware's settings let one block do: its highest speed and its acceleration, one block at a time.

The same rules as `plant_models.gantry`, which applies them to a whole file at once; here the settings change as M201,
M203, M204 and M205 come in. Units: mm, s.

A number that no machine can move by is not taken: zero and less leave a setting as it was (Marlin takes some of them,
and stands still for ever), others are cut to what its integers hold. Junction deviation is refused outside of 0.01 to
0.3 mm, as Marlin does.
"""

from __future__ import annotations

import math

from gcodectl.config import Machine
from plant_models.gantry import Firmware
from plant_models.printer.words import Words

LEAST_SPEED = 1e-4
"""mm/s: a step a second of a fine drive; a stepper's timer counts no further."""
LEAST_ACCEL = 1e-2
"""mm/s^2: a step / s^2, of whole ones."""
MOST = 1e6
"""mm/s and mm/s^2: beyond any drive."""
LONGEST_LEAST = 2.0**32 / 1e6
"""s, M205 B: what 32 bit of us hold."""
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
        self.least_time = 0.0
        """M205 B: s; a shorter block is slowed while the ring runs empty."""

    def of_path(
        self, dx: float, dy: float, dz: float, path: float, e: float, feed: float, area: float
    ) -> tuple[float, float]:
        """Return the highest speed and the acceleration along a path; `area` is what E pushes, mm^2."""
        speed, most = feed, self.max_speed
        if dx and (cap := most[0] * path / abs(dx)) < speed:
            speed = cap
        if dy and (cap := most[1] * path / abs(dy)) < speed:
            speed = cap
        accel = self.accel if e else self.travel_accel
        if accel > self.accel_cap:
            accel = self.accel_cap
        if e:
            e_speed, e_accel = self._of_e_on_path(e < 0 or (dx == 0 and dy == 0), area)
            share = path / abs(e)
            if (cap := e_speed * share) < speed:
                speed = cap
            if (cap := e_accel * share) < accel:
                accel = cap
        if dz:
            share = path / abs(dz)
            speed, accel = min(speed, most[2] * share), min(accel, self.z_accel * share)
        return speed, accel

    def _of_e_on_path(self, alone: bool, area: float) -> tuple[float, float]:
        """Return the limits of E's own speed and acceleration; `alone`: without X and Y, or backward."""
        plunger = self.max_flow / area
        if not self.only_alone:
            return self.e_speed if self.e_speed < plunger else plunger, self.e_accel
        if not alone:
            return plunger, self.e_accel
        return min(plunger, self.e_speed), min(self.e_alone_accel, self.e_accel)

    def of_e(self, feed: float, area: float) -> tuple[float, float]:
        """Return the same for a move of E alone."""
        return min(feed, self.max_flow / area, self.e_speed), min(self.e_alone_accel, self.e_accel)

    def m201(self, words: Words) -> None:
        """Set the highest accelerations: the smaller of X and Y for all paths, Z, E."""
        caps = [_between(words.get(letter), LEAST_ACCEL, math.inf) for letter in "XY"]
        self.accel_cap = min(caps) if min(caps) < math.inf else self.accel_cap
        self.z_accel = _between(words.get("Z"), LEAST_ACCEL, self.z_accel)
        self.e_accel = _between(words.get("E"), LEAST_ACCEL, self.e_accel)

    def m203(self, words: Words) -> None:
        """Set the highest speeds."""
        for axis, letter in enumerate("XYZ"):
            self.max_speed[axis] = _between(words.get(letter), LEAST_SPEED, self.max_speed[axis])
        self.e_speed = _between(words.get("E"), LEAST_SPEED, self.e_speed)

    def m204(self, words: Words) -> None:
        """Set the accelerations of printing, travelling and of E alone."""
        both = words.get("S")
        self.accel = _between(words.get("P"), LEAST_ACCEL, _between(both, LEAST_ACCEL, self.accel))
        self.travel_accel = _between(words.get("T"), LEAST_ACCEL, _between(both, LEAST_ACCEL, self.travel_accel))
        self.e_alone_accel = _between(words.get("R"), LEAST_ACCEL, self.e_alone_accel)

    def m205(self, words: Words) -> None:
        """Set the corner speed (the smaller of X and Y, or what the junction deviation J stands for) and E's step."""
        steps = [_between(words.get(letter), LEAST_SPEED, math.inf) for letter in "XY"]
        self.corner_speed = min(steps) if min(steps) < math.inf else self.corner_speed
        self.e_corner_speed = _between(words.get("E"), LEAST_SPEED, self.e_corner_speed)
        least, deviation = words.get("B"), words.get("J")
        if least is not None and least >= 0:
            self.least_time = min(least / 1e6, LONGEST_LEAST)
        if deviation is not None and 0.01 <= deviation <= 0.3:
            self.corner_speed = math.sqrt(self.accel * deviation * _CORNER)


def _between(word: float | None, least: float, otherwise: float) -> float:
    """Return a word within what the firmware holds; `otherwise` where there is none, or none above zero."""
    return min(max(word, least), MOST) if word is not None and word > 0 else otherwise
