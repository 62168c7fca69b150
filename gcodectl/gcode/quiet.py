"""Quiet: a chunk that no signal changes leaves as its own bytes, without a look at its rows.

What goes on from row to row is known from its last rows: which are the last that say, lay and take time.

    rows     o o o o o o o o o o o o o o L o S T o o        L lays, S has a line, T takes time: each the last that does
             [== leave as they are =====]|  these are written one by one, and bring `state` up to date
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Bools, Floats
from gcodectl.gcode.packed import E_IN, E_OUT, F_OUT, OWED, TOOL_IN, Table
from gcodectl.records import Flag

PART, RELATIVE_E, SETS_E = int(Flag.PART), int(Flag.RELATIVE_E), int(Flag.SETS_E)


def quiet_rows(table: Table, steady: Floats, state: Floats) -> int:
    """How many rows at the head of a chunk leave as they came; `state` is then as if they had been written."""
    if not _nothing_changes(table, steady, state):
        return 0
    takes_time = table.phase_row - table.row[0]
    lays = (table.e > 0) & (table.length > 0)
    lasts = [len(lays) - 1, _last(table.end > table.start), *takes_time[-1:], *takes_time[lays[takes_time]][-1:]]
    rows = int(min(lasts))
    if rows > 0:
        e = table.e_end[rows - 1]
        state[E_OUT] = e if _e_agrees(state) else state[E_OUT] + (e - state[E_IN])
        state[E_IN], state[TOOL_IN] = e, table.tool[rows - 1]
    return rows


def _nothing_changes(table: Table, steady: Floats, state: Floats) -> bool:
    """Whether no row asks for another line than its own, over a firmware that is where the file expects it."""
    if not np.isnan(state[F_OUT]) or state[OWED] != 0.0 or (steady != 1.0).any():
        return False
    flags = np.bitwise_or.reduce(table.flags)
    relative = np.bitwise_and.reduce(table.flags) & RELATIVE_E and not flags & SETS_E
    if flags & PART or not (relative or _e_agrees(state)):
        return False
    if not np.array_equal(table.start[1:], table.end[:-1]) or table.row[-1] - table.row[0] != len(table.row) - 1:
        return False
    return not table.rates.any()


def _e_agrees(state: Floats) -> bool:
    """Whether the firmware's E is the file's; NaN: no line of an absolute E has passed yet, and nothing was changed."""
    return bool(state[E_OUT] == state[E_IN] or np.isnan(state[E_OUT]))


def _last(rows: Bools) -> int:
    """The last row that is true, the number of rows where none is."""
    return len(rows) - 1 - int(np.argmax(rows[::-1])) if rows.any() else len(rows)
