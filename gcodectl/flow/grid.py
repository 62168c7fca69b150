"""The grid of time that signals are composed on: the reference, where passages begin, and which moves may leave.

    phases of the profile  |----|--|-------|---|        volume by phase, spread over the cells it falls in
    cells of dt            | | | | | | | | | | |  ...   sample n holds from n dt until (n + 1) dt

Moves leave, with the samples under them, when every one of those is final.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.records import Command, Composed, Moves, Profile, SpeedPlan, Tasks, deposits_kernel


@jit_lean
def reference_kernel(
    t: Floats, duration: Floats, v: Floats, a: Floats, j: Floats, rate: Floats, first: int, dt: float, out: Floats
) -> None:
    """Add each phase's volume, `rate` mm^3 a mm of path, to the cells of the grid it falls in, as mm^3/s."""
    for p in range(len(t)):
        begins, lasts = t[p], duration[p]
        if rate[p] == 0.0 or lasts <= 0.0:
            continue
        per, speed, half_a, sixth_j = rate[p] / dt, v[p], a[p] / 2.0, j[p] / 6.0
        gone = 0.0
        cell = int(np.floor(begins / dt))
        x = (cell + 1) * dt - begins  # since the phase's begin
        while x < lasts:
            reach = x * (speed + x * (half_a + x * sixth_j))
            out[cell - first] += per * (reach - gone)
            gone = reach
            cell += 1
            x = (cell + 1) * dt - begins
        out[cell - first] += per * (lasts * (speed + lasts * (half_a + lasts * sixth_j)) - gone)


@jit_lean
def phase_rates_kernel(
    phase_row: Ints, first: int, e: Floats, area: Floats, length: Floats, flags: NDArray[np.int16],
    tool: NDArray[np.int16], steady: Floats, rate: Floats,
) -> None:  # fmt: skip
    """Fill the rate of every phase; the first move is row `first`."""
    for p in range(len(phase_row)):
        i = phase_row[p] - first
        rate[p] = 0.0
        if deposits_kernel(e[i], length[i], flags[i]):
            rate[p] = e[i] * area[i] / length[i] * steady[min(max(tool[i], 0), len(steady) - 1)]


def phase_rates(
    moves: Moves, profile: Profile, steady: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """Return what `reference_kernel` takes of each phase; `steady` is the plunger's rate a unit of flow, by tool."""
    rate = np.empty(len(profile))
    if len(profile):
        phase_rates_kernel(
            profile.row, int(moves.row[0]), moves.e, moves.area, moves.length, moves.flags, moves.tool, steady, rate
        )
    return profile.t, profile.duration, profile.v, profile.a, profile.j, rate


def passage_times(moves: Moves, profile: Profile, now: float) -> Floats:
    """When the passages after the barriers and tool changes among `moves` begin, s."""
    after = np.searchsorted(profile.row, moves.row[moves.starts_passage], side="right")
    times = np.full(len(after), now)
    inside = after < len(profile)
    times[inside] = profile.t[after[inside]]
    return times


def ready(moves: Moves, profile: Profile, settled: float) -> tuple[int, int]:
    """How many rows and phases may leave: those whose every sample is final."""
    late = int(np.searchsorted(profile.t, settled, side="right"))
    while late and profile.t[late - 1] + profile.duration[late - 1] > settled:  # the phase under way
        late -= 1
    if late == len(profile):
        return len(moves), late
    row = profile.row[late]
    return int(row - moves.row[0]), int(np.searchsorted(profile.row, row))


def command_of(profile: Profile, u: Floats, reference: Floats, first: int, dt: float) -> Command:
    """Cut the samples under `profile` out of two rows whose first sample is number `first` of the grid."""
    if not len(profile):
        return Command.none(dt)
    low = int(profile.t[0] / dt)
    high = int((profile.t[-1] + profile.duration[-1]) / dt) + 1
    part = slice(low - first, high - first)
    return Command(t0=low * dt, dt=dt, u=u[part].copy(), reference=reference[part].copy())


class Waiting:
    """Moves, and what is known about them, that have come and whose samples are not all final: chunks as they came."""

    def __init__(self) -> None:
        self.pieces: deque[tuple[Moves, SpeedPlan, Profile]] = deque()
        self.tasks = Tasks.empty()
        self._left = 0, 0  # rows and phases of the first piece that have left

    @property
    def since(self) -> float:
        """When the first phase that waits begins, s; inf where none does."""
        begin = self._left[1]
        for _, _, profile in self.pieces:
            if len(profile) > begin:
                return float(profile.t[begin])
            begin = 0
        return np.inf

    def add(self, moves: Moves, speeds: SpeedPlan, profile: Profile, tasks: Tasks) -> None:
        """Take what has come."""
        self.tasks = Tasks.concat([self.tasks, tasks]) if len(self.tasks) else tasks
        if len(moves):
            self.pieces.append((moves, speeds, profile))

    def leave(self, settled: float, u: Floats, reference: Floats, first: int, dt: float) -> Iterator[Composed]:
        """Give what may leave, with its signal; samples before `settled`, s, are final, number `first` is u[0]."""
        while self.pieces:
            moves, speeds, profile = self.pieces[0]
            rows, phases = ready(moves, profile, settled)
            row, phase = self._left
            self._left = rows, phases = max((row, phase), (rows, phases))
            if rows > row:
                before = float(profile.t[phases - 1]) if phases > phase else -np.inf
                count = int(np.searchsorted(self.tasks.t0, before))
                tasks, self.tasks = self.tasks[:count], self.tasks[count:]
                part = profile[phase:phases]
                command = command_of(part, u, reference, first, dt)
                yield Composed(moves[row:rows], speeds[row:rows], part, tasks, command)
            if rows < len(moves):
                return
            self.pieces.popleft()
            self._left = 0, 0
        if settled == np.inf and len(self.tasks):
            nothing = command_of(Profile.empty(), u, reference, first, dt)
            yield Composed(Moves.empty(), SpeedPlan.empty(), Profile.empty(), self.tasks, nothing)
            self.tasks = Tasks.empty()
