"""Motions cut into blocks: the limits in force when the line was read go with each of them."""

from __future__ import annotations

import math
from collections.abc import Iterator

from plant_models.gantry import E_ONLY, PATH, TINY
from plant_models.printer.chords import Point
from plant_models.printer.limits import LEAST_ACCEL, LEAST_SPEED
from plant_models.printer.ring import Block
from plant_models.printer.state import Motion, State


def blocks_of(motion: Motion, state: State, line: int) -> Iterator[Block]:
    """Yield the blocks of a motion; pieces of no length that push nothing leave none. Takes the marks off `state`."""
    if len(motion.ends) == 1:
        block = _block(motion.start, motion.ends[0], motion.e, motion.feed, state, line)
        if block is not None:
            block.e_before, block.e_after = motion.e_start, motion.e_end
            yield block
        return
    count, start, whole = len(motion.ends), motion.start, motion.e_end - motion.e_start
    for number, end in enumerate(motion.ends, 1):
        block = _block(start, end, motion.e / count, motion.feed, state, line)
        if block is not None:
            block.e_before = motion.e_start + whole * (number - 1) / count
            block.e_after = motion.e_start + whole * number / count
            yield block
        start = end


def _block(start: Point, end: Point, e: float, feed: float, state: State, line: int) -> Block | None:
    x, y, z = start
    dx, dy, dz = end[0] - x, end[1] - y, end[2] - z
    path = math.sqrt(dx * dx + dy * dy + dz * dz)
    limits, area = state.limits, state.area
    if path > TINY:
        speed, accel = limits.of_path(dx, dy, dz, path, e, feed, area)
        block = Block(PATH, start, end, (dx / path, dy / path, dz / path), path, e, speed, accel)
    elif e != 0:
        speed, accel = limits.of_e(feed, area)
        block = Block(E_ONLY, start, end, (0.0, 0.0, 0.0), abs(e), e, speed, accel)
    else:
        return None
    if speed < LEAST_SPEED:
        block.speed = LEAST_SPEED
    if accel < LEAST_ACCEL:
        block.accel = LEAST_ACCEL
    block.corner, block.e_corner = limits.corner_speed, limits.e_corner_speed
    block.area, block.advance, block.tool, block.line = area, state.advance, state.tool, line
    if state.rest or state.broken:
        block.rest, block.broken, state.rest, state.broken = state.rest, state.broken, False, False
    return block
