"""Retracts: the slicer's own guesses at flow, taken out where learned signals take their place.

A slicer pulls E back after a road and pushes it out again before the next. Where Stop and Start signals are laid over
the tasks, these moves go: E-only moves and firmware retraction leave no line, a wipe (path with E < 0) keeps its path
and is written anew, as its own line would still pull.

    road | E-0.8  travel  E0.8 | road      a stretch: the rows between two roads, judged as one when the next road comes
           drop           drop

What stays: a push of PRIME times or more what was pulled (a prime, a purge), a stretch that pulls UNLOAD or more (a
filament being unloaded, not relieved), wipes whose line may not be rewritten, and everything in a file that lays no
road that could be rewritten. A stretch that has not ended after PATIENCE rows is left as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats
from gcodectl.jit import jit_lean
from gcodectl.records import Flag, Kind, Moves

PRIME = 2.0
UNLOAD = 15.0
"""mm of E."""
PATIENCE = 20_000
KEEP, DROP, STILL = 0, 1, 2

RETRACT, UNRETRACT = int(Kind.RETRACT), int(Kind.UNRETRACT)
LINE, ARC, KNOWN = int(Kind.LINE), int(Kind.ARC), int(Flag.KNOWN)


@jit_lean
def known_kernel(kind: int, e: float, length: float, flags: int) -> bool:
    """Whether a row's E may be taken out: E alone, or a path whose line may be written anew."""
    return kind in (LINE, ARC) and ((length == 0.0 and math.isfinite(e)) or flags & KNOWN != 0)


@jit_lean
def judge_kernel(
    kind: NDArray[np.int8],
    e: Floats,
    length: Floats,
    flags: NDArray[np.int16],
    begin: int,
    end: int,
    action: NDArray[np.int8],
) -> int:
    """Decide each row of a stretch, rows begin to end: keep it, drop its line, or keep its path without E.

    Returns how many rows do not stay as they are.
    """
    pulled = total = 0.0
    changed = 0
    for i in range(begin, end):
        if kind[i] == RETRACT or kind[i] == UNRETRACT:
            action[i] = DROP
        elif not known_kernel(kind[i], e[i], length[i], flags[i]) or e[i] == 0.0:
            continue
        elif e[i] < 0.0:
            pulled -= e[i]
            total -= e[i]
            action[i] = STILL if length[i] > 0.0 else DROP
        elif pulled > 0.0 and e[i] < PRIME * pulled:
            pulled = max(0.0, pulled - e[i])
            action[i] = DROP
        changed += action[i] != KEEP
    if total >= UNLOAD:
        changed = 0
        for i in range(begin, end):
            action[i] = KEEP
    return changed


@jit_lean
def stretches_kernel(
    kind: NDArray[np.int8], e: Floats, length: Floats, flags: NDArray[np.int16], lays: Bools, patience: int,
    given_up: bool, action: NDArray[np.int8],
) -> tuple[int, int, bool]:  # fmt: skip
    """Judge every stretch that a road ends: (rows that need not wait, rows changed, whether the last is given up)."""
    pull = -1  # the first row of the stretch that pulls
    changed = 0
    for i in range(len(kind)):
        if lays[i]:
            if pull >= 0 and i - pull <= patience:
                changed += judge_kernel(kind, e, length, flags, pull, i, action)
            pull, given_up = -1, False
        elif pull < 0 and not given_up and (e[i] < 0.0 or kind[i] == RETRACT or kind[i] == UNRETRACT):
            pull = i
    if pull >= 0 and len(kind) - pull > patience:
        pull, given_up = -1, True
    return (pull if pull >= 0 else len(kind)), changed, given_up


def replace_retracts(chunks: Iterable[Moves]) -> Iterator[Moves]:
    """Take the slicer's retracts, unretracts and wipes' E out of a stream of moves; rows and numbers stay."""
    waiting = Moves.empty()
    laid = given_up = False
    for chunk in chunks:
        waiting = Moves.concat([waiting, chunk]) if len(waiting) else chunk
        lays = waiting.deposits
        action = np.zeros(len(waiting), dtype=np.int8)
        free, changed, given_up = stretches_kernel(
            waiting.kind, waiting.e, waiting.length, waiting.flags, lays, PATIENCE, given_up, action
        )
        laid = laid or bool(lays.any())
        if free:
            yield _changed(waiting[:free], action[:free]) if changed else waiting[:free]
            waiting = waiting[free:]
    if len(waiting):
        action = np.zeros(len(waiting), dtype=np.int8)
        of = (waiting.kind, waiting.e, waiting.length, waiting.flags)
        yield _changed(waiting, action) if laid and judge_kernel(*of, 0, len(waiting), action) else waiting


def _changed(moves: Moves, action: NDArray[np.int8]) -> Moves:
    """Carry out what was decided about each row."""
    return moves.replace(
        kind=np.where(action == DROP, np.int8(Kind.NOTHING), moves.kind),
        e=np.where(action == KEEP, moves.e, 0.0),
        end=np.where(action == DROP, moves.start, moves.end),
        flags=np.where(action == STILL, moves.flags | int(Flag.PART), moves.flags).astype(moves.flags.dtype),
    )
