"""Pieces: a move that asks for other volume than its line gives, as the lines that carry it."""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bytes, Floats
from gcodectl.gcode.bounds import ALONE, CELL0, DT, LEAST_TIME
from gcodectl.gcode.changes import loudest_kernel
from gcodectl.gcode.copying import close_line_kernel
from gcodectl.gcode.cuts import (
    ADDED,
    MISPLACED,
    PATH,
    UNTIL,
    added_kernel,
    corners_kernel,
    cuts_kernel,
    path_kernel,
    phase_kernel,
    shortest_kernel,
    speeds_kernel,
)
from gcodectl.gcode.ease import eased_kernel, fewest_steps_kernel
from gcodectl.gcode.packed import (
    AREA,
    BEGIN,
    COMMENT,
    DISTANCE,
    END,
    F_IN,
    F_OUT,
    FINISH,
    FLOW,
    KIND,
    MOVED,
    NOMINAL,
    OWED,
    PHASES,
    RATIO,
    SLOW,
    START,
    STEADY,
    STOP,
    TAKES,
    TOOL_CHANGE,
    UNIT,
    E,
)
from gcodectl.gcode.rewrite import line_kernel, moves_e_kernel, standing_kernel
from gcodectl.gcode.write import comment_kernel, units_kernel, write_word_kernel
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Kind

DWELL = int(Kind.DWELL)
STARTING = 5.0
"""A line of E alone lasts this many times as long as E takes to its loudest rate. Firmware begins and ends it at rest:
with less than 4 it could not move E that far; with more its middle is where it was, and what follows is blurred."""


@jit_lean
def endings_kernel(text: Bytes, state: Floats) -> None:
    """Find where the line's own ending and its comment begin."""
    start, stop = int(state[START]), int(state[END])
    while stop > start and (text[stop - 1] == 10 or text[stop - 1] == 13):
        stop -= 1
    state[STOP], state[COMMENT] = stop, comment_kernel(text, start, stop)


@jit_inline
def rewrite_row_kernel(
    out: Bytes, n: int, text: Bytes, state: Floats, phases: Floats, rates: Floats, cuts: Floats
) -> int:
    """Write a move on a path as lines that carry the reference's volume by path and the signal's by time."""
    p, last = 0, int(state[PHASES])
    begin, end, distance = state[BEGIN], state[FINISH], state[DISTANCE]
    cell0, dt = int(state[CELL0]), state[DT]
    slow = state[SLOW] > 0.0
    shortest = max(shortest_kernel(state), (end - begin) * fewest_steps_kernel(state))
    soonest, latest = begin, end
    lines = 1
    if end - begin > 1.9 * shortest:  # else two lines would be too short
        soonest, latest = corners_kernel(state, phases)
        lines = cuts_kernel(
            rates, cell0, dt, begin, end, phases, last, True, slow, soonest, latest,
            MISPLACED * state[NOMINAL], shortest, cuts,
        )  # fmt: skip
    else:
        cuts[0, UNTIL], cuts[0, ADDED] = end, added_kernel(rates, cell0, dt, begin, end)
    cuts[lines - 1, PATH] = distance
    rate = state[E] * state[AREA] / distance * (state[STEADY] if state[E] > 0.0 else 1.0)
    endings_kernel(text, state)
    if np.isnan(state[F_OUT]):
        state[F_OUT] = state[F_IN]
    gone, since, before, k = 0.0, begin, 0.0, 0
    while k < lines:
        if since >= cuts[k, UNTIL]:
            k += 1
            continue
        until, s, added = cuts[k, UNTIL], cuts[k, PATH], cuts[k, ADDED]
        for eased in range(2):
            volume = rate * (s - gone) + (added - before)
            entry, top, hardest = speeds_kernel(phases, p, last, since, until)
            said = eased_kernel(volume, s - gone, entry, top, hardest, state)
            fits = soonest <= since + shortest and since + 2.0 * shortest <= min(until, latest)
            if eased or said == volume or not fits:
                break
            until = since + shortest  # what must be eased is eased in short lines
            s = path_kernel(phases, p, last, until)
            added = before + added_kernel(rates, cell0, dt, since, until)
        n = line_kernel(out, n, s, said, (s - gone) / (until - since) if slow else top, state)
        state[OWED] += volume - said
        state[RATIO] = state[MOVED] * state[FLOW] * state[UNIT] / (s - gone) if s > gone else 0.0
        n = close_line_kernel(out, n, text, state)
        gone, since, before = s, until, added
        p = phase_kernel(phases, p, last, since)
    return n


@jit_lean
def stand_row_kernel(
    out: Bytes, n: int, text: Bytes, state: Floats, phases: Floats, rates: Floats, cuts: Floats
) -> int:
    """Write what the plunger does while the machine stands still; with G4 where E rests in a wait.

    A G4's time is kept, and what the plan waits for before a tool changes. What the change itself takes comes after
    these lines: nothing can be written into it.
    """
    begin, end = state[BEGIN], state[FINISH] - state[TAKES]
    cell0, dt = int(state[CELL0]), state[DT]
    if state[KIND] == TOOL_CHANGE and end - begin < state[LEAST_TIME]:
        state[OWED] += added_kernel(rates, cell0, dt, begin, end)
        return n
    starting = STARTING * loudest_kernel(rates, cell0, dt, begin, end) / (state[AREA] * state[ALONE])
    lines = cuts_kernel(
        rates, cell0, dt, begin, end, phases, int(state[PHASES]), False, False, begin, end,
        MISPLACED * state[NOMINAL], max(shortest_kernel(state), starting), cuts,
    )  # fmt: skip
    endings_kernel(text, state)
    waits = state[KIND] == DWELL or state[KIND] == TOOL_CHANGE
    if state[KIND] != DWELL:
        state[COMMENT] = state[STOP]
    since, before, waited = begin, 0.0, 0.0
    for k in range(lines):
        until, added = cuts[k, UNTIL], cuts[k, ADDED] - before
        rests = not moves_e_kernel(added, state) or abs(added + state[OWED]) < MISPLACED * state[NOMINAL]
        if rests:
            state[OWED] += added
            waited += until - since
        if waited > 0.0 and waits and (not rests or k == lines - 1):
            out[n], out[n + 1] = 71, 52
            n = write_word_kernel(out, n + 2, 80, units_kernel(waited * 1000.0, 0), 0)
            n = close_line_kernel(out, n, text, state)
            waited = 0.0
        if not rests:
            n = standing_kernel(out, n, until - since, added, state)
            state[RATIO] = 0.0
            n = close_line_kernel(out, n, text, state)
            waited = 0.0
        since, before = until, cuts[k, ADDED]
    return n
