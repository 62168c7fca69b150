"""Limits: how fast each move may run, and how hard it may speed up. One small kernel a limit.

A speed limit is mm/s along the path (of E where E moves alone), inf where it does not apply:

    FEED   what the file asks for
    AXIS   v |d_axis| / length <= max_speed of each axis; an arc counts with its plane's slower axis
    FLOW   v |volume| / length <= max_flow: the plunger
    CURVE  v^2 <= a r: centripetal acceleration on arcs
    HEAT   what the surface beneath allows (`thermal.stage`)

`limits_kernel` takes the least of them and remembers which one won, so that a plan can be explained. Acceleration is
the file's or the machine's, kept to what Z, E and the plunger's slew can follow.
"""

from __future__ import annotations

import dataclasses
import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats
from gcodectl.config import Machine
from gcodectl.jit import jit_lean
from gcodectl.records import Kind, Moves

LINE, ARC, DWELL, UNRETRACT = int(Kind.LINE), int(Kind.ARC), int(Kind.DWELL), int(Kind.UNRETRACT)
RETRACT, TOOL, BARRIER = int(Kind.RETRACT), int(Kind.TOOL), int(Kind.BARRIER)
FIRST_AXIS, SECOND_AXIS = (0, 2, 1), (1, 0, 2)
"""Of an arc's plane: XY, ZX, YZ."""
# Places in the row of machine settings that the kernels take
FASTEST, FLOW_MOST, FLOW_SLEW, PRINT_ACCEL, TRAVEL_ACCEL, E_ACCEL, Z_ACCEL, CORNER = 0, *range(3, 10)
# Rows of the kernel's output
DISTANCE, CRUISE, ACCEL, OWN_ACCEL, CORNER_SPEED, LIMITS = range(6)


class Limit(IntEnum):
    """Which limit set a move's cruising speed, or its acceleration."""

    NONE = 0
    FEED = 1
    AXIS = 2
    FLOW = 3
    CURVE = 4
    START = 5
    """From here on: what set a move's acceleration, where that is not the file or the machine."""
    STOP = 6
    HEAT = 7
    """Of a move's speed, again."""

    @property
    def label(self) -> str:
        """For people."""
        of_speed = ("", "feed rate", "axis speed", "plunger", "arc's curvature")
        return (*of_speed, "plunger at starts", "plunger at stops", "heat beneath")[self]


BY_FEED, BY_AXIS, BY_FLOW, BY_CURVE = int(Limit.FEED), int(Limit.AXIS), int(Limit.FLOW), int(Limit.CURVE)
BY_HEAT = int(Limit.HEAT)


@jit_lean
def stops_kernel(kind: int, begin: float, end: float, length: float) -> bool:
    """Whether the machine rests: dwells, barriers, tools, firmware retraction, moves from or to the unknown (NaN)."""
    if kind in (LINE, ARC):
        return math.isnan(begin) or math.isnan(end) or math.isnan(length)
    return kind in (DWELL, TOOL, BARRIER, RETRACT, UNRETRACT)


@jit_lean
def axis_limit_kernel(dx: float, dy: float, dz: float, length: float, machine: Floats) -> float:
    """Return the speed at which the first of the axes goes as fast as it can."""
    limit = math.inf
    if dx != 0.0:
        limit = min(limit, machine[FASTEST] / (abs(dx) / length))
    if dy != 0.0:
        limit = min(limit, machine[FASTEST + 1] / (abs(dy) / length))
    if dz != 0.0:
        limit = min(limit, machine[FASTEST + 2] / (abs(dz) / length))
    return limit


@jit_lean
def arc_axis_limit_kernel(plane: int, machine: Floats) -> float:
    """The speed of the slower axis of an arc's plane."""
    across = machine[FASTEST + (1 if plane == 0 else 2)]
    return float(min(machine[FASTEST + (1 if plane == 2 else 0)], across))


@jit_lean
def acceleration_kernel(
    e: float, area: float, length: float, dz: float, asked: float, travel: float, machine: Floats
) -> float:
    """Acceleration along a move, mm/s^2; `asked` and `travel` are the file's with and without extrusion, or NaN."""
    if length <= 0.0:
        return float(machine[E_ACCEL])
    if e > 0.0:
        accel = machine[PRINT_ACCEL] if math.isnan(asked) else asked
        accel = min(accel, machine[FLOW_SLEW] / (abs(e * area) / length))
    else:
        accel = machine[TRAVEL_ACCEL] if math.isnan(travel) else travel
    if dz != 0.0:
        accel = min(accel, machine[Z_ACCEL] / (abs(dz) / length))
    return accel


@jit_lean
def limits_kernel(
    kind: NDArray[np.int8], plane: NDArray[np.int8], p0: Floats, p1: Floats, center: Floats, sweep: Floats,
    length: Floats, e: Floats, area: Floats, feed: Floats, accel: Floats, travel_accel: Floats, corner: Floats,
    heat: Floats, most_accel: Floats, most_speed: Floats, machine: Floats, out: Floats,
    limited_by: NDArray[np.int8], rests: Bools,
) -> None:  # fmt: skip
    """Fill `out` (LIMITS rows), which limit set the cruising speed, and where the machine rests."""
    for i in range(len(kind)):
        kind_i, path = int(kind[i]), length[i]
        dx, dy, dz = p1[i, 0] - p0[i, 0], p1[i, 1] - p0[i, 1], p1[i, 2] - p0[i, 2]
        stands = stops_kernel(kind_i, p0[i, 0] + p0[i, 1] + p0[i, 2], p1[i, 0] + p1[i, 1] + p1[i, 2], path)
        own = acceleration_kernel(e[i], area[i], path, dz, accel[i], travel_accel[i], machine)
        distance = 0.0
        if kind_i in (LINE, ARC) and not stands:
            distance = path if path > 0.0 else abs(e[i])
            distance = 0.0 if math.isnan(distance) else distance
        speed, winner = math.inf, BY_FEED
        if distance > 0.0:
            if not math.isnan(feed[i]):
                speed = feed[i]
            if path > 0.0:
                limit = axis_limit_kernel(dx, dy, dz, path, machine)
                if kind_i == ARC:
                    limit = min(limit, arc_axis_limit_kernel(int(plane[i]), machine))
                if limit < speed:
                    speed, winner = limit, BY_AXIS
            volume = abs(e[i] * area[i])
            if volume > 0.0 and machine[FLOW_MOST] * distance / volume < speed:
                speed, winner = machine[FLOW_MOST] * distance / volume, BY_FLOW
            if kind_i == ARC and sweep[i] != 0.0:
                first, second = FIRST_AXIS[plane[i]], SECOND_AXIS[plane[i]]
                limit = math.sqrt(own * math.hypot(p0[i, first] - center[i, 0], p0[i, second] - center[i, 1]))
                if limit < speed:
                    speed, winner = limit, BY_CURVE
            if most_speed[i] < speed:
                speed, winner = most_speed[i], BY_FLOW
            if 0.0 < heat[i] < speed:
                speed, winner = heat[i], BY_HEAT
        out[DISTANCE, i] = distance
        out[CRUISE, i] = speed if distance > 0.0 else 0.0
        out[ACCEL, i] = min(own, most_accel[i])
        out[OWN_ACCEL, i] = own
        out[CORNER_SPEED, i] = machine[CORNER] if math.isnan(corner[i]) else corner[i]
        limited_by[i] = winner if distance > 0.0 else 0
        rests[i] = stands


@dataclasses.dataclass(frozen=True)
class MotionLimits:
    """Every limit of some moves, which of them set the cruising speed, and where the machine rests."""

    table: Floats
    """shape (LIMITS, n)"""
    limited_by: NDArray[np.int8]
    rests: Bools

    @property
    def distance(self) -> Floats:
        """What speed is measured along, mm: the path, or E where E moves alone; 0 where nothing moves."""
        return np.asarray(self.table[DISTANCE])

    @property
    def cruise(self) -> Floats:
        """The most each move may run at, mm/s; 0 where nothing moves."""
        return np.asarray(self.table[CRUISE])

    @property
    def accel(self) -> Floats:
        """mm/s^2"""
        return np.asarray(self.table[ACCEL])

    @property
    def own_accel(self) -> Floats:
        """What firmware takes corners by: its own acceleration, however slowly we speed up."""
        return np.asarray(self.table[OWN_ACCEL])

    @property
    def corner_speed(self) -> Floats:
        """Square corner velocity, mm/s."""
        return np.asarray(self.table[CORNER_SPEED])


def motion_limits(
    moves: Moves, machine: Machine, most_accel: Floats | None = None, most_speed: Floats | None = None
) -> MotionLimits:
    """Put the limits of `moves` side by side; no row above its `most_accel`, mm/s^2, and `most_speed`, mm/s."""
    n = len(moves)
    out, limited_by, rests = np.empty((LIMITS, n)), np.empty(n, dtype=np.int8), np.empty(n, dtype=np.bool_)
    limits_kernel(
        moves.kind, moves.plane, moves.p0, moves.p1, moves.center, moves.sweep, moves.length, moves.e, moves.area,
        moves.feed, moves.accel, moves.travel_accel, moves.corner_speed, moves.heat,
        np.full(n, np.inf) if most_accel is None else most_accel,
        np.full(n, np.inf) if most_speed is None else most_speed,
        settings_of(machine), out, limited_by, rests,
    )  # fmt: skip
    return MotionLimits(out, limited_by, rests)


def settings_of(machine: Machine) -> Floats:
    """The row of machine settings that the kernels take."""
    return np.array(
        [
            *machine.max_speed, machine.max_flow, machine.max_flow_slew, machine.accel, machine.travel_accel,
            machine.e_accel, machine.z_accel, machine.corner_speed,
        ]
    )  # fmt: skip
