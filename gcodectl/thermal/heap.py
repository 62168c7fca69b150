"""Heap: the nodes that wait, by rank, and where each of them stands, so that one whose rank falls can be moved up."""

from __future__ import annotations

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean


@jit_lean
def raise_kernel(heap: Ints, place: Ints, rank: Floats, at: int) -> None:
    """Move the node at a place of the heap towards its top."""
    node = heap[at]
    while at > 0:
        above = (at - 1) // 2
        if rank[heap[above]] <= rank[node]:
            break
        heap[at] = heap[above]
        place[heap[at]] = at
        at = above
    heap[at] = node
    place[node] = at


@jit_lean
def lower_kernel(heap: Ints, place: Ints, rank: Floats, count: int) -> None:
    """Move the node at the top of the heap, of `count` nodes, down to where it belongs."""
    node = heap[0]
    at = 0
    while True:
        below = 2 * at + 1
        if below >= count:
            break
        if below + 1 < count and rank[heap[below + 1]] < rank[heap[below]]:
            below += 1
        if rank[heap[below]] >= rank[node]:
            break
        heap[at] = heap[below]
        place[heap[at]] = at
        at = below
    heap[at] = node
    place[node] = at
