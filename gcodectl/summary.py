"""What a filter says of its run: counted from what is composed, chunk by chunk, on its way out."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.jit import jit_lean
from gcodectl.motion.limits import Limit
from gcodectl.records import Composed, deposits_kernel

if TYPE_CHECKING:
    from gcodectl.thermal.tally import Tally

START, STOP = int(Limit.START), int(Limit.STOP)
KINDS = max(Limit) + 1
STARTS, STOPS, ROADS, RULER, ON_ROAD, COUNTS = range(KINDS, KINDS + 6)
"""What is counted, behind the moves by each Limit: edges that were slowed, and roads; then what goes on from the rows
before: the Limit that ruled the last that moved, and whether it was on a road."""


@dataclasses.dataclass
class Summary:
    """What a run found on its way; complete when the run is."""

    lines: int = 0
    roads: int = 0
    layers: int = 0
    time_s: float = 0.0
    slowed_starts: int = 0
    slowed_stops: int = 0
    """Ends of roads at which the plunger ruled the acceleration."""
    slowed_s: float = 0.0
    """About how much longer the file takes for it."""
    limited_by: dict[str, int] = dataclasses.field(default_factory=lambda: {one.label: 0 for one in Limit if one})
    """Moves by what limits their speed, or their acceleration."""
    heat: Tally | None = None
    """What was found beneath the roads, where a heat profile was given."""
    already_filtered: bool = False


@jit_lean
def count_kernel(
    flags: NDArray[np.int16], e: Floats, length: Floats, distance: Floats, rests: Bools, cruise: Floats,
    accel: Floats, own_accel: Floats, limited_by: NDArray[np.int8], ruled_by: NDArray[np.int8], row: Ints,
    phase_row: Ints, duration: Floats, counts: Ints,
) -> float:  # fmt: skip
    """Bring `counts` up to date; returns about how many seconds longer the rows take for their slowed edges."""
    slowed, p = 0.0, 0
    for i in range(len(distance)):
        took = 0.0
        while p < len(phase_row) and phase_row[p] == row[i]:
            took += duration[p]
            p += 1
        ruler = ruled_by[i]
        counts[limited_by[i]] += 1
        counts[ruler] += 1
        if ruler > 0:  # what a ramp loses against cruising goes with one over its acceleration
            slowed += (1.0 - accel[i] / own_accel[i]) * max(took - distance[i] / cruise[i], 0.0)
        if not (distance[i] > 0.0 or rests[i]):
            continue
        if ruler != counts[RULER]:
            counts[STARTS] += ruler == START
            counts[STOPS] += ruler == STOP
        lays = distance[i] > 0.0 and deposits_kernel(e[i], length[i], flags[i])
        counts[ROADS] += lays and counts[ON_ROAD] == 0
        counts[RULER], counts[ON_ROAD] = ruler, lays
    return slowed


def summed(chunks: Iterable[Composed], summary: Summary) -> Iterator[Composed]:
    """What is composed, as it comes, counted into `summary`."""
    counts = np.zeros(COUNTS, dtype=np.int64)
    for chunk in chunks:
        moves, speeds, profile = chunk.moves, chunk.speeds, chunk.profile
        if len(moves):
            summary.slowed_s += count_kernel(
                moves.flags, moves.e, moves.length, speeds.distance, speeds.rests, speeds.cruise, speeds.accel,
                speeds.own_accel, speeds.limited_by, speeds.ruled_by, moves.row, profile.row, profile.duration, counts,
            )  # fmt: skip
            summary.lines = int(moves.line[-1])
            summary.layers = max(summary.layers, int(moves.layer.max()) + 1)
            summary.slowed_starts, summary.slowed_stops, summary.roads = map(int, counts[STARTS:RULER])
            summary.limited_by = {one.label: int(counts[one]) for one in Limit if one}
        if len(profile):
            summary.time_s = float(profile.t[-1] + profile.duration[-1])
        yield chunk
