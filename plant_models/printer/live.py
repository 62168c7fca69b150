"""The live firmware: commands one at a time, a ring that plans as it goes, and what was executed.

    take(text) -> state -> pieces -> ring (15 blocks) -> the one that runs -> record -> execution()
                             ^ wait for room    |
                  Halt: waits until the ring is empty, then stands still

Rules (Marlin, module/planner.cpp and stepper.cpp):
1. A command is done when its last piece is in the ring; G4, M400, G28, M84 and a tool change when all is at rest (and
   the dwell over).
2. An idle planner begins when three blocks wait, or 0.1 s after the first of them came (get_current_block,
   BLOCK_DELAY_FOR_1ST_MOVE). Marlin lets a synchronize() wait for that 0.1 s; here it does not.
3. A block that ends makes room at once, and the next one begins at the same instant.
4. A ring that empties though the last command did not ask for it (a Halt, or one that waits elsewhere, as M109) has
   starved the machine, if more motion comes: it stands, and says so.

5. Where `slowdown` is given (or M205 B): a block that would be quicker than that is planned slower while the ring is
   less than half full, the more so the emptier it is (SLOWDOWN; Marlin ships 0.02 s). Off unless asked for: the
   whole-file planner, which simulates the same print, knows no ring.

What it leaves out on purpose: homing moves and their time, M207's hop of Z, refusing cold and too long extrusions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from gcodectl.config import Machine
from plant_models.firmware import Execution
from plant_models.gantry import Firmware
from plant_models.printer.pieces import blocks_of
from plant_models.printer.record import Record
from plant_models.printer.ring import Block, Ring, phases_of
from plant_models.printer.state import Halt, Motion, State

FIRST = 3
"""Blocks that make an idle planner begin."""
DELAY = 0.1
"""s that it waits for them."""


class Live:
    """A firmware from the line on: call `advance` to the time at hand, and `take` only when `ready`."""

    def __init__(
        self, machine: Machine, firmware: Firmware, *, blocks: int = 16, first: int = FIRST, slowdown: float = 0.0
    ) -> None:
        self._state = State(machine, firmware)
        self._state.limits.least_time = slowdown
        self._half = blocks // 2
        self._ring = Ring(blocks, firmware.junction == "jerk")
        self._record = Record()
        self._first = first
        self._now = 0.0
        self._line = 0
        self._running: Block | None = None
        self._until = math.inf
        """When what runs (a block, a dwell) ends; inf when nothing does."""
        self._start = math.inf
        """When an idle planner begins what waits."""
        self._halt: Halt | None = None
        self._pieces: Iterator[Block] = iter(())
        self._piece: Block | None = None
        """The next piece, cut, of the command that is being put into the ring; None when it is all there."""
        self.starved: list[tuple[float, float]] = []
        """(when, for how long) the planner ran dry though nothing had asked for it, s."""
        self.least_buffered = math.inf
        """Least seconds of motion in the ring between two moves that no halt lies between, at the speeds asked for."""
        self._low = math.inf
        self._filling = True
        self._dry: tuple[float, float] | None = None
        """Since when the ring has been dry unasked, and until when (inf: still)."""
        self._excused = False
        """A command that waits came after the last move: what runs dry behind it is not starved."""

    def take(self, text: bytes, now: float) -> None:
        """Take the next command (no line number, no checksum) at `now`, s."""
        assert self.ready(), "the command before is not done"
        self.advance(now)
        self._line += 1
        order = self._state.read(text)
        if isinstance(order, Motion):
            self._pieces = blocks_of(order, self._state, self._line)
            self._piece = next(self._pieces, None)
            self._fill()
        elif isinstance(order, Halt):
            self._halt = order
            self._excuse()
            if self._running is None and self._ring.waiting:
                self._begin()
            self._settle()
        elif self._state.waits:
            self._state.waits = False
            self._excuse()

    def ready(self) -> bool:
        """Whether the last command is done, so that the next may be taken."""
        return self._halt is None and self._piece is None

    def advance(self, now: float) -> None:
        """Let time pass until `now`, s; time that has passed already stays so."""
        while (event := self._until if self._until < self._start else self._start) <= now:
            if event > self._now:
                self._now = event
            self._happen()
        if now > self._now:
            self._now = now

    def deadline(self) -> float:
        """When the block or dwell that runs ends, or an idle planner begins; inf when idle."""
        return min(self._until, self._start)

    def free(self) -> int:
        """Return how many more blocks the ring takes."""
        return self._ring.free(self._running is not None)

    @property
    def idle(self) -> bool:
        """Whether nothing moves, waits or is waited for."""
        return self.ready() and self._until == math.inf and not self._ring.waiting

    def position(self) -> tuple[float, float, float, float]:
        """Return X, Y, Z and E, mm, behind all commands taken (M114's first half)."""
        return (*self._state.at, self._state.e)

    def execution(self) -> Execution:
        """Return what was executed, from time 0 on; the block that runs is in it whole."""
        return self._record.execution()

    @property
    def begun(self) -> float:
        """When time 0 of the execution was, s; NaN before."""
        return self._record.begun

    def quickstop(self, now: float) -> None:
        """Stop dead where the machine is and drop all that waits (M410, M112); what was not done is forgotten."""
        self.advance(now)
        block = self._running or next(iter(self._ring.waiting), self._piece)
        share = self._record.cut(self._now) if self._until < math.inf else 0.0
        if block is not None:
            share = share if block is self._running else 0.0
            x, y, z = (a + share * (b - a) for a, b in zip(block.start, block.end, strict=True))
            self._state.at = (x, y, z)
            self._state.e = block.e_before + share * (block.e_after - block.e_before)
        self._ring.clear()
        self._pieces = iter(())
        self._running = self._halt = self._dry = self._piece = None
        self._until = self._start = self._low = math.inf

    # What comes in, and what happens by itself

    def _fill(self) -> None:
        """Put pieces into the ring while there is room; an idle planner may begin."""
        ring = self._ring
        while (block := self._piece) is not None and self.free() > 0:
            self._measure()
            self._excused = False
            self._piece = next(self._pieces, None)
            if 2 <= len(ring.waiting) < self._half:
                self._slow(block)
            ring.add(block)
            if self._running is not None:
                continue
            if len(ring.waiting) == 1:
                self._start = self._now + DELAY
            if len(ring.waiting) >= self._first or self.free() == 0:
                self._begin()

    def _slow(self, block: Block) -> None:
        """The ring runs empty: give a short block more time, so that there is time to fill it."""
        short = self._state.limits.least_time - block.length / block.speed
        if short > 0:
            block.speed = block.length / (block.length / block.speed + 2 * short / len(self._ring.waiting))

    def _begin(self) -> None:
        """Begin the first block that waits, now."""
        block, entry, leave = self._ring.begin()
        if self._start < math.inf:
            self._start, self._filling = math.inf, True
            self._starve()
        self._running = block
        self._until = self._record.block(block, self._now, phases_of(block, entry, leave))

    def _happen(self) -> None:
        """What runs ends, or an idle planner begins; then there is room for more."""
        if self._until <= self._now:
            self._until = math.inf
            if self._running is None:
                self._halt = None
            elif not self._excused:
                self._filling = False
                self._low = min(self._low, self._ring.seconds)
            self._running = None
        if self._ring.waiting:
            self._begin()
        elif self._piece is None and not (self._excused or self._dry):
            self._dry = (self._now, math.inf)
        self._fill()
        self._settle()

    def _settle(self) -> None:
        """Carry out what was waited for, once all is at rest: stand still, or be done."""
        halt, state = self._halt, self._state
        if halt is None or self._until < math.inf or self._ring.waiting:
            return
        if halt.seconds <= 0:
            self._halt = None
            return
        self._starve()
        self._until = self._record.dwell(
            self._now, halt.seconds, state.at, state.tool, self._line, (state.rest, state.broken)
        )
        state.rest = state.broken = False

    # How well it is fed

    def _measure(self) -> None:
        """A move comes: what the ring had run down to since the last one counts."""
        if self._running is not None and not self._filling:
            self._low = min(self._low, self._until - self._now + self._ring.seconds)
        self.least_buffered = min(self.least_buffered, self._low)
        self._low = math.inf

    def _excuse(self) -> None:
        """The ring is to run dry, until the next move: that is not starving; what has been dry has been until now."""
        self._low, self._excused = math.inf, True
        if self._dry is not None:
            since, until = self._dry
            self._dry = (since, min(until, self._now))

    def _starve(self) -> None:
        """Something begins: say how long there was nothing though there should have been."""
        if self._dry is not None:
            since, until = self._dry
            until = min(until, self._now)
            if until > since:
                self.starved.append((since, until - since))
            self._dry = None
