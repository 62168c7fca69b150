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
from typing import Any

import numpy as np

from gcodectl.columns import Bytes, Floats
from gcodectl.config import Machine
from gcodectl.gcode.bounds import CELL0, DT
from gcodectl.gcode.changes import row_changes_kernel
from gcodectl.gcode.copying import copied_kernel, in_step_kernel, newline_kernel, restore_kernel
from gcodectl.gcode.cuts import N_CUT
from gcodectl.gcode.packed import (
    BEGIN,
    DISTANCE,
    E_END,
    E_IN,
    END,
    F_IN,
    FEED,
    FEEDRATE,
    FINISH,
    MARKED,
    N_PHASE,
    OPEN,
    OWED,
    PHASES,
    START,
    TOOL_IN,
    X1,
    Table,
    load_motion_kernel,
    load_phases_kernel,
    load_row_kernel,
    new_state,
    table_of,
)
from gcodectl.gcode.pieces import rewrite_row_kernel, stand_row_kernel
from gcodectl.gcode.quiet import quiet_rows
from gcodectl.gcode.write import copy_kernel
from gcodectl.jit import jit_lean
from gcodectl.records import Composed, Flag, Kind

MARK = b"; gcodectl: changed from here on"
MARK_BYTES: Bytes = np.frombuffer(MARK, dtype=np.uint8)

KNOWN, PART = int(Flag.KNOWN), int(Flag.PART)
LINE, ARC, DWELL = int(Kind.LINE), int(Kind.ARC), int(Kind.DWELL)
TOOL_CHANGE, BARRIER = int(Kind.TOOL), int(Kind.BARRIER)
LINE_ROOM = 160
"""Bytes that one line we write may take."""
ROOM = 1 << 20
"""Bytes that leave in one piece, more where a single move writes more."""


@jit_lean
def room_kernel(state: Floats) -> float:
    """Bytes that a row's lines may take at most."""
    lines = 3.0
    if state[PHASES]:
        lines += (state[FINISH] - state[BEGIN]) / state[DT] + 2.0
    return float(2.0 * (state[END] - state[START]) + LINE_ROOM * lines)


@jit_lean
def begin_change_kernel(out: Bytes, n: int, state: Floats) -> int:
    """Before lines of our own: end the line before, and leave our mark once."""
    if state[OPEN]:
        n = newline_kernel(out, n, state)
        state[OPEN] = 0.0
    if not state[MARKED]:
        n = newline_kernel(out, copy_kernel(out, n, MARK_BYTES, 0, len(MARK_BYTES)), state)
        state[MARKED] = 1.0
    return n


@jit_lean
def emit_kernel(
    columns: tuple[Any, ...], steady: Floats, state: Floats, phases: Floats, cuts: Floats, out: Bytes
) -> tuple[int, int]:  # fmt: skip
    """Write rows; returns the bytes written and how many rows they are (it stops where `out` may not do)."""
    table = Table(*columns)  # numba takes a plain tuple from Python in a tenth of the time
    n, p = 0, 0
    kept, upto = 0, 0  # the stretch of the text that is to be copied next
    for i in range(len(table.row)):
        while p < len(table.phase_row) and table.phase_row[p] < table.row[i]:
            p += 1
        first = p
        while p < len(table.phase_row) and table.phase_row[p] == table.row[i]:
            p += 1
        tool = state[TOOL_IN]
        load_row_kernel(table, i, steady, state)
        load_phases_kernel(table, first, p, state, phases)
        if n + upto - kept + room_kernel(state) > len(out):
            state[TOOL_IN] = tool
            return copy_kernel(out, n, table.text, kept, upto), i
        start, end, kind, flags = table.start[i], table.end[i], table.kind[i], table.flags[i]
        on_path = kind in (LINE, ARC) and state[DISTANCE] > 0.0 and not np.isnan(state[X1])
        moves = on_path and flags & KNOWN != 0 and (end > start or flags & PART != 0)
        passes = kind in (TOOL_CHANGE, BARRIER)
        stands = passes or kind == DWELL
        changes = row_changes_kernel(state, phases, table.rates, on_path, moves or stands)
        if changes:
            load_motion_kernel(table, i, state)
            n = copy_kernel(out, n, table.text, kept, upto)
            kept = upto
            n = begin_change_kernel(out, n, state)
            if stands:
                n = stand_row_kernel(out, n, table.text, state, phases, table.rates, cuts)
            else:
                n = rewrite_row_kernel(out, n, table.text, state, phases, table.rates, cuts)
        if passes or (on_path and not moves):
            state[OWED] = 0.0  # what could not be said before this is past
        if not changes or passes:
            in_step = start == end or in_step_kernel(state)
            if not in_step or (end > start and start != upto):
                n = copy_kernel(out, n, table.text, kept, upto)
                kept = start
            if not in_step:
                n = restore_kernel(out, n, table.text, state)
            if end > start:
                upto = end
            copied_kernel(table.text, state)
        state[E_IN] = state[E_END]
        state[F_IN] = np.rint(state[FEEDRATE] * 60.0 * state[FEED] * 1e4) / 1e4
    return copy_kernel(out, n, table.text, kept, upto), len(table.row)


def emit(chunks: Iterable[Composed], machine: Machine, steady: Floats) -> Iterator[bytes]:
    """Write composed moves as G-code.

    `steady` is 1 / K by tool: what the plunger must do for a unit of flow. Lines end as the file's lines end.
    """
    state = new_state(machine)
    out: Bytes = np.empty(ROOM, dtype=np.uint8)
    for chunk in chunks:
        if not len(chunk.moves):
            continue
        table = table_of(chunk)
        profile, command = chunk.profile, chunk.command
        state[DT], state[CELL0] = command.dt, round(command.t0 / command.dt)
        lasts = profile.t[-1] + profile.duration[-1] - profile.t[0] if len(profile) else 0.0
        phases = np.empty((len(profile), N_PHASE))
        cuts = np.empty((int(lasts / command.dt) + 4, N_CUT))
        reached = quiet_rows(table, steady, state)
        if reached:
            yield table.text[table.start[0] : table.start[reached]].tobytes()
        while reached < len(chunk.moves):
            written, rows = emit_kernel(
                tuple(table.behind(reached) if reached else table), steady, state, phases, cuts, out
            )
            reached += rows
            if written:
                yield out[:written].tobytes()
            elif not rows:
                out = np.empty(2 * len(out), dtype=np.uint8)
