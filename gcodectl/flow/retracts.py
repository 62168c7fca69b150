"""Retracts: the slicer's own guesses at flow, taken out where learned signals take their place.

A slicer pulls E back after a road and pushes it out again before the next. Where Stop and Start signals are laid over
the tasks, these moves go: E-only moves and firmware retraction leave no line, a wipe (path with E < 0) keeps its path.
A push that is more than what was pulled back, by the factor PRIME or more, is no unretract but a prime or a purge, and
stays; so does a wipe whose line may not be rewritten.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats
from gcodectl.jit import jit
from gcodectl.records import Flag, Kind, Moves

PRIME = 2.0
KEEP, DROP, STILL = 0, 1, 2

RETRACT, UNRETRACT = int(Kind.RETRACT), int(Kind.UNRETRACT)


@jit
def retracts_kernel(
    kind: NDArray[np.int8], e: Floats, length: Floats, known: Bools, pulled: Floats, action: NDArray[np.int8]
) -> None:
    """Decide each row's action: keep it, drop its line, or keep its path without E. `pulled[0]` is carried, mm of E."""
    for i in range(len(kind)):
        action[i] = KEEP
        if kind[i] == RETRACT or kind[i] == UNRETRACT:
            action[i] = DROP
        elif not known[i] or e[i] == 0.0:
            continue
        elif e[i] < 0.0:
            pulled[0] -= e[i]
            action[i] = STILL if length[i] > 0.0 else DROP
        elif length[i] > 0.0:
            pulled[0] = 0.0
        elif pulled[0] > 0.0 and e[i] < PRIME * pulled[0]:
            pulled[0] = max(0.0, pulled[0] - e[i])
            action[i] = DROP


def replace_retracts(chunks: Iterable[Moves]) -> Iterator[Moves]:
    """Take the slicer's retracts, unretracts and wipes' E out of a stream of moves; rows and numbers stay."""
    pulled = np.zeros(1)
    for moves in chunks:
        action = np.empty(len(moves), dtype=np.int8)
        moving = (moves.kind == Kind.LINE) | (moves.kind == Kind.ARC)
        alone = (moves.length == 0) & np.isfinite(moves.e)
        known = moving & (alone | ((moves.flags & int(Flag.KNOWN)) != 0))
        retracts_kernel(moves.kind, moves.e, moves.length, known, pulled, action)
        yield moves.replace(
            kind=np.where(action == DROP, np.int8(Kind.NOTHING), moves.kind),
            e=np.where(action == KEEP, moves.e, 0.0),
            end=np.where(action == DROP, moves.start, moves.end),
        )
