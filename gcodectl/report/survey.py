"""Survey: what a file does in all, counted as its timed moves come by: time by layer and by the slicer's types.

    time of a move -> the layer it is on (those before the first: BEFORE)
                   -> its `;TYPE:` where it lays a road; "travel" where it moves without; "standing" where nothing moves

Every phase of the profile counts once in each of the two tables, so each adds up to the time of the whole build. What
the plan does not follow is guessed, so that it is not missing there: a move from where nobody knows, after homing or a
macro, is one from the last place known (the origin at first), from rest to rest; a firmware's own retract is RETRACT
mm^3.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats, Ints
from gcodectl.config import Machine
from gcodectl.gcode.dialects import FEATURES
from gcodectl.jit import jit_lean
from gcodectl.motion.limits import Limit
from gcodectl.records import Kind, Moves, Profile, SpeedPlan

BEFORE = "before the first layer"
STANDING = len(FEATURES)
LABELS = ("unmarked", *FEATURES[1:], "standing")
"""Of `Survey.types`."""
MOST_TOOLS = 100
_TRAVEL = FEATURES.index("travel")
_LINE, _ARC, _BARRIER = int(Kind.LINE), int(Kind.ARC), int(Kind.BARRIER)
_RETRACT, _UNRETRACT = int(Kind.RETRACT), int(Kind.UNRETRACT)
RETRACT, RETRACT_SPEED, FEED = 2.4, 35.0, 25.0
"""A firmware's own retract, mm^3, and its speed, mm/s of E; the speed of moves before the first F, mm/s."""
M_SPEED, M_ACCEL, M_TRAVEL, M_Z_ACCEL, M_E_ACCEL, M_FLOW, M_AREA = 0, 3, 4, 5, 6, 7, 8
"""Where the machine's numbers stand in their vector; its speeds are three."""
PULLED = 3
MOVING, BARRIERS, ROADS, LAYING, VOLUME, EXTRUDED, PATH, COUNTS = range(8)
"""Counts and sums: of moves, barriers and roads; whether the last move laid one; mm^3, mm of E, mm of road."""


@jit_lean
def ramped_kernel(distance: float, speed: float, accel: float) -> float:
    """Seconds from rest to rest."""
    if not (distance > 0 and speed > 0):
        return 0.0
    if distance * accel < speed * speed:
        return 2.0 * math.sqrt(distance / accel)
    return distance / speed + speed / accel


@jit_lean
def guess_kernel(kind: int, e: float, feed: float, p1: Floats, machine: Floats, place: Floats) -> float:
    """Seconds of a row that the plan does not follow, from `place` to `p1`."""
    plunger = machine[M_FLOW] / machine[M_AREA]
    if kind in (_RETRACT, _UNRETRACT):
        return ramped_kernel(RETRACT / machine[M_AREA], min(RETRACT_SPEED, plunger), machine[M_E_ACCEL])
    if kind not in (_LINE, _ARC):
        return 0.0
    speed = FEED if np.isnan(feed) else feed
    square = 0.0
    for axis in range(3):
        if not np.isnan(p1[axis]):
            square += (p1[axis] - place[axis]) ** 2
    distance = math.sqrt(square)
    if distance == 0.0:
        return ramped_kernel(abs(e), min(speed, plunger), machine[M_E_ACCEL])
    for axis in range(3):
        way = abs(p1[axis] - place[axis])
        if speed * way > machine[M_SPEED + axis] * distance:
            speed = machine[M_SPEED + axis] * distance / way
    if speed * abs(e) > plunger * distance:
        speed = plunger * distance / abs(e)
    accel = machine[M_ACCEL] if e > 0 else machine[M_TRAVEL]
    rise = 0.0 if np.isnan(p1[2]) else abs(p1[2] - place[2])
    if accel * rise > machine[M_Z_ACCEL] * distance:
        accel = machine[M_Z_ACCEL] * distance / rise
    return ramped_kernel(distance, speed, accel)


@jit_lean
def survey_kernel(
    kind: NDArray[np.int8], tool: NDArray[np.int16], layer: NDArray[np.int32], feature: NDArray[np.int16],
    limited_by: NDArray[np.int8], ruled_by: NDArray[np.int8], row: Ints,
    e: Floats, length: Floats, area: Floats, feed: Floats, distance: Floats, p0: Floats, p1: Floats, phase_row: Ints,
    duration: Floats, machine: Floats, place: Floats,
    counts: Floats, box: Floats, limited: Ints, tools: Ints, layers: Floats, types: Floats,
) -> None:  # fmt: skip
    """Count a chunk in; `layers` begins with what is before the first."""
    phase = 0
    for i in range(len(kind)):
        lays = e[i] > 0 and length[i] > 0
        seconds = 0.0
        pulls = kind[i] == _RETRACT
        if distance[i] == 0 and not ((pulls or kind[i] == _UNRETRACT) and place[PULLED] == pulls):
            seconds = guess_kernel(kind[i], 0.0 if np.isnan(e[i]) else e[i], feed[i], p1[i], machine, place)
        if pulls or kind[i] == _UNRETRACT:
            place[PULLED] = pulls
        for axis in range(3):
            if not np.isnan(p1[i, axis]):
                place[axis] = p1[i, axis]
        while phase < len(phase_row) and phase_row[phase] <= row[i]:
            seconds += duration[phase]
            phase += 1
        layers[layer[i] + 1] += seconds
        types[feature[i] if lays else (_TRAVEL if _LINE <= kind[i] <= _ARC else STANDING)] += seconds
        counts[MOVING] += distance[i] > 0
        counts[BARRIERS] += kind[i] == _BARRIER
        counts[EXTRUDED] += 0.0 if np.isnan(e[i]) else e[i]
        limited[limited_by[i]] += 1
        limited[ruled_by[i]] += 1
        if lays:
            counts[ROADS] += counts[LAYING] == 0
            counts[VOLUME] += e[i] * area[i]
            counts[PATH] += length[i]
            tools[tool[i] % MOST_TOOLS] = 1
            for axis in range(3):
                for end in (p0[i, axis], p1[i, axis]):
                    if end < box[0, axis]:
                        box[0, axis] = end
                    if end > box[1, axis]:
                        box[1, axis] = end
        counts[LAYING] = lays


class Survey:
    """What the timed moves so far did."""

    def __init__(self, machine: Machine) -> None:
        self.machine = np.array([
            *machine.max_speed, machine.accel, machine.travel_accel, machine.z_accel, machine.e_accel,
            machine.max_flow, machine.area,
        ])  # fmt: skip
        self.place = np.zeros(4)
        """Where the machine is, mm; and whether the firmware has retracted."""
        self.lines = 0
        self.counts = np.zeros(COUNTS)
        self.box = np.array([[np.inf] * 3, [-np.inf] * 3])
        """Lowest and highest place of a road, mm."""
        self.limited = np.zeros(len(Limit), dtype=np.int64)
        """Moves by the limit that set their speed, and those by the one that set their acceleration."""
        self.tools = np.zeros(MOST_TOOLS, dtype=np.int64)
        self.layers = np.zeros(1)
        """Seconds before the first layer, then of each."""
        self.types = np.zeros(len(LABELS))
        """Seconds by LABELS."""

    def add(self, moves: Moves, speeds: SpeedPlan, phases: Profile) -> None:
        """Count a chunk in."""
        if not len(moves):
            return
        self.lines = int(moves.line[-1])
        more = int(moves.layer.max()) + 2 - len(self.layers)
        if more > 0:
            self.layers = np.concatenate([self.layers, np.zeros(more)])
        survey_kernel(
            moves.kind, moves.tool, moves.layer, moves.feature, speeds.limited_by, speeds.ruled_by, moves.row,
            moves.e, moves.length, moves.area, moves.feed, speeds.distance, moves.p0, moves.p1, phases.row,
            phases.duration, self.machine, self.place,
            self.counts, self.box, self.limited, self.tools, self.layers, self.types,
        )  # fmt: skip

    @property
    def time_s(self) -> float:
        """Seconds of the whole build; heating and homing aside."""
        return float(self.types.sum())

    def by_layer(self) -> dict[str, float]:
        """Seconds of each layer, from 0, and before the first; they add up to `time_s`."""
        names = (BEFORE, *map(str, range(len(self.layers) - 1)))
        return dict(zip(names, self.layers.tolist(), strict=True))

    def by_type(self) -> dict[str, float]:
        """Seconds of each type that took any, the longest first; they add up to `time_s`."""
        some = {label: float(seconds) for label, seconds in zip(LABELS, self.types, strict=True) if seconds > 0}
        return dict(sorted(some.items(), key=lambda one: -one[1]))
