"""The heat stage: moves in, moves out, slowed and waited for so that roads come to lie on a surface they bond with.

    moves -> pieces -> what lies beneath, when it was laid -> how much slower, how long to wait -> limits, a G4 -> moves
             pieces    beneath, locations                     slowing                              limiting

Time is the motion plan's own: `clock` plans a piece's rows from rest to rest, once as they came and once as they were
slowed; if more is found too hot then than the choice left so, the wait is lengthened until no more is. What is too cold
is not mended by slowing, and what is hottest is not waited for until most of a layer is too cold: both are counted. One
piece is held back, and a surface as large as the part's footprint is kept.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from itertools import chain

import numpy as np

from gcodectl.columns import Floats
from gcodectl.records import Moves
from gcodectl.thermal.beneath import B0, B1, SLICED, Ground, S, T
from gcodectl.thermal.course import Course
from gcodectl.thermal.limiting import Segments, limit_speeds, merged, put_wait, waiting_place
from gcodectl.thermal.locations import cooling, corners
from gcodectl.thermal.pieces import MOST_ROWS, Piece, pieces
from gcodectl.thermal.profile import WIDER, HeatProfile
from gcodectl.thermal.slowing import Layer, Slowing, slow_layer
from gcodectl.thermal.surface import seconds_to
from gcodectl.thermal.tally import Tally

Clock = Callable[[Moves], Course]
"""The course of some rows, from rest to rest."""
PARTITIONS = 16
"""Of a piece, at the most."""
SHORTEST = 4.0
"""Beads; the least that a partition is long."""
SLOWEST = 0.5
"""Share of what the file asks for, and the machine can do, that each row may be slowed to; where no profile says."""
CLOSE = 0.05
"""s; a wait as short is none."""


def heat(
    chunks: Iterable[Moves], profile: HeatProfile, nozzle: float, clock: Clock, tally: Tally | None = None
) -> Iterator[Moves]:
    """Slow a stream of moves, and put waits into it, as `profile` asks for; later rows are numbered on."""
    bead, chunks = (profile.bead, chunks) if profile.bead else _first_width(chunks, WIDER * nozzle)
    tally = tally if tally is not None else Tally(profile.band)
    tally.bead, tally.slowest = bead, profile.head.slowest if profile.head else 0.0
    stage = _Stage(profile, bead, clock, tally)
    added, e_before = 0, np.nan
    for piece in pieces(chunks, bead):
        row0 = int(piece.moves.row[0])
        out = stage.treat(piece, e_before)
        e_before = float(piece.moves.e_end[-1])
        yield out.replace(row=np.arange(len(out)) + row0 + added)
        added += len(out) - len(piece.moves)


def _first_width(chunks: Iterable[Moves], otherwise: float) -> tuple[float, Iterable[Moves]]:
    """How wide the slicer marks the first road, mm, if it does so in the first MOST_ROWS rows; and the chunks again."""
    stream, seen, rows = iter(chunks), [], 0
    for chunk in stream:
        seen.append(chunk)
        lays = np.flatnonzero(chunk.deposits)
        if len(lays):
            width = float(chunk.width[lays[0]])
            marked = rows + int(lays[0]) < MOST_ROWS and width > 0.0
            return (width if marked else otherwise), chain(seen, stream)
        if (rows := rows + len(chunk)) >= MOST_ROWS:
            break
    return otherwise, chain(seen, stream)


@dataclasses.dataclass
class _Stage:
    """What goes on from piece to piece."""

    profile: HeatProfile
    bead: float
    clock: Clock
    tally: Tally

    def __post_init__(self) -> None:
        self.ground = Ground(self.bead)
        self.now = self.sliced = 0.0
        """When the next piece begins, and would begin as sliced, s."""

    def treat(self, piece: Piece, e_before: float) -> Moves:
        """Slow a piece; takes note of it."""
        moves, places = piece.moves, piece.locations
        course = self.clock(moves)
        if not len(places) or not len(course):
            self.now, self.sliced = self.now + course.lasts, self.sliced + course.lasts
            return moves
        cooling(places, corners(moves, piece.path), self.profile)
        path = places[:, S] - piece.path
        ground = self.ground.find(places)
        place = waiting_place(moves) if piece.begins else None
        out, slowing = self._slowed(piece, course, ground, place is not None, e_before)
        final = self.clock(out) if out is not moves else course
        places[:, SLICED] = self.sliced + course.when(path)
        places[:, T] = self.now + final.when(path)
        wait = 0.0
        if place is not None:
            wait = slowing.wait + self._too_soon(ground, places[:, T] + slowing.wait, slowing.hot)
            wait = wait if wait > CLOSE else 0.0
        if place is not None and wait:
            places[:, T] += wait
            out = put_wait(out, place, wait)  # rows before the first road are as they were
        self.now += final.lasts + wait
        self.sliced += course.lasts
        self.ground.lay(places)
        self.tally.fastest = max(self.tally.fastest, float(course.speed.max()))
        self.tally.add(piece, ground, places, course.lasts, final.lasts, wait if place is not None else None)
        return out

    def _slowed(
        self, piece: Piece, course: Course, ground: Floats, may_wait: bool, e_before: float
    ) -> tuple[Moves, Slowing]:
        """A piece with its speed limits."""
        places = piece.locations
        path = places[:, S] - piece.path
        bounds = self._bounds(course)
        least = self._least(piece.moves, float(course.speed.max()))
        segments = Segments(course, bounds, piece.moves, least)
        dep0, fix0 = course.at(bounds)
        dep0[0] = fix0[0] = 0.0
        deposited, other = course.at(path)
        part = np.clip(np.searchsorted(bounds, path, side="right") - 1, 0, len(bounds) - 1)
        laid = segments.seconds(np.full(len(bounds), np.inf))
        layer = Layer(
            part=part, dep=np.maximum(deposited - dep0[part], 0.0), fix=np.maximum(other - fix0[part], 0.0),
            part_dep=laid, part_fix=np.diff(np.append(fix0, course.lasts - course.duration.sum())),
            most=np.maximum(segments.seconds(np.zeros(len(bounds))) / np.maximum(laid, 1e-9), 1.0),
            b0=ground[:, B0], b1=ground[:, B1], since=ground[:, T] - self.now,
            cools=self._cools(places),
        )  # fmt: skip
        profile, most_wait = self.profile, np.inf if may_wait else 0.0
        slowing = slow_layer(layer, profile.band, profile.hottest, profile.time, profile.alpha, most_wait)
        limits = merged(segments.limits(slowing.stretch * laid), slowing.stretch)
        if not np.isfinite(limits).any():
            return piece.moves, slowing
        return limit_speeds(piece.moves, bounds, limits, least, self.bead, e_before), slowing

    def _least(self, moves: Moves, fastest: float) -> Floats:
        """What each row may not be slowed below, mm/s; `fastest`: what the piece comes to anywhere."""
        if self.profile.head:
            return np.full(len(moves), self.profile.head.slowest)
        return np.asarray(SLOWEST * np.fmin(moves.feed, fastest))

    def _cools(self, places: Floats) -> float:
        """How long the middle one of a piece's own locations takes to the best temperature, s; inf if it never does."""
        band = self.profile.band
        rest = band.ambient - places[:, B0] / places[:, B1]
        cools = np.full(len(places), np.inf)
        some = places[rest < band.best]
        cools[rest < band.best] = seconds_to(band.best, some[:, B0], some[:, B1], band.ambient, band.deposition)
        return float(np.median(cools))

    def _bounds(self, course: Course) -> Floats:
        """Where partitions of about the same time begin, mm from the piece's begin."""
        laid = float(course.duration.sum())
        count = int(np.clip(course.end / (SHORTEST * self.bead), 1, PARTITIONS))
        return course.where(np.linspace(0.0, laid, count, endpoint=False))

    def _too_soon(self, ground: Floats, laid: Floats, hot: int) -> float:
        """By how much a piece comes too soon for all but the `hot` hottest locations beneath it, s."""
        beneath = np.isfinite(ground[:, T])
        if beneath.sum() <= hot:
            return 0.0
        some, band = ground[beneath], self.profile.band
        cooled = some[:, T] + seconds_to(self.profile.hottest, some[:, B0], some[:, B1], band.ambient, band.deposition)
        return max(0.0, float(np.sort(cooled - laid[beneath])[-1 - hot]))
