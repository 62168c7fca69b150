"""What a filter says of its run: counted from what is composed, chunk by chunk, on its way out."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator

import numpy as np

from gcodectl.motion.limits import Limit
from gcodectl.records import Composed, SpeedPlan
from gcodectl.thermal.tally import Tally


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


def summed(chunks: Iterable[Composed], summary: Summary) -> Iterator[Composed]:
    """What is composed, as it comes, counted into `summary`."""
    ruler = 0
    for chunk in chunks:
        if len(chunk.moves):
            summary.lines = int(chunk.moves.line[-1])
            summary.layers = max(summary.layers, int(chunk.moves.layer.max()) + 1)
            _count_limits(chunk.speeds, summary)
            ruler = _count_slowed(chunk, summary, ruler)
        if len(chunk.profile):
            summary.time_s = float(chunk.profile.t[-1] + chunk.profile.duration[-1])
        if len(chunk.tasks):
            summary.roads = int(chunk.tasks.road.max())
        yield chunk


def _count_limits(speeds: SpeedPlan, summary: Summary) -> None:
    counts = np.bincount(speeds.limited_by, minlength=len(Limit)) + np.bincount(speeds.ruled_by, minlength=len(Limit))
    for one in Limit:
        if counts[one] and one:
            summary.limited_by[one.label] += int(counts[one])


def _count_slowed(chunk: Composed, summary: Summary, ruler: int) -> int:
    """Count the edges that were slowed; `ruler` is the Limit that ruled the last row before that moved."""
    moves, speeds, profile = chunk.moves, chunk.speeds, chunk.profile
    acts = (speeds.distance > 0) | speeds.rests
    ruled = speeds.ruled_by[acts]
    begins = (ruled > 0) & (ruled != np.concatenate([[ruler], ruled[:-1]]))
    summary.slowed_starts += int(np.sum(begins & (ruled == Limit.START)))
    summary.slowed_stops += int(np.sum(begins & (ruled == Limit.STOP)))
    if (ruled > 0).any():
        # what a ramp loses against cruising goes with one over its acceleration
        took = np.bincount(profile.row - moves.row[0], weights=profile.duration, minlength=len(moves))
        rows = np.flatnonzero(speeds.ruled_by > 0)
        eased = 1.0 - speeds.accel[rows] / speeds.own_accel[rows]
        laid = speeds.distance[rows] / speeds.cruise[rows]
        summary.slowed_s += float(np.sum(eased * np.maximum(took[rows] - laid, 0.0)))
    return int(ruled[-1]) if len(ruled) else ruler
