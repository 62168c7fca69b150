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
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Columns, Floats, column
from gcodectl.config import Machine
from gcodectl.motion.follow import Follow
from gcodectl.motion.limits import Limit, acceleration, cruise, path_length, stops_at
from gcodectl.motion.parts import MOST, ZONES, cut_moves, parts_kernel
from gcodectl.motion.zones import Rows, Stretch, Zones, dot_speed, measure, zones
from gcodectl.records import Moves

RULERS = np.array([Limit.START, Limit.STOP, Limit.NONE], dtype=np.int8)  # -1: the last


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

    on: bool = False
    """Whether they end inside a road."""
    flies: bool = False
    """Whether they end in a move along a path."""
    road: tuple[float, bool] = (0.0, False)
    """Path, mm, since the road's begin, and whether that is run into without a stop."""
    e: float = np.nan
    """Logical E after them."""
    added: int = 0
    """How many more they have become."""


def edges(chunks: Iterable[Moves], machine: Machine, follow: Follow | None) -> Iterator[tuple[Moves, Ceiling]]:
    """Rows with their ceilings, cut where a zone ends and numbered on; as they came where `follow` slows nothing."""
    if follow is None or follow.neutral:
        for chunk in chunks:
            yield chunk, Ceiling.none(len(chunk))
        return
    carry, pending = _Carry(), Moves.empty()
    for chunk in chunks:
        pending = Moves.concat([pending, chunk])
        done, out = _settle(pending, machine, follow, carry, ended=False)
        pending = pending[done:]
        if done:
            yield out
    if len(pending):
        yield _settle(pending, machine, follow, carry, ended=True)[1]


def _settle(
    moves: Moves, machine: Machine, follow: Follow, carry: _Carry, *, ended: bool
) -> tuple[int, tuple[Moves, Ceiling]]:
    """How many of the rows no later row can change, and what becomes of these; brings `carry` up to date."""
    rows = _rows(moves, machine, follow, carry)
    road = measure(rows, _flying(moves, rows, carry.flies), carry.road, ended=ended)
    found = zones(road, rows, follow.start * rows.rise, follow.stop * rows.fall, machine.jerk, follow.peak)
    ready = ~rows.lays | road.known | (road.after >= found.need)
    done = len(moves) if ready.all() else int(ready.argmin())
    dots = dot_speed(road, rows, follow.start * rows.rise + follow.stop * rows.fall)
    out = _cut(moves[:done], rows, found, road, dots, machine, carry)
    laid = np.flatnonzero(rows.lays[:done])
    if len(laid):
        k = int(laid[-1])
        carry.road = (float(road.before[k] + rows.length[k]), bool(road.flies_in[k]))
    speaks = np.flatnonzero(rows.lays[:done] | rows.breaks[:done])
    if len(speaks):
        carry.on = bool(rows.lays[speaks[-1]])
        carry.flies = bool(_on_path(moves)[speaks[-1]])
    return done, out


def _rows(moves: Moves, machine: Machine, follow: Follow, carry: _Carry) -> Rows:
    """What the zones are found from."""
    distance = path_length(moves)
    lays = moves.deposits & (distance > 0)
    breaks = ~lays & ((distance > 0) | stops_at(moves))
    speed = np.where(lays, cruise(moves, machine)[0], 0.0)
    flow = np.where(lays, moves.e * moves.area / np.where(lays, distance, 1.0), 0.0) * speed
    return Rows(
        lays=lays, breaks=breaks, begins=_begins(lays, breaks, carry.on), length=np.where(lays, distance, 0.0),
        cruise=speed, asked=acceleration(moves, machine), flow=flow,
        rise=np.where(lays, follow.rise_at(moves.tool, flow), 0.0),
        fall=np.where(lays, follow.fall_at(moves.tool, flow), 0.0),
    )  # fmt: skip


def _on_path(moves: Moves) -> Bools:
    """Rows that may run on into the next without a stop."""
    return np.asarray((path_length(moves) > 0) & (moves.length > 0))


def _flying(moves: Moves, rows: Rows, flies: bool) -> Bools:
    """Where a road begins right behind a move along a path, and where such a move ends one."""
    flying = np.zeros(len(moves), dtype=np.bool_)
    on_path = _on_path(moves)
    speaks = np.flatnonzero(rows.lays | rows.breaks)
    if len(speaks):
        before = np.concatenate([[flies], on_path[speaks[:-1]]])
        flying[speaks] = np.where(rows.begins[speaks], before, on_path[speaks])
    return flying


def _begins(lays: Bools, breaks: Bools, on: bool) -> Bools:
    """Rows that lay and are the first to do so since a row broke the road."""
    begins = np.zeros(len(lays), dtype=np.bool_)
    speaks = np.flatnonzero(lays | breaks)
    before = np.concatenate([[on], lays[speaks[:-1]]]) if len(speaks) else np.zeros(0, dtype=np.bool_)
    begins[speaks] = lays[speaks] & ~before
    return begins


def _cut(
    moves: Moves, rows: Rows, found: Zones, road: Stretch, dots: Floats, machine: Machine, carry: _Carry
) -> tuple[Moves, Ceiling]:
    """Rows cut at the ends of their zones, and what each part may do."""
    n = len(moves)
    first, last, first_speed, last_speed = (column[:n] for column in found.edges(road, rows.length))
    zone = np.column_stack([found.head[:n], found.tail[:n], first, last])
    whole = np.column_stack([found.head_zone[:n], found.tail_zone[:n], first, last])
    accel = np.column_stack([found.head_accel[:n], found.tail_accel[:n]])
    assert zone.shape == (n, ZONES)
    source, ruler = np.empty(n * MOST, dtype=np.int64), np.empty(n * MOST, dtype=np.int64)
    low, high, limit, speed = (np.empty(n * MOST) for _ in range(4))
    made = parts_kernel(
        rows.length[:n], rows.cruise[:n], zone, whole, accel, np.column_stack([first_speed, last_speed]),
        1.0 / machine.max_lines_per_second, source, low, high, limit, speed, ruler,
    )  # fmt: skip
    speed[:made] = np.minimum(speed[:made], dots[source[:made]])
    slow = np.isfinite(speed[:made])
    parts = cut_moves(moves, source[:made], low[:made], high[:made], slow, carry.e)
    if n:
        parts = parts.replace(row=np.arange(made) + (moves.row[0] + carry.added))
        carry.e, carry.added = float(moves.e_end[-1]), carry.added + made - n
    return parts, Ceiling(limit[:made].copy(), RULERS[ruler[:made]], speed[:made].copy())
