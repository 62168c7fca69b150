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

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats
from gcodectl.jit import jit
from gcodectl.records import Flag, Kind, Moves

PRIME = 2.0
UNLOAD = 15.0
"""mm of E."""
PATIENCE = 20_000
KEEP, DROP, STILL = 0, 1, 2

RETRACT, UNRETRACT = int(Kind.RETRACT), int(Kind.UNRETRACT)


@jit
def retracts_kernel(kind: NDArray[np.int8], e: Floats, length: Floats, known: Bools, action: NDArray[np.int8]) -> None:
    """Decide each row of a stretch: keep it, drop its line, or keep its path without E."""
    pulled = 0.0
    total = 0.0
    for i in range(len(kind)):
        if kind[i] == RETRACT or kind[i] == UNRETRACT:
            action[i] = DROP
        elif not known[i] or e[i] == 0.0:
            continue
        elif e[i] < 0.0:
            pulled -= e[i]
            total -= e[i]
            action[i] = STILL if length[i] > 0.0 else DROP
        elif pulled > 0.0 and e[i] < PRIME * pulled:
            pulled = max(0.0, pulled - e[i])
            action[i] = DROP
    if total >= UNLOAD:
        action[:] = KEEP


def replace_retracts(chunks: Iterable[Moves]) -> Iterator[Moves]:
    """Take the slicer's retracts, unretracts and wipes' E out of a stream of moves; rows and numbers stay."""
    waiting = Moves.empty()
    laid = given_up = False
    for chunk in chunks:
        waiting = Moves.concat([waiting, chunk])
        roads = np.flatnonzero(waiting.deposits)
        if given_up and len(roads):
            given_up, start = False, int(roads[0]) + 1
            yield waiting[:start]
            waiting, roads = waiting[start:], roads[1:] - start
        if len(roads):
            done = int(roads[-1]) + 1
            yield _judge(waiting[:done], roads)
            waiting, laid = waiting[done:], True
        free = len(waiting) if given_up else _first_pull(waiting)
        if free:
            yield waiting[:free]
            waiting = waiting[free:]
        given_up = given_up or len(waiting) > PATIENCE
    if len(waiting):
        yield _judge(waiting, np.array([len(waiting)])) if laid and not given_up else waiting


def _first_pull(moves: Moves) -> int:
    """The first row that must wait for the next road to be judged; the number of rows where there is none."""
    pulls = (moves.e < 0) | np.isin(moves.kind, (Kind.RETRACT, Kind.UNRETRACT))
    return int(pulls.argmax()) if pulls.any() else len(moves)


def _judge(moves: Moves, roads: NDArray[np.int64]) -> Moves:
    """Judge every stretch of `moves` that ends at one of the rows `roads`."""
    if _first_pull(moves) == len(moves):
        return moves
    moving = (moves.kind == Kind.LINE) | (moves.kind == Kind.ARC)
    alone = (moves.length == 0) & np.isfinite(moves.e)
    known = moving & (alone | ((moves.flags & int(Flag.KNOWN)) != 0))
    action = np.zeros(len(moves), dtype=np.int8)
    begin = 0
    for end in roads[np.diff(roads, prepend=-1) > 1].tolist():
        begin += _first_pull(moves[begin:end])
        stretch = slice(begin, end if end - begin <= PATIENCE else begin)
        retracts_kernel(moves.kind[stretch], moves.e[stretch], moves.length[stretch], known[stretch], action[stretch])
        begin = end
    return moves.replace(
        kind=np.where(action == DROP, np.int8(Kind.NOTHING), moves.kind),
        e=np.where(action == KEEP, moves.e, 0.0),
        end=np.where(action == DROP, moves.start, moves.end),
        flags=np.where(action == STILL, moves.flags | int(Flag.PART), moves.flags).astype(moves.flags.dtype),
    )
