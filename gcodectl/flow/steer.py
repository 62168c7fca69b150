"""Steer: the plunger's rate that makes the fitted flow models give the flow that the roads ask for.

    profile --> flow wanted on a grid of dt --> Inversion of the tool in use, block by block --> u --> Command

What a tool's barrel holds is carried from block to block, and kept while another tool prints. A passage (from one
barrier or tool change to the next) is steered by itself: nothing is begun before it or left to do after it, but where
the wait is too short for that. Samples are decided once the `horizon` of their block is known; moves leave when every
sample under them is. Blocks are counted from where their passage began: any chunking gives the same signal.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.flow_model import STATE, STORED
from gcodectl.flow.grid import Waiting, passage_times, phase_rates, reference_kernel
from gcodectl.flow.inversion import BLOCK, Inversion
from gcodectl.flow.pursuit import advance_kernel
from gcodectl.records import Composed, Moves, Profile, SpeedPlan, Tasks

LONGEST_REST = 6000
"""Samples after which a barrel that nobody pushes does not change any more."""


@dataclasses.dataclass
class _Barrel:
    """What one tool's barrel held, and how its plunger moved, when sample `at` began."""

    state: Floats
    last: float = 0.0
    at: int = 0

    def rest_until(self, at: int, inversion: Inversion) -> None:
        """Let it stand until sample `at`."""
        idle = np.zeros(min(max(at - self.at, 0), LONGEST_REST))
        p = inversion.model.parameters
        self.last = float(advance_kernel(self.state, idle, inversion.dt, inversion.slew, self.last, p))
        self.at = at


def _begin(inversion: Inversion | None) -> Floats:
    """Return the state before anything moved; a barrel without a yield stress waits as it is, and is not drawn back."""
    state = inversion.model.at_rest if inversion else np.zeros(STATE)
    if inversion:
        state[STORED] = min(state[STORED], inversion.rest)
    return state


class _Grid:
    """The flow wanted and the rates decided, from sample `first` on; passages not yet behind us."""

    def __init__(self, inversions: Sequence[Inversion | None], dt: float, tool: int) -> None:
        self.inversions, self.dt = inversions, dt
        self.first = self.decided = 0
        self.wanted: Floats = np.zeros(0)
        self.u: Floats = np.zeros(0)
        self.passages: list[tuple[int, int]] = [(0, tool)]
        """First sample and tool of each."""
        self.barrels = [_Barrel(_begin(one)) for one in inversions]

    def add(self, moves: Moves, profile: Profile, until: float) -> None:
        """Take the flow that new phases ask for, and the passages that begin among them."""
        missing = int(until / self.dt) + 2 - self.first - len(self.wanted)
        if missing > 0:
            self.wanted = np.concatenate([self.wanted, np.zeros(max(missing, len(self.wanted) // 2))])
        ones = np.ones(len(self.inversions))
        reference_kernel(*phase_rates(moves, profile, ones), self.first, self.dt, self.wanted)
        begins = np.ceil(passage_times(moves, profile, until) / self.dt).astype(np.int64)
        self.passages += list(zip(begins.tolist(), moves.tool[moves.starts_passage].tolist(), strict=True))

    def decide(self, known: int, *, ended: bool) -> None:
        """Decide the rates of every block whose horizon lies before sample `known`."""
        parts = [self.u[: self.decided - self.first]]
        while self.decided < known or (ended and self.decided < known + 1):
            while len(self.passages) > 1 and self.passages[1][0] <= self.decided:
                self.passages.pop(0)
            begin, tool = self.passages[0]
            wall = self.passages[1][0] if len(self.passages) > 1 else known + 1 if ended else None
            done = (self.decided - begin) // BLOCK * BLOCK + BLOCK + begin
            if (part := self._block(begin, done, wall, known, min(max(tool, 0), len(self.inversions) - 1))) is None:
                break
            parts.append(part)
            self.decided += len(part)
        self.u = np.concatenate(parts)

    def _block(self, since: int, done: int, wall: int | None, known: int, tool: int) -> Floats | None:
        """Return the rates up to sample `done` or the wall; None where what comes later must be known first."""
        inversion, barrel = self.inversions[tool], self.barrels[tool]
        delay = inversion.delay if inversion else 0.0
        reach = inversion.reach if inversion else 0
        sees = done + (inversion.horizon if inversion else 0) + int(delay) + 2 + reach
        if wall is None and sees > known:
            return None
        last = sees if wall is None else min(sees, wall)
        done = done if wall is None else min(done, wall)
        begin = max(self.decided - reach, since)
        asked = np.zeros(reach + sees - self.decided)
        there = self.wanted[begin - self.first : last - self.first]
        asked[begin - self.decided + reach :][: len(there)] = there
        if inversion is None:
            return asked[: done - self.decided]
        barrel.rest_until(self.decided, inversion)
        u, barrel.last = inversion.solve(inversion.ask(asked), done - self.decided, barrel.state, barrel.last)
        barrel.at = done
        return u

    def forget(self, before: int) -> None:
        """Let go of samples before `before`, but for what blocks look back at."""
        before -= max((one.reach for one in self.inversions if one), default=0)
        gone = min(before, self.decided) - self.first
        if gone > 4096:
            self.wanted, self.u, self.first = self.wanted[gone:].copy(), self.u[gone:].copy(), self.first + gone


def steer(
    chunks: Iterable[tuple[Moves, SpeedPlan, Profile, Tasks, float]],
    inversions: Sequence[Inversion | None],
    dt: float,
) -> Iterator[Composed]:
    """Steer each tool's plunger by its inversion, None for a tool that obeys at once; samples of dt, s."""
    grid: _Grid | None = None
    waiting = Waiting()
    now = 0.0
    for moves, speeds, profile, tasks, known in chunks:
        waiting.add(moves, speeds, profile, tasks)
        ended = known == np.inf
        if grid is None:
            if not len(waiting.moves):
                continue
            grid = _Grid(inversions, dt, int(waiting.moves.tool[0]))
        now = float(profile.t[-1] + profile.duration[-1]) if len(profile) else now
        grid.add(moves, profile, now)
        grid.decide(int(now / dt), ended=ended)
        # a phase that ends with a sample has its end in the next one
        settled = np.inf if ended else min((grid.decided - 1) * dt, known)
        composed = waiting.leave(settled, grid.u, grid.wanted, grid.first, dt)
        if len(composed.moves) or ended:
            yield composed
            if len(waiting.profile):
                grid.forget(int(waiting.profile.t[0] / dt) - 2)
