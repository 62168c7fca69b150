"""The gantry: Moves cut into the straight segments that a firmware's planner works on.

    arc       chords of at most `chord` mm, as Klipper's gcode_arcs and Marlin's plan_arc do; E shared by length
    unknown   an axis whose position is not known stays where it is assumed to be (0 at first)
    G10/G11   E alone, by a stated volume; a second G10 in a row does nothing, as in Marlin's fwretract.cpp
    T         rest, and `switch_dwell` where the tool really changes
    barrier   rest

Units: mm, s, mm^3. A segment's volume is what E asks of the plunger, negative where it pulls back.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Columns, Floats, Ints, column
from gcodectl.config import Machine
from gcodectl.errors import UsageError
from gcodectl.jit import jit
from gcodectl.records import Kind, Moves

PATH, E_ONLY, PAUSE = 0, 1, 2
TINY = 1e-7
"""mm; a shorter path is none."""


@dataclasses.dataclass(frozen=True)
class Firmware:
    """What a firmware's configuration says beside the machine's limits."""

    junction: str = "square"
    """`square`: square corner velocity (Klipper's; Marlin's junction deviation is the same law); `jerk`: classic."""
    chord: float = 0.5
    """Longest chord of an arc, mm."""
    retract_volume: float = 2.4
    """Firmware retraction, mm^3: 1 mm of 1.75 mm filament."""
    retract_speed: float = 35.0
    """mm/s of E."""
    instant_e_speed: float | None = None
    """Step in E speed allowed at a junction, mm/s (Klipper: instantaneous_corner_velocity); None: the machine's."""
    default_feed: float = 25.0
    """Speed of moves before the first F, mm/s."""

    def __post_init__(self) -> None:
        if self.junction not in ("square", "jerk"):
            raise UsageError(f"junction {self.junction!r} is neither 'square' nor 'jerk'")
        if not (self.chord > 0 and self.retract_volume >= 0 and self.retract_speed > 0 and self.default_feed > 0):
            raise UsageError("chord, retract_speed and default_feed must be positive, retract_volume not negative")


@dataclasses.dataclass(frozen=True)
class Segments(Columns):
    """One row a straight piece of path, a move of E alone, or a pause; in the order they are executed."""

    row: Ints = column(np.int64)
    """The move's row."""
    line: Ints = column(np.int64)
    kind: NDArray[np.int8] = column(np.int8)
    """PATH, E_ONLY or PAUSE."""
    p0: Floats = column(np.float64, width=3)
    p1: Floats = column(np.float64, width=3)
    length: Floats = column(np.float64)
    """mm of path; of E where E moves alone; 0 for a pause."""
    e: Floats = column(np.float64)
    """mm of E."""
    volume: Floats = column(np.float64)
    """e times the cross-section that it pushes, mm^3."""
    speed: Floats = column(np.float64)
    """The most it may reach, mm/s: feed, axis and flow limits."""
    accel: Floats = column(np.float64)
    corner_speed: Floats = column(np.float64)
    e_corner_speed: Floats = column(np.float64)
    """Step in E speed allowed at the junction before it, mm/s."""
    pause: Floats = column(np.float64)
    """Seconds to stand still."""
    rest: Bools = column(np.bool_)
    """The machine is at rest before it."""
    broken: Bools = column(np.bool_)
    """No road reaches over its start: a tool change, barrier or retraction lies before it."""
    tool: NDArray[np.int16] = column(np.int16)
    layer: NDArray[np.int32] = column(np.int32)


@jit
def chords_kernel(
    kind: NDArray[np.int8], p0: Floats, p1: Floats, center: Floats, sweep: Floats, plane: NDArray[np.int8],
    pieces: Ints, position: Floats, source: Ints, start: Floats, end: Floats, share: Floats,
) -> int:  # fmt: skip
    """Fill source, start, end, share with the pieces of each move; `position` is carried and left at the end."""
    count = 0
    a, b = np.zeros(3), np.zeros(3)
    for i in range(len(kind)):
        for k in range(3):
            a[k] = position[k] if np.isnan(p0[i, k]) else p0[i, k]
            b[k] = a[k] if np.isnan(p1[i, k]) else p1[i, k]
        n = pieces[i]
        if kind[i] == 2 and n > 1:
            u = 0 if plane[i] == 0 else (2 if plane[i] == 1 else 1)
            w = 1 if plane[i] == 0 else (0 if plane[i] == 1 else 2)
            h = 3 - u - w
            r0 = math.hypot(a[u] - center[i, 0], a[w] - center[i, 1])
            r1 = math.hypot(b[u] - center[i, 0], b[w] - center[i, 1])
            angle = math.atan2(a[w] - center[i, 1], a[u] - center[i, 0])
            for j in range(n):
                start[count] = a if j == 0 else end[count - 1]
                part = (j + 1) / n
                radius = r0 + (r1 - r0) * part
                end[count, u] = center[i, 0] + radius * math.cos(angle + sweep[i] * part)
                end[count, w] = center[i, 1] + radius * math.sin(angle + sweep[i] * part)
                end[count, h] = a[h] + (b[h] - a[h]) * part
                if j == n - 1:
                    end[count] = b
                source[count], share[count] = i, 1.0 / n
                count += 1
        else:
            start[count], end[count], source[count], share[count] = a, b, i, 1.0
            count += 1
        position[:] = b
    return count


def cut(moves: Moves, machine: Machine, firmware: Firmware) -> Segments:
    """Cut `moves` into segments with their limits; moves that do nothing leave no row."""
    known = (
        np.isfinite(moves.p0).all(axis=1) & np.isfinite(moves.p1).all(axis=1) & np.isfinite(moves.center).all(axis=1)
    )
    arcs = (moves.kind == Kind.ARC) & known & np.isfinite(moves.length) & np.isfinite(moves.sweep)
    pieces = np.ones(len(moves), dtype=np.int64)
    pieces[arcs] = np.maximum(1, np.ceil(moves.length[arcs] / firmware.chord)).astype(np.int64)
    total = int(pieces.sum())
    source, share = np.zeros(total, dtype=np.int64), np.zeros(total)
    start, end = np.zeros((total, 3)), np.zeros((total, 3))
    chords_kernel(
        moves.kind, moves.p0, moves.p1, moves.center, moves.sweep, moves.plane, pieces, np.zeros(3),
        source, start, end, share,
    )  # fmt: skip
    e_all, feed_all = _retractions(moves, machine, firmware)
    kind = moves.kind[source]
    moving = (kind == Kind.LINE) | (kind == Kind.ARC)
    e = e_all[source] * share
    path = np.where(moving, np.linalg.norm(end - start, axis=1), 0.0)
    on_path = path > TINY
    only_e = ~on_path & (np.abs(e) > 0)
    pause, rest, broken = _pauses(moves, machine)
    keep = on_path | only_e | (pause[source] > 0)
    area = moves.area[source]
    length = np.where(on_path, path, np.where(only_e, np.abs(e), 0.0))
    speed, accel = _limits(moves, machine, source, end - start, path, e, feed_all)
    instant = firmware.instant_e_speed
    corner = moves.corner_speed[source]
    corner = np.where(np.isfinite(corner) & (corner > 0), corner, machine.corner_speed)
    segments = Segments(
        row=moves.row[source],
        line=moves.line[source],
        kind=np.where(on_path, PATH, np.where(only_e, E_ONLY, PAUSE)),
        p0=start,
        p1=np.where(moving[:, None], end, start),
        length=length,
        e=e,
        volume=e * area,
        speed=speed,
        accel=accel,
        corner_speed=corner,
        e_corner_speed=np.full(total, machine.e_limits.corner_speed if instant is None else instant),
        pause=np.where(on_path | only_e, 0.0, pause[source]),
        rest=carry_marks(rest[source], keep),
        broken=carry_marks(broken[source], keep),
        tool=moves.tool[source],
        layer=moves.layer[source],
    )
    return segments[keep]


def carry_marks(marks: Bools, keep: Bools) -> Bools:
    """Hand marks of rows that leave no segment on to the next one that does."""
    before = np.concatenate([[0], np.cumsum(marks)])
    kept = np.flatnonzero(keep)
    since = np.concatenate([[0], kept[:-1] + 1]) if len(kept) else kept
    carried = np.zeros(len(marks), dtype=np.bool_)
    carried[kept] = before[kept + 1] > before[since]
    return carried


def _retractions(moves: Moves, machine: Machine, firmware: Firmware) -> tuple[Floats, Floats]:
    """Return E (mm) and feed of all rows with firmware retractions made moves of E, and NaN feeds filled in."""
    e = np.where(np.isfinite(moves.e), moves.e, 0.0)
    feed = np.where(np.isfinite(moves.feed) & (moves.feed > 0), moves.feed, firmware.default_feed)
    stroke = firmware.retract_volume / machine.area
    retracted = False
    for i in np.flatnonzero((moves.kind == Kind.RETRACT) | (moves.kind == Kind.UNRETRACT)):
        wanted = bool(moves.kind[i] == Kind.RETRACT)
        if wanted != retracted:
            area = moves.area[i] if moves.area[i] > 0 else machine.area
            e[i] = (-1.0 if wanted else 1.0) * stroke * machine.area / area
            feed[i] = firmware.retract_speed
        retracted = wanted
    return e, feed


def _pauses(moves: Moves, machine: Machine) -> tuple[Floats, Bools, Bools]:
    """Return seconds of standing still, where the machine rests, and where roads are broken, a row a move."""
    kind = moves.kind
    pause = np.where((kind == Kind.DWELL) & np.isfinite(moves.dwell), np.maximum(moves.dwell, 0.0), 0.0)
    tools = np.flatnonzero(kind == Kind.TOOL)
    changed = tools[moves.tool[tools] != moves.tool[np.maximum(tools - 1, 0)]]
    pause[changed] = machine.switch_dwell
    broken = np.isin(kind, (Kind.TOOL, Kind.BARRIER, Kind.RETRACT, Kind.UNRETRACT))
    return pause, broken | (kind == Kind.DWELL), broken


def _limits(
    moves: Moves, machine: Machine, source: Ints, delta: Floats, path: Floats, e: Floats, feed_all: Floats
) -> tuple[Floats, Floats]:
    """Return the highest speed and the acceleration of each segment, along its path (or of E where E moves alone).

    E has its own limits: Marlin and RepRapFirmware hold every move's E below M203 and M201, Klipper only where E moves
    without X and Y or goes back, there with max_extrude_only_accel too (klippy/kinematics/extruder.py, check_move).
    """
    on_path = path > TINY
    safe = np.where(on_path, path, 1.0)
    direction = np.abs(delta) / safe[:, None]
    area = np.where(moves.area[source] > 0, moves.area[source], machine.area)
    speed = feed_all[source]
    for axis in range(3):
        speed = np.minimum(speed, machine.max_speed[axis] / np.maximum(direction[:, axis], 1e-12))
    e_limits = machine.e_limits
    alone = (delta[:, :2] == 0).all(axis=1) | (e < 0)
    plunger = machine.max_flow / area
    e_speed = np.where(alone | (not e_limits.alone), np.minimum(plunger, e_limits.max_speed), plunger)
    e_accel = np.where(alone & e_limits.alone, min(machine.e_accel, e_limits.max_accel), e_limits.max_accel)
    ratio = np.where(e == 0, 1e-12, np.maximum(np.abs(e) / safe, 1e-12))
    speed = np.where(on_path, np.minimum(speed, e_speed / ratio), np.minimum(feed_all[source], e_speed))
    printing, travelling = moves.accel[source], moves.travel_accel[source]
    printing = np.where(np.isfinite(printing) & (printing > 0), printing, machine.accel)
    travelling = np.where(np.isfinite(travelling) & (travelling > 0), travelling, machine.travel_accel)
    accel = np.where(e != 0, printing, travelling)
    accel = np.minimum(accel, machine.z_accel / np.maximum(direction[:, 2], 1e-12))
    accel = np.minimum(accel, e_accel / ratio)
    return speed, np.where(on_path, accel, np.minimum(machine.e_accel, e_limits.max_accel))
