"""Pieces: a file cut where a road comes to lie on another, which is what a layer is for heat.

    side view     ==================   <- the first road that lies over one of its own piece begins the next
                  ------------------      piece, as does one of another layer behind a step in height
                  travel, retract, G4 of the slicer: belong to the roads that come after them

Marks do not decide: a vase has them while its height never steps, other files have none, or one for the whole part.
What never lies on itself (a drawing, a raft of a square metre) is cut after MOST_ROWS rows or MOST_LOCATIONS locations,
as are so many rows without a road; there no wait may be put.

A piece leaves when the road that ends it has come, so one piece is held back, in whatever chunks the file comes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.records import Moves
from gcodectl.thermal.beneath import HELD, Ground
from gcodectl.thermal.locations import Sampler

MOST_ROWS = 20_000
MOST_LOCATIONS = 50_000
STEP = 1e-6
"""mm of height that are a step."""


@dataclasses.dataclass(frozen=True)
class Piece:
    """Rows that are planned as one; the last of them deposits, but in the file's last piece."""

    moves: Moves
    locations: Floats
    """See `beneath`; shape (n, HELD)."""
    path: float
    """mm deposited before it."""
    begins: bool
    """Whether a layer begins here, not only another piece of one."""


def pieces(chunks: Iterable[Moves], bead: float) -> Iterator[Piece]:
    """Cut a stream of moves into pieces; `bead` in mm."""
    sampler, cutter = Sampler(0.5 * bead), _Cutter(bead)
    for chunk in chunks:
        yield from cutter.add(chunk, *sampler.sample(chunk))
    if len(cutter.moves):
        yield cutter.rest()


class _Cutter:
    """Rows that have come and not left, and how far they have been looked at."""

    def __init__(self, bead: float) -> None:
        self.own = Ground(bead)
        self.moves, self.locations = Moves.empty(), np.zeros((0, HELD))
        self.rows: Ints = np.zeros(0, dtype=np.int64)
        """The row in `moves` of each location."""
        self.path, self.begins = 0.0, True
        self.seen = 0
        """Locations that have been looked at."""

    def add(self, chunk: Moves, locations: Floats, rows: Ints) -> Iterator[Piece]:
        """Take a chunk; yields the pieces that it ends."""
        self.rows = np.concatenate([self.rows, rows + len(self.moves)])
        self.locations = np.concatenate([self.locations, locations])
        self.moves = Moves.concat([self.moves, chunk]) if len(self.moves) else chunk
        while (found := self._next_road()) is not None:
            yield self._cut(*found)

    def rest(self) -> Piece:
        """What is left when the file ends."""
        return Piece(self.moves, self.locations, self.path, self.begins)

    def _next_road(self) -> tuple[int, bool] | None:
        """The row before which the piece ends, and whether a layer begins there; None while none has come."""
        lays = np.flatnonzero(self.moves.deposits)
        stop, begins = self._next_stop(lays)
        end = int(np.searchsorted(self.rows, stop))
        while self.seen < end:
            self.seen = self.own.over(self.locations, self.seen, end)
            if self.seen < end and self.rows[self.seen] > lays[0]:
                return int(self.rows[self.seen]), True
            self.seen += self.seen < end  # a row that lies on itself cannot be cut
        return (stop, begins) if stop < len(self.moves) else None

    def _next_stop(self, lays: Ints) -> tuple[int, bool]:
        """The row before which to cut if no road lies on another, and whether a layer begins there."""
        moves, most = self.moves, len(self.moves)
        ends = np.concatenate([[-1], lays, [most]])
        idle = ends[:-1][np.diff(ends) > MOST_ROWS + 1]
        stops = [int(idle[0]) + 1 + MOST_ROWS] if len(idle) else []
        stops += lays[1:][lays[1:] >= MOST_ROWS][:1].tolist()
        if len(self.rows) > MOST_LOCATIONS:
            stops += lays[1:][lays[1:] >= self.rows[MOST_LOCATIONS]][:1].tolist()
        layer, z0, z1 = moves.layer[lays], moves.p0[lays, 2], moves.p1[lays, 2]
        step = lays[1:][(layer[1:] != layer[:-1]) & (np.abs(z0[1:] - z1[:-1]) > STEP)]
        first = int(step[0]) if len(step) else most
        return min([first, *stops]), all(first <= stop for stop in stops)

    def _cut(self, row: int, begins: bool) -> Piece:
        """Let the piece before `row` go: it ends with the last road before that, where a road begins there."""
        lays = self.moves.deposits
        end = int(np.flatnonzero(lays[:row])[-1]) + 1 if lays[row] else row
        known = int(np.searchsorted(self.rows, row))
        piece = Piece(self.moves[:end], self.locations[:known], self.path, self.begins)
        laid = np.where(lays[:end], self.moves.length[:end], 0.0)
        self.path = float(np.cumsum(np.concatenate([[self.path], laid]))[-1])  # one by one, as the sampler adds
        self.moves, self.locations, self.rows = self.moves[end:], self.locations[known:], self.rows[known:] - end
        self.seen, self.begins = 0, begins
        self.own.clear()
        return piece
