"""Steer: the plunger's rate that makes the fitted flow models give the flow that the roads ask for.

    profile --> flow wanted on a grid of dt --> Inversion of the tool in use, block by block --> u --> Command

What a tool's barrel holds is carried from block to block, and kept while another tool prints. A passage (from one
barrier or tool change to the next) is steered by itself: nothing is begun before it or left to do after it, but where
the wait is too short for that. Samples are decided once the `horizon` of their block is known; moves leave when every
sample under them is. Blocks are counted from where their passage began: any chunking gives the same signal.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from gcodectl.flow.grid import Waiting, passage_times, phase_rates, reference_kernel
from gcodectl.flow.inversion import Inversion
from gcodectl.flow.plungers import Plungers
from gcodectl.records import Composed, Moves, Profile, SpeedPlan, Tasks

SAMPLES = 3 << 16
"""What is steered at once: memory does not grow with how slowly a file prints."""

Timed = tuple[Moves, SpeedPlan, Profile]


def short_pieces(chunks: Iterable[Timed], most: float) -> Iterator[Timed]:
    """Cut chunks where `most` seconds of motion have passed since they, or their piece before, began."""
    for moves, speeds, profile in chunks:
        while len(profile) and profile.t[-1] - profile.t[0] > most:
            row = profile.row[int(np.searchsorted(profile.t, profile.t[0] + most))]
            rows, phases = int(row - moves.row[0]), int(np.searchsorted(profile.row, row))
            if not phases:  # one row takes longer
                row = profile.row[0] + 1
                rows, phases = int(row - moves.row[0]), int(np.searchsorted(profile.row, row))
                if phases == len(profile):
                    break
            yield moves[:rows], speeds[:rows], profile[:phases]
            moves, speeds, profile = moves[rows:], speeds[rows:], profile[phases:]
        yield moves, speeds, profile


def steer(chunks: Iterable[Timed], inversions: Sequence[Inversion | None], dt: float) -> Iterator[Composed]:
    """Steer each tool's plunger by its inversion, None for a tool that obeys at once; samples of dt, s.

    What is composed has no tasks: nothing is laid over them.
    """
    ones = np.ones(len(inversions))
    plungers: Plungers | None = None
    waiting = Waiting()
    now = 0.0
    for moves, speeds, profile in short_pieces(chunks, SAMPLES * dt):
        waiting.add(moves, speeds, profile, Tasks.empty())
        if plungers is None:
            if not len(moves):
                continue
            plungers = Plungers(inversions, int(moves.tool[0]))
        now = float(profile.t[-1] + profile.duration[-1]) if len(profile) else now
        plungers.grow(int(now / dt) + 2)
        reference_kernel(*phase_rates(moves, profile, ones), plungers.first, dt, plungers.wanted)
        begins = np.ceil(passage_times(moves, profile, now) / dt).astype(np.int64)
        plungers.begin_passages(begins, moves.tool[moves.starts_passage].astype(np.int64))
        plungers.decide(int(now / dt), ended=False)
        # a phase that ends with a sample has its end in the next one
        settled = min((plungers.decided - 1) * dt, now)
        yield from waiting.leave(settled, plungers.u, plungers.wanted, plungers.first, dt)
        plungers.forget(int(min(waiting.since, now) / dt) - 2)
    if plungers is not None:
        plungers.decide(int(now / dt), ended=True)
        yield from waiting.leave(np.inf, plungers.u, plungers.wanted, plungers.first, dt)
