"""Limiting: what a layer's slowing means for its lines: speed limits by partition, and one wait off the road.

    partitions |    0    |    1    |    2    |      a row that a boundary falls into is cut there, where both parts
    rows       |------|-------------|----|---|      are long enough and the limits differ
               |------|--|----------|----|---|

A partition's limit V makes it last as long as wanted: sum of length / min(v, max(V, least)) over its phases, where
`least` is what their row may not be slowed below. The wait (a G4 without a line of its own) goes behind the slicer's
retract and before what undoes it, at the highest place on the way to the first road, and there as late as can be; where
nothing lies between two roads, as in a vase, there is no such place.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bools, Floats, Ints, column_fields
from gcodectl.path import cut_moves
from gcodectl.records import Flag, Kind, Moves
from gcodectl.thermal.course import Course

SAME = 0.01
"""Limits of neighbours that differ by less than this share are one."""
LEAST = 2.0
"""Beads; the shortest part that a row is cut into."""
HALVINGS = 50


class Segments:
    """A piece's phases, cut at the boundaries of its partitions; `least`: of each row, mm/s."""

    def __init__(self, course: Course, bounds: Floats, moves: Moves, least: Floats) -> None:
        edges = np.unique(np.concatenate([course.path, bounds[1:]]))
        which = np.clip(np.searchsorted(course.path, edges, side="right") - 1, 0, len(course) - 1)
        ends = np.append(edges[1:], course.path[-1] + course.length[-1])
        self.length = np.maximum(ends - edges, 0.0)
        self.speed = course.speed[which]
        self.part = np.clip(np.searchsorted(bounds, edges, side="right") - 1, 0, len(bounds) - 1)
        self.count = len(bounds)
        laid = np.flatnonzero(moves.deposits)
        row = np.searchsorted(np.cumsum(moves.length[laid]), 0.5 * (edges + ends), side="right")
        self.least = least[laid[np.minimum(row, len(laid) - 1)]]

    def seconds(self, limit: Floats) -> Floats:
        """How long each partition's deposition lasts where nothing is faster than its limit, s."""
        slow = np.minimum(self.speed, np.maximum(limit[self.part], self.least))
        return np.asarray(np.bincount(self.part, self.length / slow, minlength=self.count), dtype=np.float64)

    @property
    def fastest(self) -> Floats:
        """The highest speed in each partition, mm/s."""
        fastest = np.zeros(self.count)
        np.maximum.at(fastest, self.part, self.speed)
        return fastest

    @property
    def slowest(self) -> Floats:
        """The lowest limit in each partition that still slows something, mm/s."""
        slowest = np.full(self.count, np.inf)
        np.minimum.at(slowest, self.part, self.least)
        return np.asarray(np.minimum(slowest, self.fastest))

    def limits(self, seconds: Floats) -> Floats:
        """The limits by which partitions last so long, mm/s; as long as they can where that is less."""
        low, high = self.slowest, self.fastest
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            late = self.seconds(middle) > seconds
            low, high = np.where(late, middle, low), np.where(late, high, middle)
        return np.asarray(high)


def merged(limits: Floats, stretch: Floats) -> Floats:
    """Limits with neighbours of about the same made one, and inf where nothing is slowed."""
    out = np.where(stretch > 1.0 + SAME, limits, np.inf)
    for j in range(1, len(out)):
        if np.isfinite(out[j - 1]) and abs(out[j] - out[j - 1]) <= SAME * out[j - 1]:
            out[j] = out[j - 1]
    return out


def limit_speeds(moves: Moves, bounds: Floats, limits: Floats, least: Floats, bead: float, e_before: float) -> Moves:
    """A piece with its partitions' limits (mm/s) in `heat`, rows cut where these change, and numbered on.

    `bounds`: where partitions begin, mm deposited since the piece's begin; `least`: of each row, no lower limit, mm/s;
    `e_before`: logical E before the piece.
    """
    lays = moves.deposits
    lengths = np.where(lays, moves.length, 0.0)
    ends = np.cumsum(lengths)
    changes = bounds[1:][limits[1:] != limits[:-1]]
    row = np.searchsorted(ends, changes)
    inside = row < len(moves)
    row, changes = row[inside], changes[inside]
    room = np.minimum(changes - (ends[row] - lengths[row]), ends[row] - changes)
    row, changes = row[room >= LEAST * bead], changes[room >= LEAST * bead]
    source, low, high = _parts(len(moves), row, (changes - (ends[row] - lengths[row])) / np.maximum(lengths[row], 1e-9))
    middle = ends[source] - lengths[source] * (1.0 - 0.5 * (low + high))
    limit = limits[np.clip(np.searchsorted(bounds, middle, side="right") - 1, 0, len(bounds) - 1)]
    limit = np.maximum(limit, least[source])
    asked = np.where(np.isnan(moves.feed), np.inf, moves.feed)[source]
    slowed: Bools = lays[source] & (limit < asked)
    parts = cut_moves(moves, source, low, high, slowed, e_before, int(moves.row[0]), Moves.empty())
    return parts.replace(heat=np.where(slowed, limit, 0.0))


def _parts(rows: int, cut: Ints, share: Floats) -> tuple[Ints, Floats, Floats]:
    """Rows with cuts at shares of their length: of each part its row, and the shares where it begins and ends."""
    counts = np.bincount(cut, minlength=rows) + 1
    source = np.repeat(np.arange(rows), counts)
    low, high = np.zeros(len(source)), np.ones(len(source))
    at = cut + np.arange(len(cut))
    high[at], low[at + 1] = share, share
    return source, low, high


def waiting_place(moves: Moves) -> int | None:
    """The row of a piece before which to wait; None where there is none off the road."""
    lays = moves.deposits
    first = int(np.argmax(lays)) if lays.any() else len(moves)
    head = moves[:first]
    pulls = np.flatnonzero((head.e < 0.0) | (head.kind == Kind.RETRACT))
    begin = int(pulls[-1]) + 1 if len(pulls) else 0
    pushes = np.flatnonzero(((head.e > 0.0) | (head.kind == Kind.UNRETRACT))[begin:])
    end = begin + int(pushes[0]) if len(pushes) else first
    flies = (head.length > 0.0) & (head.e <= 0.0)
    places = np.arange(begin, end + 1)
    # behind a retract anywhere; without one, behind a travel
    places = places[places > (begin - 1 if len(pulls) else int(np.argmax(flies)) if flies.any() else end)]
    if not len(places):
        return None
    before = np.maximum(places - 1, 0)
    height = np.where(np.isnan(moves.p1[before, 2]), -np.inf, moves.p1[before, 2])
    return int(places[np.flatnonzero(height == height.max())[-1]])


def put_wait(moves: Moves, place: int, seconds: float) -> Moves:
    """The moves with a wait of its own before the row at `place`; rows keep their numbers."""
    row = moves[place : place + 1] if place < len(moves) else moves[-1:]
    here = row.p0 if place < len(moves) else row.p1
    nothing = np.zeros(1)
    wait = row.replace(
        kind=np.array([Kind.DWELL], dtype=np.int8), p0=here, p1=here, end=row.start, e=nothing, length=nothing,
        sweep=nothing, dwell=np.array([seconds]), heat=nothing,
        flags=(row.flags | int(Flag.PART)) & ~int(Flag.GOES_ON | Flag.SETS_E),
        e_end=moves.e_end[place - 1 : place] if place else np.full(1, np.nan),
    )  # fmt: skip
    columns = {
        field.name: np.insert(getattr(moves, field.name), place, getattr(wait, field.name), axis=0)
        for field in column_fields(Moves)
    }
    return moves.replace(**columns)
