"""The score of a print: how well the bead fits, what fell beside it, how long it took.

rmse      root mean square over the bins of all roads of (deposited volume / target volume - 1)
off_path  volume deposited anywhere but on a road, as a share of the target volume
time_s    the whole build

A lower error bought with time shows as such: the three are never told apart.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.records import Signal
from plant_models.bead import Roads, deposit
from plant_models.firmware import Execution
from plant_models.match import Places, match, visited

MOST_UNVISITED = 0.2


@dataclasses.dataclass(frozen=True)
class Score:
    """How well a print went; shares are of 1, volumes mm^3."""

    rmse: float
    off_path: float
    time_s: float
    bias: float
    """Mean error of the bins: negative is too little."""
    median: float
    """The middle one of the bins' errors: on long roads, that of the steady flow."""
    worst: float
    """The bin error furthest from 0."""
    worst_x: float
    worst_y: float
    worst_z: float
    worst_line: int
    """Line of ORIGINAL that the worst bin lies on."""
    on_road: float
    """Volume on the roads as a share of the target volume."""
    target_volume: float
    bins: int
    roads: int
    unvisited: float
    """Share of the roads' length that FILE never passes over."""

    def table(self) -> dict[str, float | int]:
        """Return the fields by name, for JSON."""
        return dataclasses.asdict(self)


def bin_errors(
    roads: Roads, execution: Execution, flow: Signal, places: Places | None = None
) -> tuple[Floats, float, float]:
    """Return deposited / target - 1 of each bin, the volume off path (mm^3), and the unvisited share of the roads.

    Raises InputError where ORIGINAL has no roads, or where FILE leaves more than a fifth of them out.
    """
    if not len(roads.target):
        raise InputError("there is nothing to score: the target lays no road (no move with both path and E > 0)")
    low, high = match(roads, execution.segments) if places is None else places
    unvisited = max(0.0, 1.0 - visited(roads, low, high))
    if unvisited > MOST_UNVISITED:
        raise InputError(
            f"{unvisited:.0%} of the target's roads are never passed over: this is another part, or it was moved; "
            "give the file it was made from as --target"
        )
    laid, off = deposit(roads, execution, low, high, flow)
    return laid / roads.target - 1.0, off, unvisited


def score(roads: Roads, execution: Execution, flow: Signal, places: Places | None = None) -> Score:
    """Score `flow` (q, mm^3/s, a channel a tool) under `execution` against `roads`; raises as `bin_errors` does.

    `places` is what `match` says of the execution's segments, for whoever scores one path many times.
    """
    errors, off, unvisited = bin_errors(roads, execution, flow, places)
    total = float(roads.target.sum())
    worst = int(np.argmax(np.abs(errors)))
    place = roads.middle[worst]
    return Score(
        rmse=float(np.sqrt(np.mean(errors**2))),
        off_path=off / total,
        time_s=execution.duration,
        bias=float(errors.mean()),
        median=float(np.median(errors)),
        worst=float(errors[worst]),
        worst_x=float(place[0]),
        worst_y=float(place[1]),
        worst_z=float(place[2]),
        worst_line=int(roads.path.line[roads.bin_segment[worst]]),
        on_road=float(((errors + 1.0) * roads.target).sum()) / total,
        target_volume=total,
        bins=len(errors),
        roads=int(roads.bin_road[-1]) + 1,
        unvisited=unvisited,
    )
