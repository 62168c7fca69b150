"""Motions cut into blocks: the limits in force when the line was read go with each of them."""

from __future__ import annotations

import math
from collections.abc import Iterator

from plant_models.gantry import E_ONLY, PATH, TINY
from plant_models.printer.chords import Point
from plant_models.printer.ring import Block
from plant_models.printer.state import Motion, State


def blocks_of(motion: Motion, state: State, line: int) -> Iterator[Block]:
    """Yield the blocks of a motion; pieces of no length that push nothing leave none. Takes the marks off `state`."""
    count, start, limits = len(motion.ends), motion.start, state.limits
    for number, end in enumerate(motion.ends, 1):
        block = _block(start, end, motion.e / count, motion.feed, state)
        if block is not None:
            whole = motion.e_end - motion.e_start
            block.e_before = motion.e_start + whole * (number - 1) / count
            block.e_after = motion.e_start + whole * number / count
            block.corner, block.e_corner = limits.corner_speed, limits.e_corner_speed
            block.rest, block.broken, state.rest, state.broken = state.rest, state.broken, False, False
            block.area, block.advance, block.tool, block.line = state.area, state.advance, state.tool, line
            yield block
        start = end


def _block(start: Point, end: Point, e: float, feed: float, state: State) -> Block | None:
    dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    path = math.sqrt(dx * dx + dy * dy + dz * dz)
    if path > TINY:
        speed, accel = state.limits.of_path(dx, dy, dz, path, e, feed, state.area)
        return Block(PATH, start, end, (dx / path, dy / path, dz / path), path, e, speed, accel)
    if e == 0:
        return None
    speed, accel = state.limits.of_e(feed, state.area)
    return Block(E_ONLY, start, end, (0.0, 0.0, 0.0), abs(e), e, speed, accel)
