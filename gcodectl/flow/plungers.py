"""Plungers: the rates that every tool's plunger is told, decided block by block from what the roads want of each.

    wanted    ------------------------------------------------>| known
    asked     ------------------------------------------->|           what comes `delay` and `reach` later is in it
    u         --------------------------->|<-- horizon -->|
                      block   block   block

BLOCK samples are decided at a time, `horizon` more looked at, always at multiples of BLOCK since a passage began: so
any chunking gives the same signal. What is looked ahead is BLOCK + horizon + delay + reach samples at most.

What a barrel holds is carried from block to block, and kept while another tool prints; then it stands, and flows off.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.flow.asking import ask_kernel
from gcodectl.flow.course import COURSE, DELAY, HORIZON, LEVELS, PLACES, RATE, REACH, SMOOTH, TABLE, WORK
from gcodectl.flow.flow_model import DRIVE, DRIVE_RATE, PLACE, STATE, STORE, STORED, SWING, K
from gcodectl.flow.pursuit import follow_kernel, stand_kernel
from gcodectl.flow.slewing import lay_course_kernel
from gcodectl.flow.swing import against_swing_kernel
from gcodectl.jit import jit_lean

if TYPE_CHECKING:
    from gcodectl.flow.inversion import Inversion

BLOCK = 512
NODES = 1024
"""Stored volumes that an inversion's table knows."""
LONGEST_REST = 6000
"""Samples after which a barrel that nobody pushes does not change any more."""
STILL = 1e-9
"""Share of the store that a barrel at rest changes by in a sample."""
NEVER = 1 << 60
WANTED, U, GRID = 0, 4, 5
"""Rows of the grid: what is wanted, asked, its goals, the rates that follow them, and u."""
LAST, AT, BARREL = range(STATE, STATE + 3)
"""Places in a barrel's row: its state, the rate last told, and at which sample."""
FIRST, DECIDED, ASKED, PASSAGE, CARRY = range(5)
"""Places in what is carried from chunk to chunk: the first sample kept, up to where rates are decided, and what is
asked known; the passage decided in."""


@jit_lean
def rest_kernel(barrel: Floats, until: int, p: Floats) -> None:
    """Let a barrel stand until sample `until`, or until it does not change any more."""
    if until - barrel[AT] > 0:
        barrel[AT] = max(barrel[AT], float(until - LONGEST_REST))
    while barrel[AT] < until:
        change = stand_kernel(barrel, 0.0, barrel[LAST], p)
        still = (
            barrel[LAST] == 0.0
            and abs(change) + abs(barrel[DRIVE]) + abs(barrel[DRIVE_RATE]) * p[SWING] < STILL * p[STORE]
        )
        barrel[LAST] = 0.0
        barrel[AT] = float(until) if still else barrel[AT] + 1.0


@jit_lean
def block_kernel(
    asked: Floats, goals: Floats, rates: Floats, decided: int, n: int, p: Floats, table: Floats,
    weights: Floats, barrel: Floats, work: Floats, cheapest: Floats,
) -> None:  # fmt: skip
    """Fill row RATE of `work` with the first `decided` rates of n samples asked for, and advance the barrel."""
    last = barrel[LAST] if p[SWING] == 0.0 else barrel[DRIVE]
    work[COURSE, 0] = barrel[STORED]
    lay_course_kernel(asked, goals, rates, decided, n, last, p, table, work, cheapest)
    if p[SWING] == 0.0:
        barrel[LAST] = follow_kernel(asked, goals, rates, decided, p, work, barrel, last)
    else:
        stored, place = barrel[STORED], barrel[PLACE]
        follow_kernel(asked, goals, rates, decided + int(p[SMOOTH]), p, work, barrel, last)
        barrel[STORED], barrel[PLACE] = stored, place
        against_swing_kernel(decided, p, weights, barrel, work)
        for k in range(decided):
            stand_kernel(barrel, work[RATE, k], barrel[LAST], p)
            barrel[LAST] = work[RATE, k]
    barrel[AT] += decided


@jit_lean
def decide_kernel(
    wanted: Floats, asked: Floats, goals: Floats, rates: Floats, u: Floats, passages: Ints, known: int, ended: bool,
    rows: Floats, tables: Floats, weights: Floats, barrels: Floats, work: Floats, cheapest: Floats, carry: Ints,
) -> None:  # fmt: skip
    """Decide u for every block whose horizon lies before sample `known`, from carry[DECIDED] on.

    passages[n] are its first sample and its tool. The rows of the grid begin with sample carry[FIRST].
    """
    first = carry[FIRST]
    while carry[DECIDED] < known or (ended and carry[DECIDED] <= known):
        decided = carry[DECIDED]
        while carry[PASSAGE] + 1 < len(passages) and passages[carry[PASSAGE] + 1, 0] <= decided:
            carry[PASSAGE] += 1
            carry[ASKED] = decided
        begin, tool = passages[carry[PASSAGE], 0], min(max(passages[carry[PASSAGE], 1], 0), len(rows) - 1)
        p, barrel = rows[tool], barrels[tool]
        wall = known + 1 if ended else NEVER
        if carry[PASSAGE] + 1 < len(passages):
            wall = passages[carry[PASSAGE] + 1, 0]
        done = begin + ((decided - begin) // BLOCK + 1) * BLOCK
        sees = done + int(p[HORIZON])
        if wall == NEVER and sees + int(p[DELAY]) + 2 + int(p[REACH]) > known:
            return
        done = min(done, wall)
        if p[K] == 0.0:  # it obeys at once
            for k in range(decided - first, done - first):
                u[k] = wanted[k]
        else:
            ask_kernel(
                wanted, begin - first, wall - first, carry[ASKED] - first, sees + 1 - first, p, asked, goals, rates,
                work,
            )  # fmt: skip
            carry[ASKED] = sees + 1
            rest_kernel(barrel, decided, p)
            at = decided - first
            block_kernel(
                asked[at:], goals[at:], rates[at:], done - decided, sees - decided, p, tables[tool], weights[tool],
                barrel, work, cheapest,
            )  # fmt: skip
            told = u[at:]
            for k in range(done - decided):
                told[k] = work[RATE, k]
        carry[DECIDED] = done


class Plungers:
    """The grid of samples under way, and the plungers of all tools, None for one that obeys at once."""

    def __init__(self, inversions: Sequence[Inversion | None], tool: int) -> None:
        tools, known = len(inversions), [one for one in inversions if one]
        self._rows, self._tables = np.zeros((tools, PLACES)), np.zeros((tools, NODES, TABLE))
        self._weights = np.zeros((tools, max((one.smooth for one in known), default=1)))
        self.barrels = np.zeros((tools, BARREL))
        for k, one in enumerate(inversions):
            if one is not None:
                self._rows[k], self._tables[k] = one.row, one.table
                self._weights[k, : one.smooth - 1] = one.weights
                self.barrels[k, :STATE] = one.model.at_rest
                # one without a yield stress waits as it is, and is not drawn back
                self.barrels[k, STORED] = min(self.barrels[k, STORED], one.rest)
        self._beyond = max((one.horizon for one in known), default=0) + BLOCK + 2
        self._back = max((one.reach for one in known), default=0) + 1
        self._work, self._cheapest = (
            np.zeros((WORK, self._beyond + self._weights.shape[1] + 4)),
            np.zeros((self._beyond, LEVELS)),
        )
        self._carry = np.zeros(CARRY, dtype=np.int64)
        self._passages = np.array([[0, tool]], dtype=np.int64)
        self._grid = np.zeros((GRID, 0))
        self._used = 0

    @property
    def first(self) -> int:
        """Number of the first sample that is kept."""
        return int(self._carry[FIRST])

    @property
    def decided(self) -> int:
        """Up to which sample rates are decided."""
        return int(self._carry[DECIDED])

    @property
    def wanted(self) -> Floats:
        """The flow wanted, from sample `first` on, mm^3/s."""
        return np.asarray(self._grid[WANTED])

    @property
    def u(self) -> Floats:
        """The rates told, from sample `first` on, mm^3/s."""
        return np.asarray(self._grid[U])

    def grow(self, samples: int) -> None:
        """Make room for this many samples from the start of time."""
        needed, there = samples - self.first + self._beyond, self._grid.shape[1]
        if needed > there:
            grown = np.zeros((GRID, max(needed, there + there // 2)))
            grown[:, :there] = self._grid
            self._grid = grown
        self._used = max(self._used, needed)

    def begin_passages(self, begins: Ints, tools: Ints) -> None:
        """Take the first samples of passages to come, in order, and their tools."""
        self._passages = np.concatenate([self._passages, np.stack([begins, tools], axis=1)])

    def decide(self, known: int, *, ended: bool) -> None:
        """Decide the rates of every block that no sample from `known` on counts for; of all where it `ended`."""
        wanted, asked, goals, rates, u = self._grid
        decide_kernel(
            wanted, asked, goals, rates, u, self._passages, known, ended, self._rows, self._tables, self._weights,
            self.barrels, self._work, self._cheapest, self._carry,
        )  # fmt: skip
        self._passages = self._passages[self._carry[PASSAGE] :].copy()
        self._carry[PASSAGE] = 0

    def forget(self, before: int) -> None:
        """Let go of samples before `before`, but for what blocks look back at; what follows moves to their place."""
        gone = min(before, self.decided) - self._back - self.first
        if gone > 4096:
            left = self._used - gone
            self._grid[:, :left] = self._grid[:, gone : self._used]
            self._grid[WANTED, left : self._used] = 0.0  # flow is added there; all else is written before it is read
            self._used = left
            self._carry[FIRST] += gone
