"""Holds: a place to stand still before the first road of a passage, so that its Start can begin in time.

After a homing, a tool change or a move from the unknown nothing may be sent ahead of a road but what comes after them;
where that travel is shorter than the Start's lead, the machine waits at the road's begin while the plunger charges.
This stage only puts a row there, a dwell of no time and no line; `motion.profile` decides how long it must be.

    G28 | travel | hold | road ...                rows of a passage: only its first road has a hold
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from gcodectl.columns import Ints, column_fields
from gcodectl.records import Kind, Moves


def hold_starts(chunks: Iterable[Moves]) -> Iterator[Moves]:
    """Put a hold before the first road of every passage; later rows are numbered on."""
    waiting = True
    added = 0
    e_before = np.nan
    for moves in chunks:
        begins = moves.starts_passage
        rows = np.flatnonzero(begins | moves.deposits)
        begin = begins[rows]
        places = rows[~begin & np.concatenate([[waiting], begin[:-1]])] if len(rows) else rows
        waiting = bool(begin[-1]) if len(rows) else waiting
        yield _with_holds(moves, places, added, e_before)
        added += len(places)
        e_before = float(moves.e_end[-1]) if len(moves) else e_before


def _with_holds(moves: Moves, places: Ints, added: int, e_before: float) -> Moves:
    numbered = moves.replace(row=moves.row + added)
    if not len(places):
        return numbered
    road = numbered[places]
    nothing = np.zeros(len(places))
    holds = road.replace(
        kind=np.full(len(places), Kind.DWELL), p1=road.p0, end=road.start, e=nothing, length=nothing, sweep=nothing,
        dwell=nothing, e_end=np.append(e_before, moves.e_end)[places],
    )  # fmt: skip
    columns = {
        field.name: np.insert(getattr(numbered, field.name), places, getattr(holds, field.name), axis=0)
        for field in column_fields(Moves)
    }
    columns["row"] = np.arange(len(columns["row"])) + numbered.row[0]
    return numbered.replace(**columns)
