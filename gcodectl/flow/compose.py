"""Compose: tasks and the signal bank in, the plunger's rate over time out.

    profile --> reference q_ref / K on a grid of dt --+
                                                      +--> u --> within the plunger's limits --> Command
    tasks --> sequencer (concatenate or superpose) ---+

A signal may begin its lead before its task, and what the plunger's cap cuts off is handed to REACH seconds on either
side: so samples are final `longest lead` and REACH behind what is known, and moves leave when every sample under them
is. Tasks are added in file order and each once: any chunking gives the same signal.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.config import Machine
from gcodectl.flow.bank import LEARNED_KINDS, SignalBank
from gcodectl.flow.events import due_share, flow_events, moments, unused_margin
from gcodectl.flow.grid import Waiting, passage_times, phase_rates, reference_kernel
from gcodectl.flow.sequencer import TRANSITIONS, concatenate_kernel, superpose_kernel
from gcodectl.jit import jit
from gcodectl.records import Composed, Moves, Profile, SpeedPlan, TaskKind, Tasks

REACH = 1.0
SEQUENCERS = ("superpose", "basis")


@jit
def hand_over_kernel(
    u: Floats, out: Floats, done: int, upto: int, final: bool, cap: float, reach: int, walls: Ints
) -> int:
    """Clip u[done:upto] to +-cap into `out`, handing each lump half to the room before it and half to that after it.

    A lump waits until `reach` samples after it are there, unless `final`, and no lump goes past one of the `walls`,
    samples in order that passages begin with, the first at or before `done`, the last out of reach. Returns up to where
    lumps have been dealt with; samples `reach` before that will not change any more.
    """
    k = done
    wall = 0
    while k < upto:
        if abs(u[k]) <= cap:
            k += 1
            continue
        while walls[wall + 1] <= k:
            wall += 1
        sign = 1.0 if u[k] > 0.0 else -1.0
        end = k
        lump = 0.0
        while end < min(upto, walls[wall + 1]) and sign * u[end] > cap:
            lump += sign * u[end] - cap
            end += 1
        if end + reach > upto and not final:
            return k
        before, after = 0.5 * lump, 0.5 * lump
        for step in range(1, reach + 1):
            low, high = k - step, end - 1 + step
            if low >= max(0, walls[wall]):
                took = min(before, max(0.0, cap - sign * out[low]))
                out[low] += sign * took
                before -= took
            if high < min(upto, walls[wall + 1]):
                took = min(after, max(0.0, cap - sign * out[high]))
                out[high] += sign * took
                after -= took
        k = end
    return k


@dataclasses.dataclass
class _Grid:
    """The samples under way, from `first` on: all arrays are as long as what is known or begun."""

    first: int = 0
    reference: Floats = dataclasses.field(default_factory=lambda: np.zeros(0))
    added: Floats = dataclasses.field(default_factory=lambda: np.zeros(0))
    u: Floats = dataclasses.field(default_factory=lambda: np.zeros(0))
    out: Floats = dataclasses.field(default_factory=lambda: np.zeros(0))
    summed: int = 0
    """Up to where u is final, counted from `first`."""
    dealt: int = 0
    """Up to where lumps over the cap have been dealt with."""

    def reach(self, samples: int) -> None:
        """Make room for samples up to `samples` from the start of time."""
        missing = samples - self.first - len(self.u)
        if missing > 0:
            grown = max(missing, len(self.u) // 2)
            for name in ("reference", "added", "u", "out"):
                setattr(self, name, np.concatenate([getattr(self, name), np.zeros(grown)]))

    def forget(self, before: int) -> None:
        """Let go of samples before `before`."""
        gone = max(0, min(before - self.first, self.dealt))
        if gone > 4096:
            for name in ("reference", "added", "u", "out"):
                setattr(self, name, getattr(self, name)[gone:].copy())
            self.first, self.summed, self.dealt = self.first + gone, self.summed - gone, self.dealt - gone


class _Upcoming:
    """Starts, Stops and Corners not yet behind us, as arrays for the kernels."""

    def __init__(self) -> None:
        self.tasks = Tasks.empty()
        self.start: Floats = np.zeros(0)
        self.begun: Ints = np.zeros(0, dtype=np.int64)

    def add(self, tasks: Tasks, start: Floats) -> None:
        """Take the tasks that have a signal, and when each one's passage since the last barrier began."""
        mine = np.isin(tasks.kind, LEARNED_KINDS)
        self.tasks = Tasks.concat([self.tasks, tasks[mine]])
        self.start = np.concatenate([self.start, start[mine]])
        self.begun = np.concatenate([self.begun, np.zeros(int(mine.sum()), dtype=np.int64)])

    def forget(self, before: float, state: Floats) -> None:
        """Let go of tasks that ended a minute or more before `before`; `state` holds the active one's place."""
        old = int(np.searchsorted(self.tasks.t1, before - 60.0))
        if old > 256:
            self.tasks, self.start, self.begun = self.tasks[old:], self.start[old:], self.begun[old:]
            state[1] = max(-1.0, state[1] - old)


def compose(
    chunks: Iterable[tuple[Moves, SpeedPlan, Profile, Tasks, float]],
    bank: SignalBank,
    machine: Machine,
    sequencer: str = "superpose",
) -> Iterator[Composed]:
    """Lay the bank's signals over the tasks of a stream of moves; see the module for what is held back and why."""
    assert sequencer in SEQUENCERS, sequencer
    grid, events, waiting = _Grid(), _Upcoming(), Waiting()
    passages: Floats = np.zeros(1)
    passage = np.full(1, -1.0)  # of the last Start
    sequencer_state = np.array([float(TaskKind.NO_FLOW), -1.0, 0.0, 0.0, 1e9, 0.0])
    reach = round(REACH / bank.dt)
    now = 0.0
    for moves, speeds, profile, tasks, known in chunks:
        waiting.add(moves, speeds, profile, tasks)
        ended = known == np.inf
        now = float(profile.t[-1] + profile.duration[-1]) if len(profile) else now
        passages = np.concatenate([passages, passage_times(moves, profile, now)])
        grid.reach(int(now / bank.dt) + 2)
        reference_kernel(*phase_rates(moves, profile, bank.steady), grid.first, bank.dt, grid.reference)
        start = passages[np.maximum(np.searchsorted(passages, tasks.t0, side="right") - 1, 0)]
        if sequencer == "superpose":
            _superpose(grid, bank, tasks, start, passage)
        else:
            events.add(tasks, start)
        final = int(now / bank.dt) + 1 if ended else max(0, int((known - bank.longest_lead) / bank.dt) - 1)
        upto = max(grid.summed, min(final - grid.first, len(grid.u)))
        if sequencer == "basis":
            _concatenate(grid, bank, events, upto, sequencer_state)
        else:
            grid.u[grid.summed : upto] = grid.reference[grid.summed : upto] + grid.added[grid.summed : upto]
        grid.out[grid.summed : upto] = np.clip(grid.u[grid.summed : upto], -machine.max_flow, machine.max_flow)
        grid.summed = upto
        walls = np.append(np.ceil(passages / bank.dt).astype(np.int64) - grid.first, np.iinfo(np.int64).max)
        grid.dealt = hand_over_kernel(grid.u, grid.out, grid.dealt, upto, ended, machine.max_flow, reach, walls)
        # what is still to come looks for its passage no earlier than this
        passages = passages[max(np.searchsorted(passages, (grid.first + grid.dealt - 1) * bank.dt) - 1, 0) :]
        settled = np.inf if ended else (grid.first + grid.dealt - reach) * bank.dt
        yield from waiting.leave(settled, grid.out, grid.reference, grid.first, bank.dt)
        before = min(waiting.since, now)
        grid.forget(int(before / bank.dt) - 2 - reach)
        events.forget(before, sequencer_state)


def _superpose(grid: _Grid, bank: SignalBank, tasks: Tasks, start: Floats, passage: Floats) -> None:
    """Add what the tasks' signals add; a lasting change of flow is a part of a Start, or of a Stop."""
    some, begin, when = flow_events(tasks, start)
    scale = some.flow * due_share(some, begin, bank, passage)
    tool = np.clip(some.tool, 0, len(bank.steady) - 1).astype(np.int64)
    kind = some.kind.astype(np.int64)
    learned = bank.count[tool, kind] > 0
    if not learned.any():
        return
    grid.reach(int((when[learned].max() + bank.count.max() * bank.dt) / bank.dt) + 2)
    superpose_kernel(
        kind[learned], tool[learned], when[learned], unused_margin(some, bank)[learned], scale[learned], begin[learned],
        grid.first, bank.dt, bank.values, bank.count, bank.lead, bank.dip, bank.steady, grid.added,
    )  # fmt: skip


def _concatenate(grid: _Grid, bank: SignalBank, events: _Upcoming, upto: int, state: Floats) -> None:
    tasks = events.tasks
    tool = np.clip(tasks.tool, 0, len(bank.steady) - 1).astype(np.int64)
    stops = np.where(tasks.kind == TaskKind.STOP, tasks.t1, np.inf)
    road_end = np.minimum.accumulate(stops[::-1])[::-1]
    part = slice(grid.summed, upto)
    chosen = np.zeros(upto - grid.summed, dtype=np.int64)
    when = moments(tasks) + unused_margin(tasks, bank)
    concatenate_kernel(
        tasks.kind.astype(np.int64), tool, when, tasks.flow, tasks.dip, events.start, road_end,
        grid.first + grid.summed, grid.first + upto, bank.dt, grid.reference[part],
        bank.values, bank.count, bank.lead, bank.dip, bank.steady, TRANSITIONS, events.begun, state,
        np.empty((2, len(tasks))), grid.u[part], chosen,
    )  # fmt: skip
