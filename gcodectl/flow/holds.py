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
    source = np.insert(np.arange(len(moves)), places, places)
    at = places + np.arange(len(places))
    columns = {field.name: np.take(getattr(numbered, field.name), source, axis=0) for field in column_fields(Moves)}
    columns["kind"][at], columns["p1"][at], columns["end"][at] = Kind.DWELL, columns["p0"][at], columns["start"][at]
    columns["e_end"][at] = np.append(e_before, moves.e_end)[places]
    for name in ("e", "length", "sweep", "dwell"):
        columns[name][at] = 0.0
    columns["row"] = np.arange(len(source)) + numbered.row[0]
    return numbered.replace(**columns)
