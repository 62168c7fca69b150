"""Limits: how fast each move may run, and how hard it may speed up. One function a limit, all of one shape.

A speed limit is `limit(moves, machine) -> speeds[n]`, mm/s along the path (of E where E moves alone), inf where it does
not apply. `cruise` takes the least of them and remembers which one won, so that a plan can be explained.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.records import Kind, Moves

SpeedLimit = Callable[[Moves, Machine], Floats]


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

    @property
    def label(self) -> str:
        """For people."""
        of_speed = ("", "feed rate", "axis speed", "plunger", "arc's curvature")
        return (*of_speed, "plunger at starts", "plunger at stops")[self]


def feed_limit(moves: Moves, _machine: Machine) -> Floats:
    """The speed that the file asks for."""
    return np.where(np.isnan(moves.feed), np.inf, moves.feed)


def axis_limit(moves: Moves, machine: Machine) -> Floats:
    """No axis faster than it can go: v |d_axis| / length <= max_speed; an arc counts with its plane's slower axis."""
    fastest = np.asarray(machine.max_speed)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        share = np.abs(moves.p1 - moves.p0) / moves.length[:, None]
        limit = np.min(np.where(share > 0, fastest / share, np.inf), axis=1)
    arcs = moves.kind == Kind.ARC
    if arcs.any():
        axes = np.array([[0, 1], [2, 0], [1, 2]])[moves.plane[arcs]]
        limit[arcs] = np.minimum(limit[arcs], fastest[axes].min(axis=1))
    return np.where(moves.length > 0, limit, np.inf)


def flow_limit(moves: Moves, machine: Machine) -> Floats:
    """The plunger no faster than max_flow: v |volume| / length <= max_flow."""
    volume = np.abs(moves.e * moves.area)
    distance = path_length(moves)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((volume > 0) & (distance > 0), machine.max_flow * distance / volume, np.inf)


def curve_limit(moves: Moves, machine: Machine) -> Floats:
    """Centripetal acceleration on arcs: v^2 <= a r."""
    return curve_speed(moves, acceleration(moves, machine))


def curve_speed(moves: Moves, accel: Floats) -> Floats:
    """The same at `accel`, mm/s^2, a row."""
    limit = np.full(len(moves), np.inf)
    arcs = np.flatnonzero((moves.kind == Kind.ARC) & (moves.sweep != 0))
    if len(arcs):
        flat = np.hypot(*_in_plane(moves, arcs))
        limit[arcs] = np.sqrt(accel[arcs] * flat)
    return limit


def _in_plane(moves: Moves, rows: NDArray[np.int64]) -> tuple[Floats, Floats]:
    axes = np.array([[0, 1], [2, 0], [1, 2]])[moves.plane[rows]]
    start = np.take_along_axis(moves.p0[rows], axes, axis=1) - moves.center[rows]
    return start[:, 0], start[:, 1]


SPEED_LIMITS: dict[Limit, SpeedLimit] = {
    Limit.FEED: feed_limit,
    Limit.AXIS: axis_limit,
    Limit.FLOW: flow_limit,
    Limit.CURVE: curve_limit,
}


def path_length(moves: Moves) -> Floats:
    """What a move's speed is measured along, mm: its path, or E where E moves alone; 0 where nothing moves."""
    moving = (moves.kind == Kind.LINE) | (moves.kind == Kind.ARC)
    distance = np.where(moving, np.where(moves.length > 0, moves.length, np.abs(moves.e)), 0.0)
    return np.where(stops_at(moves), 0.0, np.nan_to_num(distance))


def stops_at(moves: Moves) -> NDArray[np.bool_]:
    """Where the machine comes to rest: dwells, barriers, tools, firmware retraction, moves from or to the unknown."""
    standing = np.isin(moves.kind, (Kind.DWELL, Kind.TOOL, Kind.BARRIER, Kind.RETRACT, Kind.UNRETRACT))
    moving = (moves.kind == Kind.LINE) | (moves.kind == Kind.ARC)
    unknown = np.isnan(moves.p0).any(axis=1) | np.isnan(moves.p1).any(axis=1) | np.isnan(moves.length)
    return np.asarray(standing | (moving & unknown))


def cruise(moves: Moves, machine: Machine) -> tuple[Floats, NDArray[np.int8]]:
    """The most each move may run at, mm/s, and the Limit that says so."""
    stack = np.stack([limit(moves, machine) for limit in SPEED_LIMITS.values()])
    winner = stack.argmin(axis=0)
    speeds = stack[winner, np.arange(len(moves))]
    moving = path_length(moves) > 0
    named = np.array([int(limit) for limit in SPEED_LIMITS], dtype=np.int8)
    return np.where(moving, speeds, 0.0), np.where(moving, named[winner], 0).astype(np.int8)


def acceleration(moves: Moves, machine: Machine) -> Floats:
    """Acceleration along each move, mm/s^2: the file's or the machine's, kept to what Z, E and plunger can follow."""
    extruding = (moves.e > 0) & (moves.length > 0)
    asked = np.where(
        extruding,
        np.where(np.isnan(moves.accel), machine.accel, moves.accel),
        np.where(np.isnan(moves.travel_accel), machine.travel_accel, moves.travel_accel),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        share_z = np.abs(moves.p1[:, 2] - moves.p0[:, 2]) / moves.length
        limit_z = np.where((moves.length > 0) & (share_z > 0), machine.z_accel / share_z, np.inf)
        bead = np.abs(moves.e * moves.area) / moves.length
        limit_slew = np.where(extruding, machine.max_flow_slew / bead, np.inf)
    along_path = np.minimum(np.minimum(asked, limit_z), limit_slew)
    return np.where(moves.length > 0, along_path, machine.e_accel)


@dataclasses.dataclass(frozen=True)
class MotionLimits:
    """Every limit of some moves, one array each: distance, cruise, accel, corner speed, and which limit set cruise."""

    distance: Floats
    cruise: Floats
    accel: Floats
    corner_accel: Floats
    """What firmware takes corners by: its own acceleration, however slowly we speed up."""
    corner_speed: Floats
    limited_by: NDArray[np.int8]


def motion_limits(
    moves: Moves, machine: Machine, most_accel: Floats | None = None, most_speed: Floats | None = None
) -> MotionLimits:
    """Put the limits of `moves` side by side; no row above its `most_accel`, mm/s^2, and `most_speed`, mm/s."""
    speeds, limited_by = cruise(moves, machine)
    corner = np.where(np.isnan(moves.corner_speed), machine.corner_speed, moves.corner_speed)
    own = acceleration(moves, machine)
    accel = own if most_accel is None else np.minimum(own, most_accel)
    if most_speed is not None:
        limited_by = np.where(most_speed < speeds, np.int8(Limit.FLOW), limited_by)
        speeds = np.minimum(speeds, most_speed)
    return MotionLimits(path_length(moves), speeds, accel, own, corner, limited_by)
