"""The planner's ring: a few blocks of motion, planned anew with every one that comes.

Theory. In v^2 every limit is a straight line of slope 2a (see `plant_models.planner`). A firmware sees only the blocks
in its ring, and must be able to stand still at the end of the last: so the end of what is known is a wall that every
new block pushes further away.

      v^2 |        junction limits J_i, cut backward (braking) from the wall
          |      ____ J1        \\
          |     /    |____J2     \\ |     a new block moves the wall to the right: only blocks that brake
          |    /     |    \\_______\\|     because of it can change
          +---|------|-----|------|---> s
            begun  block  block  wall
           (fixed)

Rules:
1. A block that has begun is fixed, and with it the speed at which the next one is entered.
2. `back` of a block is the highest entry v^2 from which all that follows can still stop at the wall:
   back_i = min(J_i, back_{i+1} + 2 a_i L_i), the wall's is 0. When a block is added, go backward until a `back` stays
   as it was: nothing before it can change.
3. Forward needs no pass of its own: a block that begins at v0 ends at min(back_{i+1}, v0^2 + 2 a L), and that is all
   that is ever fixed. What Marlin's forward pass finds for the blocks behind, it finds again when they begin.
4. A ring of n places holds n - 1 blocks, the one that runs among them, as Marlin's (head == tail is empty).

Source: Marlin module/planner.cpp (recalculate, reverse_pass_kernel, forward_pass_kernel) and planner.h (moves_free);
the ring itself is grbl's. Junctions as the whole-file planner takes them (`planner.corner_kernel`).
The ring stays plain Python, its corner law compiled: a compiled ring on arrays costs about as much to add to and read.
"""

from __future__ import annotations

import math
from collections import deque

from plant_models.gantry import PATH
from plant_models.planner import corner_kernel
from plant_models.printer.chords import Point

SHORTEST = 1e-12
"""s; a shorter phase is none."""


class Block:
    """One straight move, or one of E alone, with its limits; `back` and the links are the ring's."""

    __slots__ = (
        "accel", "advance", "area", "back", "broken", "corner", "e", "e_after", "e_before", "e_corner", "end", "kind",
        "length", "limit", "line", "next", "previous", "ratio", "rest", "speed", "start", "tool", "way",
    )  # fmt: skip

    def __init__(
        self, kind: int, start: Point, end: Point, way: Point, length: float, e: float, speed: float, accel: float
    ) -> None:
        self.kind, self.start, self.end, self.length, self.e = kind, start, end, length, e
        self.way = way
        """Unit direction; zeros for a move of E alone."""
        self.ratio = e / length if kind == PATH else 0.0
        """mm of E a mm of path."""
        self.speed, self.accel = speed, accel
        self.corner = self.e_corner = math.inf
        self.rest = self.broken = False
        self.area, self.advance, self.tool, self.line = 1.0, 0.0, 0, 0
        self.e_before = self.e_after = 0.0
        """Logical E at its ends, mm."""
        self.limit = self.back = 0.0
        """v^2 at its start: by its corner, and from where all can still stop."""
        self.previous: Block | None = None
        self.next: Block | None = None


class Ring:
    """The blocks that have not begun, in order, and the speed at which the first of them will be entered."""

    def __init__(self, places: int, classic: bool) -> None:
        assert places > 3, "a planner with fewer than three blocks plans nothing"
        self.waiting: deque[Block] = deque()
        self.seconds = 0.0
        """How long the waiting blocks take at the speeds asked for: less than they will take."""
        self._room, self._classic = places - 1, classic
        self._entry = 0.0
        self._last: Block | None = None

    def free(self, running: bool) -> int:
        """Return how many more blocks there is room for."""
        return self._room - len(self.waiting) - running

    def add(self, block: Block) -> None:
        """Take a block behind all others, and plan anew."""
        last, self._last = self._last, block
        block.limit = 0.0 if last is None else self._junction(last, block)
        if self.waiting:
            block.previous, self.waiting[-1].next = self.waiting[-1], block
        self.waiting.append(block)
        self.seconds += block.length / block.speed
        beyond, one = 0.0, block
        while True:
            back = min(one.limit, beyond + 2.0 * one.accel * one.length)
            if back == one.back:
                break
            one.back = beyond = back
            if one.previous is None:
                break
            one = one.previous

    def begin(self) -> tuple[Block, float, float]:
        """Take the first block out to be run; return it with the v^2 at its start and at its end, fixed from now on."""
        block = self.waiting.popleft()
        self.seconds = self.seconds - block.length / block.speed if self.waiting else 0.0
        entry, behind = self._entry, block.next
        if behind is None:
            self._entry = 0.0
        else:
            self._entry = min(behind.back, entry + 2.0 * block.accel * block.length)
            behind.previous = block.next = None
        return block, entry, self._entry

    def clear(self) -> None:
        """Drop all that waits; what comes next begins at rest."""
        self.waiting.clear()
        self.seconds = self._entry = 0.0
        self._last = None

    def _junction(self, last: Block, block: Block) -> float:
        if block.rest or block.kind != PATH or last.kind != PATH:
            return 0.0
        (x0, y0, z0), (x1, y1, z1) = last.way, block.way
        return corner_kernel(
            x0, y0, z0, x1, y1, z1, last.ratio, block.ratio, last.length * last.accel, block.length * block.accel,
            min(last.speed, block.speed), min(last.corner, block.corner), block.e_corner, self._classic,
        )  # fmt: skip


def phases_of(block: Block, entry: float, leave: float) -> list[tuple[float, float, float, float]]:
    """Return (duration, s, v, a) of the phases of a block entered and left at these v^2: speeding up, even, braking."""
    length, accel = block.length, block.accel
    peak2 = 0.5 * (entry + leave) + accel * length
    if peak2 > block.speed**2:
        peak2 = block.speed**2
    peak2 = max(peak2, entry, leave)
    peak, v0, v1 = math.sqrt(peak2), math.sqrt(entry), math.sqrt(leave)
    rise = (peak2 - entry) / (2.0 * accel)
    flat = length - rise - (peak2 - leave) / (2.0 * accel)
    phases = []
    if (took := (peak - v0) / accel) > SHORTEST:
        phases.append((took, 0.0, v0, accel))
    if (took := flat / peak) > SHORTEST:
        phases.append((took, rise, peak, 0.0))
    if (took := (peak - v1) / accel) > SHORTEST:
        phases.append((took, rise + max(flat, 0.0), peak, -accel))
    return phases
