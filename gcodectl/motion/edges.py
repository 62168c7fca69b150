"""Edges: give every row the acceleration that the plunger can follow there, cutting rows where that changes.

    rows of a road    |----|--|-------------------|--|-----|
    zones             |<-head->|                 |<- tail ->|          see zones.py
    rows that leave   |----|--|.|----------------|.|--|-----|          see parts.py: every row has one acceleration

How a road begins is known when its rows come; how it ends is not: a row leaves when its road's end, or as much path as
both zones take, has been seen behind it. So any chunking gives the same rows, and what is held back is two ramps long.
Only rows that may be rewritten are slowed.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Columns, Floats, Ints, column
from gcodectl.config import Machine
from gcodectl.jit import jit_lean
from gcodectl.motion.follow import Follow, seconds_kernel
from gcodectl.motion.limits import ACCEL, CRUISE, DISTANCE, Limit, motion_limits
from gcodectl.motion.parts import HIGH, LOW, MOST, MOST_ACCEL, MOST_SPEED, PART, parts_kernel
from gcodectl.motion.zones import (
    AFTER,
    BEFORE,
    BREAKS,
    CARRY,
    FLIES,
    FLIES_IN,
    FLYING,
    KNOWN,
    LAYS,
    LENGTHS,
    ON,
    RUN_INTO,
    SINCE,
    ZONE,
    dot_kernel,
    far_kernel,
    stretch_kernel,
    zone_kernel,
)
from gcodectl.path import cut_moves
from gcodectl.records import Moves

RULERS = np.array([Limit.START, Limit.STOP, Limit.NONE], dtype=np.int8)  # -1: the last
START, STOP, PEAK, JERK, SECONDS, ABOUT = range(6)
"""What the kernel is told: the shares of the extruder's seconds, the least peak; mm/s^3; the shortest line, s."""


@dataclasses.dataclass(frozen=True)
class Ceiling(Columns):
    """One row a move: the most acceleration that its extruder can follow, mm/s^2, inf where it may be any."""

    accel: Floats = column(np.float64)
    ruled_by: NDArray[np.int8] = column(np.int8)
    """Which Limit says so."""
    speed: Floats = column(np.float64)
    """The most speed, mm/s: at the very ends of roads that travels run into; inf elsewhere."""

    @classmethod
    def none(cls, rows: int) -> Ceiling:
        """No ceiling for `rows` rows."""
        return cls(np.full(rows, np.inf), np.zeros(rows, dtype=np.int8), np.full(rows, np.inf))


@dataclasses.dataclass
class _Carry:
    """What goes on from the rows that have left."""

    road: Floats = dataclasses.field(default_factory=lambda: np.zeros(CARRY))
    """See `zones`."""
    e: float = np.nan
    """Logical E after them."""
    added: int = 0
    """How many more they have become."""


@jit_lean
def edges_kernel(
    limits: Floats, rests: Bools, deposits: Bools, path: Floats, e: Floats, area: Floats, tool: NDArray[np.int16],
    levels: Floats, rises: Floats, falls: Floats, about: Floats, ended: bool, carry: Floats,
    marks: NDArray[np.int8], road: Floats, zone: Floats, edge: Floats, source: Ints, parts: Floats,
    ruler: NDArray[np.int8],
) -> tuple[int, int]:  # fmt: skip
    """Cut rows at the ends of their zones: (rows that no later one can change, parts that they became)."""
    stretch_kernel(limits, rests, deposits, path, ended, carry, marks, road)
    n = 0
    for i in range(len(path)):
        mark = marks[i]
        most = math.inf
        cuts = False
        if mark & LAYS:
            length, cruise, before, after = limits[DISTANCE, i], limits[CRUISE, i], road[BEFORE, i], road[AFTER, i]
            flow = e[i] * area[i] / length * cruise
            up = about[START] * seconds_kernel(levels, rises, tool[i], flow)
            down = about[STOP] * seconds_kernel(levels, falls, tool[i], flow)
            asked = limits[ACCEL, i]
            cuts = not (mark & KNOWN and far_kernel(before, after, cruise, asked, up, down, about[JERK]))
            if cuts:
                need = zone_kernel(before, length, after, mark, cruise, asked, up, down, about[JERK], about[PEAK], zone)
                if not mark & KNOWN and after < need:
                    return i, n
                if mark & KNOWN:
                    most = dot_kernel(before + length + after, cruise, up + down)
            carry[SINCE], carry[RUN_INTO] = before + length, 1.0 if mark & FLIES_IN else 0.0
        if mark & (LAYS | BREAKS):
            carry[ON] = 1.0 if mark & LAYS else 0.0
            carry[FLIES] = 1.0 if (path[i] > 0.0 if mark & LAYS else mark & FLYING) else 0.0
        begun = n
        if cuts:
            n = parts_kernel(
                limits[DISTANCE, i], limits[CRUISE, i], zone, about[SECONDS], i, n, edge, source, parts, ruler
            )
        else:
            source[n], ruler[n] = i, -1
            parts[LOW, n], parts[HIGH, n], parts[MOST_ACCEL, n], parts[MOST_SPEED, n] = 0.0, 1.0, math.inf, math.inf
            n += 1
        for part in range(begun, n):
            parts[MOST_SPEED, part] = min(parts[MOST_SPEED, part], most)
    return len(path), n


def edges(
    chunks: Iterable[Moves], machine: Machine, follow: Follow | None, held: Callable[[], Moves] = Moves.empty
) -> Iterator[tuple[Moves, Ceiling]]:
    """Rows with their ceilings, cut where a zone ends and numbered on; as they came where `follow` slows nothing.

    What is `held` back by whom they go to goes before them: so rows are copied once, where they are cut.
    """
    if follow is None or follow.neutral:
        for chunk in chunks:
            yield Moves.concat([held(), chunk]), Ceiling.none(len(chunk))
        return
    carry, pending = _Carry(), Moves.empty()
    for chunk in chunks:
        pending = Moves.concat([pending, chunk])
        done, out = _settle(pending, machine, follow, carry, held(), ended=False)
        pending = pending[done:]
        if done:
            yield out
    if len(pending):
        yield _settle(pending, machine, follow, carry, held(), ended=True)[1]


def _settle(
    moves: Moves, machine: Machine, follow: Follow, carry: _Carry, held: Moves, *, ended: bool
) -> tuple[int, tuple[Moves, Ceiling]]:
    """How many rows no later one can change, and these cut, behind those `held`; brings `carry` up to date."""
    n = len(moves)
    limits = motion_limits(moves, machine)
    about = np.array([follow.start, follow.stop, follow.peak, machine.jerk, 1.0 / machine.max_lines_per_second])
    source, parts, ruler = np.empty(n * MOST, dtype=np.int64), np.empty((PART, n * MOST)), np.empty(n * MOST, np.int8)
    done, made = edges_kernel(
        limits.table, limits.rests, moves.deposits, moves.length, moves.e, moves.area, moves.tool,
        follow.flow, follow.rise, follow.fall, about, ended, carry.road,
        np.empty(n, np.int8), np.empty((LENGTHS, n)), np.empty(ZONE), np.empty(MOST + 1), source, parts, ruler,
    )  # fmt: skip
    source, ruler = source[:made], ruler[:made]
    low, high, accel, speed = parts[:, :made]
    if not done:
        return 0, (held, Ceiling.empty())
    row = int(moves.row[0]) + carry.added
    out = cut_moves(moves[:done], source, low, high, np.isfinite(speed), carry.e, row, held)
    carry.e, carry.added = float(moves.e_end[done - 1]), carry.added + made - done
    return done, (out, Ceiling(accel.copy(), RULERS[ruler], speed.copy()))
