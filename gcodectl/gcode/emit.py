"""Emit: moves and their signal in, lines of G-code out; a line that need not change leaves byte for byte as it came.

A move is rewritten where its signal asks for other volume than its line gives, or where the plan has cut it into parts.
Everything else is copied, with the firmware's state kept what the line expects: `G92 E` where a copied line speaks
absolute E and ours differs from the file's, `G1 F` where it relies on a feed rate that ours has changed. Slicer's
retracts that the signal replaces were marked by `flow.retracts` (an empty raw line) and leave nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from gcodectl.columns import Bytes, Floats, Ints
from gcodectl.config import Machine
from gcodectl.gcode.changes import loudest_kernel, row_changes_kernel
from gcodectl.gcode.copying import close_line_kernel, copy_row_kernel, newline_kernel
from gcodectl.gcode.cuts import (
    MISPLACED,
    added_kernel,
    corners_kernel,
    cuts_kernel,
    path_kernel,
    shortest_kernel,
    speeds_kernel,
)
from gcodectl.gcode.ease import ALONE, bounds_of, copied_kernel, fewest_steps_kernel, said_kernel, say_kernel
from gcodectl.gcode.packed import (
    AREA,
    CARRY,
    DISTANCE,
    DURATION,
    E_DIGITS,
    E_END,
    E_IN,
    END,
    F_FILE,
    F_IN,
    F_OUT,
    FLAGS,
    KIND,
    MARKED,
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
    TAKES,
    X1,
    E,
    T,
    pack,
)
from gcodectl.gcode.rewrite import line_kernel, moves_e_kernel, rest_time_kernel, standing_kernel
from gcodectl.gcode.write import comment_kernel, copy_kernel, write_word_kernel
from gcodectl.jit import jit
from gcodectl.records import Composed, Flag, Kind

MARK = b"; gcodectl: learned flow begins here"

KNOWN, PART = int(Flag.KNOWN), int(Flag.PART)
LINE, ARC, DWELL = int(Kind.LINE), int(Kind.ARC), int(Kind.DWELL)
TOOL, BARRIER = int(Kind.TOOL), int(Kind.BARRIER)
LOUD = 10.0
"""A signal this many times the nominal flow says that the flow is larger than what was seen of it so far."""
QUIET = 1e-6
"""mm^3/s; what a signal adds below this is rounding."""
LINE_ROOM = 160
"""Bytes that one line we write may take."""


@jit
def rewrite_row_kernel(
    out: Bytes, n: int, text: Bytes, floats: Floats, ints: Ints, phases: Floats,
    rates: Floats, cell0: int, dt: float, least: float, bounds: Floats, carry: Floats, cuts: Floats, point: Floats,
) -> int:  # fmt: skip
    """Write a move on a path as lines that carry the reference's volume by path and the signal's by time."""
    first, last = ints[PHASE], ints[PHASES]
    begin = phases[first, T]
    end = phases[last - 1, T] + phases[last - 1, DURATION]
    shortest = shortest_kernel(least, floats[AREA], ints[E_DIGITS], carry[NOMINAL])
    shortest = max(shortest, (end - begin) * fewest_steps_kernel(floats, ints, bounds))
    soonest, latest = corners_kernel(floats, ints, phases, dt)
    lines = cuts_kernel(
        rates, cell0, dt, begin, end, phases, first, last, True, floats[SLOW] > 0.0, soonest, latest,
        MISPLACED * carry[NOMINAL], shortest, cuts,
    )  # fmt: skip
    rate = floats[E] * floats[AREA] / floats[DISTANCE] * (floats[STEADY] if floats[E] > 0.0 else 1.0)
    comment = comment_kernel(text, ints[START], ints[END])
    gone, since = 0.0, begin
    for k in range(lines):
        until = since
        while until < cuts[k]:
            until = cuts[k]
            s = floats[DISTANCE] if k == lines - 1 else path_kernel(phases, first, last, until)
            volume = rate * (s - gone) + added_kernel(rates, cell0, dt, since, until)
            said, top = say_kernel(volume, s - gone, since, until, floats, ints, phases, bounds, carry)
            if said != volume and soonest <= since + shortest and since + 2.0 * shortest <= min(until, latest):
                until = since + shortest  # what must be eased is eased in short lines
                s = path_kernel(phases, first, last, until)
                volume = rate * (s - gone) + added_kernel(rates, cell0, dt, since, until)
                said, top = say_kernel(volume, s - gone, since, until, floats, ints, phases, bounds, carry)
            speed = (s - gone) / (until - since) if floats[SLOW] > 0.0 else top
            n = line_kernel(out, n, s, said, speed, floats, ints, carry, point)
            said_kernel(volume - said, s - gone, floats, ints, carry)
            n = close_line_kernel(out, n, text, ints, comment, carry)
            comment = ints[END]
            gone, since = s, until
    return n


@jit
def stand_row_kernel(
    out: Bytes, n: int, text: Bytes, floats: Floats, ints: Ints, phases: Floats,
    rates: Floats, cell0: int, dt: float, least: float, accel: float, carry: Floats, cuts: Floats,
) -> int:  # fmt: skip
    """Write what the plunger does while the machine stands still; a G4's time is kept, with G4 where E rests.

    What a tool change itself takes comes after these lines: nothing can be written into it.
    """
    first, last = ints[PHASE], ints[PHASES]
    begin = phases[first, T]
    end = phases[last - 1, T] + phases[last - 1, DURATION] - floats[TAKES]
    if ints[KIND] == TOOL and end - begin < least:
        carry[OWED] += added_kernel(rates, cell0, dt, begin, end)
        return n
    shortest = shortest_kernel(least, floats[AREA], ints[E_DIGITS], carry[NOMINAL])
    loudest = loudest_kernel(rates, cell0, dt, begin, end)
    shortest = max(shortest, rest_time_kernel(loudest, accel, floats[AREA]))
    lines = cuts_kernel(
        rates, cell0, dt, begin, end, phases, first, last, False, False, begin, end,
        MISPLACED * carry[NOMINAL], shortest, cuts,
    )  # fmt: skip
    since, waited = begin, 0.0
    comment = comment_kernel(text, ints[START], ints[END]) if ints[KIND] == DWELL else ints[END]
    for k in range(lines):
        added = added_kernel(rates, cell0, dt, since, cuts[k])
        rests = not moves_e_kernel(added, floats, ints, carry)
        rests = rests or abs(added + carry[OWED]) < MISPLACED * carry[NOMINAL]
        if rests:
            carry[OWED] += added
            waited += cuts[k] - since
        if waited > 0.0 and ints[KIND] == DWELL and (not rests or k == lines - 1):
            out[n], out[n + 1] = 71, 52
            n = write_word_kernel(out, n + 2, 80, waited * 1000.0, 0)
            n = close_line_kernel(out, n, text, ints, comment, carry)
            comment, waited = ints[END], 0.0
        if not rests:
            n = standing_kernel(out, n, since, cuts[k], added, accel, floats, ints, carry)
            carry[RATIO] = 0.0
            n = close_line_kernel(out, n, text, ints, comment, carry)
            comment, waited = ints[END], 0.0
        since = cuts[k]
    return n


@jit
def emit_kernel(
    text: Bytes, floats: Floats, ints: Ints, phases: Floats, rates: Floats, cell0: int, dt: float, least: float,
    mark: Bytes, bounds: Floats, carry: Floats, cuts: Floats, row0: int, out: Bytes,
) -> tuple[int, int]:  # fmt: skip
    """Write rows from `row0` on; returns bytes written and the row to go on with (it stops where `out` may not do)."""
    n = 0
    point = np.empty(3)
    for i in range(row0, len(ints)):
        row, whole = floats[i], ints[i]
        kind = whole[KIND]
        most_lines = 3.0
        if whole[PHASES] > whole[PHASE]:
            span = phases[whole[PHASES] - 1, T] + phases[whole[PHASES] - 1, DURATION] - phases[whole[PHASE], T]
            most_lines += span / dt + 2.0
        if n + (whole[END] - whole[START]) * 2 + LINE_ROOM * most_lines > len(out):
            return n, i
        on_path = kind in (LINE, ARC) and row[DISTANCE] > 0.0 and row[X1] == row[X1]
        part = whole[FLAGS] & PART
        moves_path = on_path and whole[FLAGS] & KNOWN and (whole[END] > whole[START] or part)
        if on_path and row[E] > 0.0 and whole[PHASES] > whole[PHASE]:
            _, top, _ = speeds_kernel(phases, whole[PHASE], whole[PHASES], -np.inf, np.inf)
            carry[NOMINAL] = row[E] * row[AREA] / row[DISTANCE] * top
        stands = kind in (DWELL, TOOL, BARRIER)
        if whole[PHASES] > whole[PHASE]:
            begin = phases[whole[PHASE], T]
            end = phases[whole[PHASES] - 1, T] + phases[whole[PHASES] - 1, DURATION]
            carry[NOMINAL] = max(carry[NOMINAL], loudest_kernel(rates, cell0, dt, begin, end) / LOUD)
        changes = (moves_path or stands) and row_changes_kernel(row, whole, phases, rates, cell0, dt, carry)
        changes = changes or (part and whole[PHASES] > whole[PHASE])
        if changes and carry[OPEN]:
            n = newline_kernel(out, n, carry)
            carry[OPEN] = 0.0
        if changes and not carry[MARKED]:
            n = newline_kernel(out, copy_kernel(out, n, mark, 0, len(mark)), carry)
            carry[MARKED] = 1.0
        if changes and stands:
            n = stand_row_kernel(out, n, text, row, whole, phases, rates, cell0, dt, least, bounds[ALONE], carry, cuts)
        elif changes:
            carry[F_OUT] = carry[F_IN] if np.isnan(carry[F_OUT]) else carry[F_OUT]
            n = rewrite_row_kernel(
                out, n, text, row, whole, phases, rates, cell0, dt, least, bounds, carry, cuts, point
            )
        elif whole[PHASES] > whole[PHASE]:
            carry[OWED] += added_kernel(rates, cell0, dt, begin, end)
        if kind in (TOOL, BARRIER) or (on_path and not moves_path):
            carry[OWED] = 0.0  # what could not be said before this is past
        if not changes or kind in (TOOL, BARRIER):
            n = copy_row_kernel(out, n, text, row, whole, carry)
            if whole[PHASES] > whole[PHASE]:
                copied_kernel(row, carry)
        carry[E_IN] = row[E_END]
        carry[F_IN] = row[F_FILE]
    return n, len(ints)


def emit(chunks: Iterable[Composed], machine: Machine, steady: Floats) -> Iterator[bytes]:
    """Write composed moves as G-code.

    `steady` is 1 / K by tool: what the plunger must do for a unit of flow. Lines end as the file's lines end.
    """
    carry = np.full(CARRY, np.nan)
    for name in (OWED, NOMINAL, MARKED, OPEN, RETURNS, RATIO):
        carry[name] = 0.0
    mark: Bytes = np.frombuffer(MARK, dtype=np.uint8)
    bounds = bounds_of(machine)
    tool = 0
    for moves, speeds, profile, _tasks, command in chunks:
        if not len(moves):
            continue
        takes = np.where(moves.switches(tool), machine.switch_dwell, 0.0)
        tool = int(moves.tool[-1])
        floats, ints, phases = pack(moves, speeds, profile, steady, takes, machine)
        rates = command.u - command.reference if len(command.u) else np.zeros(1)
        rates[np.abs(rates) < QUIET] = 0.0
        cell0 = round(command.t0 / command.dt)
        cuts = np.empty(len(rates) + 2)
        row = 0
        room = 1 << 16
        while row < len(moves):
            room = max(room, 2 * len(moves.text) + (1 << 16))
            out: Bytes = np.empty(room, dtype=np.uint8)
            written, reached = emit_kernel(
                moves.text, floats, ints, phases, rates, cell0, command.dt,
                1.0 / machine.max_lines_per_second, mark, bounds, carry, cuts, row, out,
            )  # fmt: skip
            room = room * 2 if reached == row else room
            row = reached
            if written:
                yield out[:written].tobytes()
