"""Cut a learned signal into basis signals where it leaves its steady level, and settles on it again.

          u      Start                 Corner                 Stop
                  |\\                   |   /\\                 |
      steady ....:..\\____steady______.|../..\\___steady______.|................
                 :  |    |            \\  /   |              | \\     |
      zero ______|  :    :            :\\/    :              :  \\  __|_________
           No-Flow  :    :            :      :              :   \\/  : No-Flow
                 first  last       first    last         first     last

Rules
- The steady level is the mean over what Steady-State keeps: first guessed by the middle of the two stretches, then
  taken again between the demarcation points that this guess gave.
- A demarcation point is where the signal has been within a threshold of its level (zero or steady) for a while; it is
  looked for outward from the task, before and after. The threshold is 1 % of the steady level, or three standard
  deviations of the signal about its level at rest where noise is larger than that. A task that never comes to rest
  (a yield-stress paste is drawn back a little for long after a Stop) ends where the signal is within 10 % instead, and
  failing that half way to its neighbour.
- Steady-State is stored as its mean, No-Flow as zero: one sample each, which may be repeated as long as need be.
- Lead: from the first sample to the road's begin (Start), its end (Stop), the middle of the dip (Corner).

Source: Hoelzle et al., "Iterative Learning Control Using a Basis Signal Library", sections III.B and III.C, matrix (3).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from gcodectl.columns import Bools, Floats
from gcodectl.errors import InputError
from gcodectl.flow.library import BasisSet, BasisSignal
from gcodectl.learn.reference import Routine
from gcodectl.records import TaskKind

CALM = 0.25
"""Seconds within the threshold that count as having come to rest."""
LOOSE = 0.10
"""Share of the steady level that will do where the signal does not come to rest."""


@dataclasses.dataclass(frozen=True)
class Segments:
    """Where the tasks' signals lie in a learned signal: samples first (included) to last (excluded)."""

    start: tuple[int, int]
    corner: tuple[int, int]
    stop: tuple[int, int]
    steady: float
    """Steady-State's mean, mm^3/s."""
    threshold: float
    """mm^3/s"""

    def in_order(self, samples: int) -> list[tuple[TaskKind, int, int]]:
        """Return the whole signal's tasks in order: kind, first, last (excluded)."""
        return [
            (TaskKind.NO_FLOW, 0, self.start[0]),
            (TaskKind.START, *self.start),
            (TaskKind.STEADY, self.start[1], self.corner[0]),
            (TaskKind.CORNER, *self.corner),
            (TaskKind.STEADY, self.corner[1], self.stop[0]),
            (TaskKind.STOP, *self.stop),
            (TaskKind.NO_FLOW, self.stop[1], samples),
        ]


def find_segments(u: Floats, routine: Routine) -> Segments:
    """Find the demarcation points of a learned signal `u` (n samples, mm^3/s).

    Raises InputError where it has no steady level above zero: then nothing was learned.
    """
    assert u.shape == routine.t.shape, "the signal is not the routine's"
    at = [round(t / routine.dt) for t in (routine.start, *routine.corner, routine.stop)]
    middles = [slice((2 * low + high) // 3, (low + 2 * high) // 3) for low, high in ((at[0], at[1]), (at[2], at[3]))]
    rest = u[: at[0] // 2]
    level = float(np.median(np.concatenate([u[middle] for middle in middles])))
    noise = np.concatenate([rest, *(u[middle] - np.median(u[middle]) for middle in middles)])
    deviation = 1.4826 * float(np.median(np.abs(noise)))  # robust: a task that reaches far in must not hide itself
    segments = _between(u, routine, at, level, max(0.01 * level, 3 * deviation))
    inside = np.concatenate([u[segments.start[1] : segments.corner[0]], u[segments.corner[1] : segments.stop[0]]])
    steady = float(inside.mean()) if len(inside) else level
    if not steady > 0:
        raise InputError(f"the learned signal has no steady level above zero (it is {steady:.3g} mm^3/s)")
    return _between(u, routine, at, steady, max(0.01 * steady, 3 * deviation))


def _between(u: Floats, routine: Routine, at: list[int], level: float, threshold: float) -> Segments:
    """Return the segments for one steady level; `at` are start, brake, again and stop as samples."""
    start, brake, again, stop = at
    calm = round(CALM / routine.dt)
    halves = ((start + brake) // 2, (again + stop) // 2)
    off_zero, off_level = np.abs(u), np.abs(u - level)

    def rest(off: Floats, begin: int, limit: int) -> int:
        for within in (threshold, max(threshold, LOOSE * level)):
            found = _first_calm(off <= within, begin, limit, calm)
            if found is not None:
                return found
        return limit

    return Segments(
        start=(rest(off_zero, start, 0), rest(off_level, start, halves[0])),
        corner=(rest(off_level, brake, halves[0]), rest(off_level, again, halves[1])),
        stop=(rest(off_level, stop, halves[1]), rest(off_zero, stop, len(u))),
        steady=level,
        threshold=threshold,
    )


def _first_calm(quiet: Bools, begin: int, limit: int, calm: int) -> int | None:
    """Return where, going from `begin` to `limit` (back or forth), `calm` quiet samples begin; None where nowhere."""
    seen = quiet[begin:limit] if limit >= begin else quiet[limit:begin][::-1]
    run = 0
    for k, still in enumerate(seen):
        run = run + 1 if still else 0
        if run == calm:
            away = k + 1 - calm
            return begin + away if limit >= begin else begin - away
    return None


def basis_set(
    u: Floats, routine: Routine, *, material: str, nozzle: float, training: Mapping[str, Any] | None = None
) -> BasisSet:
    """Segment a learned signal (n samples, mm^3/s) into the basis set of `material` in a nozzle (mm).

    Samples are kept to 1e-6 of the nominal flow, so that the last bits of a machine's arithmetic do not matter.
    """
    segments = find_segments(u, routine)
    digits = 6 - int(np.floor(np.log10(routine.flow)))

    def cut(span: tuple[int, int], task: float, dip: float = 0.0) -> BasisSignal:
        first, last = span
        values = np.round(u[first : max(last, first + 1)], digits) + 0.0  # no -0.0
        return BasisSignal(values, lead=round(task - first * routine.dt, 6), dip=round(dip, 6))

    signals = {
        TaskKind.STOP: cut(segments.stop, routine.stop),
        TaskKind.START: cut(segments.start, routine.start),
        TaskKind.CORNER: cut(segments.corner, routine.corner_middle, routine.dip),
        TaskKind.STEADY: BasisSignal(np.array([round(segments.steady, digits)])),
        TaskKind.NO_FLOW: BasisSignal(np.zeros(1)),
    }
    return BasisSet(material, nozzle, routine.dt, routine.flow, signals, training=dict(training or {}))
