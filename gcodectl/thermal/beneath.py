"""Beneath: the part's uppermost surface while it grows, place by place, and what of it a new road comes to lie on.

    from above: a grid of half a bead               from the side:   z
        . . . . . .                                                   |  ___o___   new location
        . # # # # .    each cell keeps the                            | |       |     flat < dz <= bead: beneath it
        . # o . # .    location laid there last                       | |_______|     dz <= flat: beside it
        . # # # # .                                                   |               dz > bead: a bridge over it

What was laid last within half a bead's width of a location is beneath it: that is what the nozzle covers, and what is
hottest there (a road that passed twice, crossing infill). Where that holds nothing, the nearest within a bead's width
is; else there is nothing (the plate, a bridge), and no limit. The path's own last MEMORY beads do not count: a road
that climbs is not beneath itself.

Open addressing, linear probing: memory grows with the footprint of the part, not with its height, up to MOST cells;
then the half that was laid longest ago is forgotten.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean

X, Y, Z, S, T, SLICED, B0, B1, HELD = range(9)
"""Of a location: mm; path from the start of the file, mm; when it was laid, and would be as sliced, s; how it cools."""
EMPTY = -1
FLAT = 0.1
"""Beads of height by which what lies lower is beneath, not beside."""
MEMORY = 4.0
"""Beads of path."""
MOST = 500_000
OFFSET = 1 << 30


@jit_lean
def slot_kernel(keys: Ints, column: int, line: int) -> int:
    """The slot of a cell: its own, or the empty one where it would go."""
    key = (column + OFFSET) * (1 << 31) + (line + OFFSET)
    mask = len(keys) - 1
    slot = ((column * 73856093) ^ (line * 19349663)) & mask
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@jit_lean
def lay_kernel(keys: Ints, held: Floats, location: Floats, cell: float) -> int:
    """Put a location into its cell; returns how many cells more are in use."""
    column, line = int(math.floor(location[X] / cell)), int(math.floor(location[Y] / cell))
    slot = slot_kernel(keys, column, line)
    more = 1 if keys[slot] == EMPTY else 0
    keys[slot] = (column + OFFSET) * (1 << 31) + (line + OFFSET)
    for k in range(HELD):
        held[slot, k] = location[k]
    return more


@jit_lean
def beneath_kernel(keys: Ints, held: Floats, location: Floats, bead: float) -> int:
    """The slot of what lies beneath a location, or -1."""
    cell = 0.5 * bead
    column, line = int(math.floor(location[X] / cell)), int(math.floor(location[Y] / cell))
    found, distance, laid = -1, bead * bead, -math.inf
    for i in range(column - 2, column + 3):
        for j in range(line - 2, line + 3):
            slot = slot_kernel(keys, i, j)
            if keys[slot] == EMPTY:
                continue
            drop = location[Z] - held[slot, Z]
            if not FLAT * bead < drop <= bead or location[S] - held[slot, S] <= MEMORY * bead:
                continue
            away = (location[X] - held[slot, X]) ** 2 + (location[Y] - held[slot, Y]) ** 2
            if away <= cell * cell:
                if held[slot, S] > laid:
                    found, laid = slot, held[slot, S]
            elif away <= distance and laid == -math.inf:
                found, distance = slot, away
    return found


@jit_lean
def find_kernel(keys: Ints, held: Floats, locations: Floats, bead: float, found: Ints) -> None:
    """Fill `found` with what lies beneath each location, -1 for nothing."""
    for i in range(len(locations)):
        found[i] = beneath_kernel(keys, held, locations[i], bead)


@jit_lean
def over_kernel(keys: Ints, held: Floats, locations: Floats, bead: float, begin: int, end: int) -> tuple[int, int]:
    """Lay locations until one lies over another: (that one, or `end`; cells more)."""
    cells = 0
    for i in range(begin, end):
        if beneath_kernel(keys, held, locations[i], bead) >= 0:
            return i, cells
        cells += lay_kernel(keys, held, locations[i], 0.5 * bead)
    return end, cells


@jit_lean
def lay_all_kernel(keys: Ints, held: Floats, locations: Floats, cell: float) -> int:
    """Lay locations in order; returns how many cells more are in use."""
    cells = 0
    for i in range(len(locations)):
        cells += lay_kernel(keys, held, locations[i], cell)
    return cells


class Ground:
    """What was laid last at each place."""

    def __init__(self, bead: float) -> None:
        self.bead = bead
        self._cells = 0
        self._table(1 << 12)

    def _table(self, size: int) -> None:
        self._keys: Ints = np.full(size, EMPTY, dtype=np.int64)
        self._held: Floats = np.zeros((size, HELD))

    def _room(self, more: int) -> None:
        """Make room for so many cells more."""
        needed = self._cells + more
        if 2 * needed <= len(self._keys):
            return
        kept = self._held[self._keys != EMPTY]
        if len(kept) > MOST:
            kept = kept[np.argsort(kept[:, S], kind="stable")[len(kept) // 2 :]]
        self._table(1 << max(12, math.ceil(math.log2(4 * (len(kept) + more)))))
        self._cells = lay_all_kernel(self._keys, self._held, kept, 0.5 * self.bead)

    def lay(self, locations: Floats) -> None:
        """Lay locations, shape (n, HELD), in order."""
        self._room(len(locations))
        self._cells += lay_all_kernel(self._keys, self._held, locations, 0.5 * self.bead)

    def find(self, locations: Floats) -> Floats:
        """What lies beneath each location, shape (n, HELD); NaN for nothing."""
        found = np.empty(len(locations), dtype=np.int64)
        find_kernel(self._keys, self._held, locations, self.bead, found)
        return np.where((found >= 0)[:, None], self._held[found], np.nan)

    def over(self, locations: Floats, begin: int, end: int) -> int:
        """Lay locations begin to end until one lies over another of them; returns that one, or `end`."""
        self._room(end - begin)
        stop, cells = over_kernel(self._keys, self._held, locations, self.bead, begin, end)
        self._cells += cells
        return stop

    def clear(self) -> None:
        """Forget everything."""
        self._cells = 0
        if len(self._keys) > 1 << 16:
            self._table(1 << 12)
        self._keys.fill(EMPTY)
