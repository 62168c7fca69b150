"""Emit: moves and their signal in, lines of G-code out; a line that need not change leaves byte for byte as it came.

A move is rewritten where its signal asks for other volume than its line gives, or where the plan has cut it into parts.
Everything else is copied, with the firmware's state kept what the line expects: `G92 E` where a copied line speaks
absolute E and ours differs from the file's, `G1 F` where it relies on a feed rate that ours has changed. Slicer's
retracts that the signal replaces were marked by `flow.retracts` (an empty raw line) and leave nothing.

    rows     copy copy copy | rewrite | copy | stand | copy copy ...
    text    [==============]           [====]        [==========      stretches that leave in one piece
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.config import Machine
from gcodectl.gcode.bounds import ALONE, CELL0, DT, LEAST_TIME, bounds_of
from gcodectl.gcode.changes import loudest_kernel, row_changes_kernel
from gcodectl.gcode.copying import (
    close_line_kernel,
    copied_kernel,
    feed_before_kernel,
    in_step_kernel,
    newline_kernel,
    restore_kernel,
)
from gcodectl.gcode.cuts import (
    MISPLACED,
    added_kernel,
    corners_kernel,
    cuts_kernel,
    path_kernel,
    phase_kernel,
    shortest_kernel,
)
from gcodectl.gcode.ease import fewest_steps_kernel, said_kernel, say_kernel
from gcodectl.gcode.packed import (
    AREA,
    BEGIN,
    CARRY,
    COMMENT,
    DISTANCE,
    DURATION,
    E_DIGITS,
    E_END,
    E_IN,
    END,
    F_IN,
    F_OUT,
    FINISH,
    FLAGS,
    KIND,
    MARKED,
    N_ROW,
    N_WHOLE,
    NOMINAL,
    OPEN,
    OWED,
    PHASE,
    PHASES,
    RATIO,
    RETURNS,
    SLOW,
    START,
    STEADY,
    STOP,
    TAKES,
    TOOL,
    TOOL_IN,
    E,
    T,
    fixed,
    load_row_kernel,
    pack,
)
from gcodectl.gcode.rewrite import line_kernel, moves_e_kernel, rest_time_kernel, standing_kernel
from gcodectl.gcode.write import copy_kernel, units_kernel, write_word_kernel
from gcodectl.jit import jit_lean
from gcodectl.records import Composed, Flag, Kind

MARK = b"; gcodectl: learned flow begins here"
MARK_BYTES: Bytes = np.frombuffer(MARK, dtype=np.uint8)

KNOWN, PART = int(Flag.KNOWN), int(Flag.PART)
LINE, ARC, DWELL = int(Kind.LINE), int(Kind.ARC), int(Kind.DWELL)
TOOL_CHANGE, BARRIER = int(Kind.TOOL), int(Kind.BARRIER)
QUIET = 1e-6
"""mm^3/s; what a signal adds below this is rounding."""
LINE_ROOM = 160
"""Bytes that one line we write may take."""
ROOM = 1 << 20
"""Bytes that leave in one piece, more where a single move writes more."""


@jit_lean
def rewrite_row_kernel(
    out: Bytes, n: int, text: Bytes, row: Floats, whole: Ints, phases: Floats, rates: Floats, bounds: Floats,
    carry: Floats, cuts: Floats,
) -> int:  # fmt: skip
    """Write a move on a path as lines that carry the reference's volume by path and the signal's by time."""
    p, last = whole[PHASE], whole[PHASES]
    begin, end = row[BEGIN], row[FINISH]
    cell0, dt = int(bounds[CELL0]), bounds[DT]
    slow = whole[SLOW] > 0
    shortest = shortest_kernel(bounds[LEAST_TIME], row[AREA], whole[E_DIGITS], carry[NOMINAL])
    shortest = max(shortest, (end - begin) * fewest_steps_kernel(row, whole, bounds))
    soonest, latest = begin, end
    lines = 1
    cuts[0] = end
    if end - begin > 1.9 * shortest:  # else two lines would be too short
        soonest, latest = corners_kernel(row, whole, phases, dt)
        lines = cuts_kernel(
            rates, cell0, dt, begin, end, phases, p, last, True, slow, soonest, latest,
            MISPLACED * carry[NOMINAL], shortest, cuts,
        )  # fmt: skip
    rate = row[E] * row[AREA] / row[DISTANCE] * (row[STEADY] if row[E] > 0.0 else 1.0)
    gone, since = 0.0, begin
    for k in range(lines):
        until = since
        while until < cuts[k]:
            until = cuts[k]
            s = row[DISTANCE] if k == lines - 1 else path_kernel(phases, p, last, until)
            volume = rate * (s - gone) + added_kernel(rates, cell0, dt, since, until)
            said, top = say_kernel(volume, s - gone, since, until, row, phases, p, last, bounds, carry)
            if said != volume and soonest <= since + shortest and since + 2.0 * shortest <= min(until, latest):
                until = since + shortest  # what must be eased is eased in short lines
                s = path_kernel(phases, p, last, until)
                volume = rate * (s - gone) + added_kernel(rates, cell0, dt, since, until)
                said, top = say_kernel(volume, s - gone, since, until, row, phases, p, last, bounds, carry)
            speed = (s - gone) / (until - since) if slow else top
            n = line_kernel(out, n, s, said, speed, row, whole, carry)
            said_kernel(volume - said, s - gone, row, whole, carry)
            n = close_line_kernel(out, n, text, whole, carry)
            gone, since = s, until
            p = phase_kernel(phases, p, last, since)
    return n


@jit_lean
def stand_row_kernel(
    out: Bytes, n: int, text: Bytes, row: Floats, whole: Ints, phases: Floats, rates: Floats, bounds: Floats,
    carry: Floats, cuts: Floats,
) -> int:  # fmt: skip
    """Write what the plunger does while the machine stands still; a G4's time is kept, with G4 where E rests.

    What a tool change itself takes comes after these lines: nothing can be written into it.
    """
    begin, end = row[BEGIN], row[FINISH] - row[TAKES]
    cell0, dt, accel = int(bounds[CELL0]), bounds[DT], bounds[ALONE]
    if whole[KIND] == TOOL_CHANGE and end - begin < bounds[LEAST_TIME]:
        carry[OWED] += added_kernel(rates, cell0, dt, begin, end)
        return n
    shortest = shortest_kernel(bounds[LEAST_TIME], row[AREA], whole[E_DIGITS], carry[NOMINAL])
    loudest = loudest_kernel(rates, cell0, dt, begin, end)
    shortest = max(shortest, rest_time_kernel(loudest, accel, row[AREA]))
    lines = cuts_kernel(
        rates, cell0, dt, begin, end, phases, whole[PHASE], whole[PHASES], False, False, begin, end,
        MISPLACED * carry[NOMINAL], shortest, cuts,
    )  # fmt: skip
    dwells = whole[KIND] == DWELL
    if not dwells:
        whole[COMMENT] = whole[STOP]
    since, waited = begin, 0.0
    for k in range(lines):
        added = added_kernel(rates, cell0, dt, since, cuts[k])
        rests = not moves_e_kernel(added, row, whole, carry)
        rests = rests or abs(added + carry[OWED]) < MISPLACED * carry[NOMINAL]
        if rests:
            carry[OWED] += added
            waited += cuts[k] - since
        if waited > 0.0 and dwells and (not rests or k == lines - 1):
            out[n], out[n + 1] = 71, 52
            n = write_word_kernel(out, n + 2, 80, units_kernel(waited * 1000.0, 0), 0)
            n = close_line_kernel(out, n, text, whole, carry)
            waited = 0.0
        if not rests:
            n = standing_kernel(out, n, since, cuts[k], added, accel, row, whole, carry)
            carry[RATIO] = 0.0
            n = close_line_kernel(out, n, text, whole, carry)
            waited = 0.0
        since = cuts[k]
    return n


@jit_lean
def rates_kernel(u: Floats, reference: Floats, rates: Floats) -> None:
    """What the signal adds to the reference, without what is rounding."""
    for k in range(len(rates)):
        added = u[k] - reference[k]
        rates[k] = added if abs(added) >= QUIET else 0.0


@jit_lean
def emit_kernel(
    text: Bytes, floats: Floats, ints: Ints, p0: Floats, p1: Floats, center: Floats, numbers: Ints, phases: Floats,
    numbers_of_phases: Ints, u: Floats, reference: Floats, steady: Floats, bounds: Floats, carry: Floats,
    rates: Floats, row: Floats, whole: Ints, cuts: Floats, row0: int, out: Bytes,
) -> tuple[int, int]:  # fmt: skip
    """Write rows from `row0` on; returns bytes written and the row to go on with (it stops where `out` may not do)."""
    if row0 == 0:
        rates_kernel(u, reference, rates)
    n, p = 0, 0
    kept, upto = 0, 0  # the stretch of the text that is to be copied next
    rows, n_phases = len(numbers), len(numbers_of_phases)
    for i in range(row0, rows):
        while p < n_phases and numbers_of_phases[p] < numbers[i]:
            p += 1
        first = p
        while p < n_phases and numbers_of_phases[p] == numbers[i]:
            p += 1
        start, end, kind, flags = ints[START, i], ints[END, i], ints[KIND, i], ints[FLAGS, i]
        most_lines = 3.0
        if p > first:
            most_lines += (phases[T, p - 1] + phases[DURATION, p - 1] - phases[T, first]) / bounds[DT] + 2.0
        if n + upto - kept + (end - start) * 2 + LINE_ROOM * most_lines > len(out):
            return copy_kernel(out, n, text, kept, upto), i
        on_path = kind in (LINE, ARC) and floats[DISTANCE, i] > 0.0 and not np.isnan(p1[i, 0])
        moves = on_path and flags & KNOWN != 0 and (end > start or flags & PART != 0)
        passes = kind in (TOOL_CHANGE, BARRIER)
        stands = kind == DWELL or passes
        changes = row_changes_kernel(
            floats, ints, i, on_path, moves or stands, phases, first, p, rates, steady, bounds, carry
        )
        if changes:
            n = copy_kernel(out, n, text, kept, upto)
            kept = upto
            if carry[OPEN]:
                n = newline_kernel(out, n, carry)
                carry[OPEN] = 0.0
            if not carry[MARKED]:
                n = newline_kernel(out, copy_kernel(out, n, MARK_BYTES, 0, len(MARK_BYTES)), carry)
                carry[MARKED] = 1.0
            load_row_kernel(
                text, floats, ints, p0, p1, center, steady, phases, i, first, p, bounds, carry, row, whole
            )  # fmt: skip
            if stands:
                n = stand_row_kernel(out, n, text, row, whole, phases, rates, bounds, carry, cuts)
            else:
                if np.isnan(carry[F_OUT]):
                    carry[F_OUT] = feed_before_kernel(floats, ints, i, carry)
                n = rewrite_row_kernel(out, n, text, row, whole, phases, rates, bounds, carry, cuts)
        if passes or (on_path and not moves):
            carry[OWED] = 0.0  # what could not be said before this is past
        if not changes or passes:
            if end > start:
                in_step = in_step_kernel(ints, i, carry)
                if start != upto or not in_step:
                    n = copy_kernel(out, n, text, kept, upto)
                    kept = start
                if not in_step:
                    n = restore_kernel(out, n, text, floats, ints, i, bounds, carry)
                upto = end
            copied_kernel(text, floats, ints, p1, i, p > first, carry)
        carry[E_IN] = floats[E_END, i]
        carry[TOOL_IN] = ints[TOOL, i]
    carry[F_IN] = feed_before_kernel(floats, ints, rows, carry)
    return copy_kernel(out, n, text, kept, upto), rows


def emit(chunks: Iterable[Composed], machine: Machine, steady: Floats) -> Iterator[bytes]:
    """Write composed moves as G-code.

    `steady` is 1 / K by tool: what the plunger must do for a unit of flow. Lines end as the file's lines end.
    """
    carry = np.full(CARRY, np.nan)
    for name in (OWED, NOMINAL, MARKED, OPEN, RETURNS, RATIO, TOOL_IN):
        carry[name] = 0.0
    bounds = bounds_of(machine)
    row, whole = np.empty(N_ROW), np.empty(N_WHOLE, dtype=np.int64)
    out: Bytes = np.empty(ROOM, dtype=np.uint8)
    for moves, speeds, profile, _tasks, command in chunks:
        if not len(moves):
            continue
        floats, ints, phases = pack(moves, speeds, profile)
        rates = np.empty(len(command.u))
        bounds[DT], bounds[CELL0] = command.dt, round(command.t0 / command.dt)
        lasts = profile.t[-1] + profile.duration[-1] - profile.t[0] if len(profile) else 0.0
        cuts = np.empty(int(lasts / command.dt) + 4)
        reached = 0
        while reached < len(moves):
            before = reached
            written, reached = emit_kernel(
                fixed(moves.text), floats, ints, moves.p0, moves.p1, moves.center, moves.row, phases, profile.row,
                fixed(command.u), fixed(command.reference), steady, bounds, carry, rates, row, whole, cuts, before, out,
            )  # fmt: skip
            if written:
                yield out[:written].tobytes()
            elif reached == before:
                out = np.empty(2 * len(out), dtype=np.uint8)
