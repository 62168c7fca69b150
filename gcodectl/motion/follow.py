"""Follow: how fast a material's extruder can bring flow up and down, and how much of that time a road gives it.

From rest to flow q the plunger at its cap needs rise(q) seconds to fill the barrel, from q to rest fall(q) seconds to
empty it (what can be had during a travel, pressure up to just below yield, is not counted). A road that ramps its speed
within less asks for flow that no signal can give; a road that ramps slower costs time. Quality says what share of
those seconds a ramp is given, at starts and stops each:

    speed |        ______________         a_start = cruise / (start rise(bead cruise))
          |       /              \\        a_stop  = cruise / (stop fall(bead cruise))
          |      /                \\       neither above what is asked for without it
          |_____/__________________\\___
            start rise          stop fall

So a road loses half of (start rise + stop fall) at most. One too short for both ramps keeps its accelerations and
peaks lower, but never below `peak` of its cruising speed on the plunger's account: it takes 2 / peak of the time it
would at cruising speed, no more (but see zones.SPARE). BALANCED gives a ramp just those seconds, BEAD twice as many.
Corners are left alone: a longer dip costs time, and on most extruders more bead than it gives.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.jit import jit_lean

QUALITIES = {"TIME": 0.0, "BALANCED": 0.5, "BEAD": 1.0}


@jit_lean
def seconds_kernel(levels: Floats, seconds: Floats, tool: int, flow: float) -> float:
    """Seconds to bring a tool's flow up from rest to `flow`, mm^3/s, or down to it; 0 for none."""
    if not flow > 0.0:
        return 0.0
    one, last = min(max(tool, 0), len(levels) - 1), levels.shape[1] - 1
    if flow >= levels[one, last]:
        return float(seconds[one, last] * (flow / levels[one, last]))
    k = 0
    while levels[one, k] < flow:
        k += 1
    if k == 0:
        return float(seconds[one, 0])
    slope = (seconds[one, k] - seconds[one, k - 1]) / (levels[one, k] - levels[one, k - 1])
    return float(seconds[one, k - 1] + slope * (flow - levels[one, k - 1]))


@dataclasses.dataclass(frozen=True)
class Follow:
    """Seconds to bring flow up from rest and down to it, by tool and flow level; shares of them that ramps are given.

    Arrays of shape (tools, n); tools beyond the last use the last. Raises UsageError where they are no such table.
    """

    flow: Floats
    """Levels, mm^3/s, ascending, above 0; in between straight lines, beyond the last in proportion."""
    rise: Floats
    """Seconds from rest to each level."""
    fall: Floats
    """Seconds from each level to rest."""
    start: float
    """Share of `rise` that a road's start is given; 0: the start is left as it is."""
    stop: float
    peak: float = 0.5
    """The least share of its cruising speed that a road too short for its ramps must reach, where it could before."""

    def __post_init__(self) -> None:
        for name in ("flow", "rise", "fall"):
            table = np.array(getattr(self, name), dtype=np.float64, ndmin=2)
            object.__setattr__(self, name, table)
            fine = table.shape == self.flow.shape and table.size and np.isfinite(table).all() and (table >= 0).all()
            if not fine or (np.diff(table, axis=1) < 0).any():
                raise UsageError(f"what an extruder can follow: {name} must be finite, ascending, and as long as flow")
        if (self.flow[:, 0] <= 0).any() or (np.diff(self.flow, axis=1) <= 0).any():
            raise UsageError("what an extruder can follow: flow levels must ascend from above 0")
        for name in ("start", "stop"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise UsageError(
                    f"what an extruder can follow: {name} is {getattr(self, name)}; it must not be negative"
                )
        if not 0.0 < self.peak <= 1.0:
            raise UsageError(f"what an extruder can follow: peak is {self.peak}; it must be above 0, and 1 at most")

    @property
    def neutral(self) -> bool:
        """Whether nothing is slowed down."""
        return self.start == self.stop == 0.0


def share_of(quality: float) -> float:
    """Share of the extruder's own time that a road's ramps are given at a quality of 0 to 1."""
    return 2.0 * quality


def quality_named(text: str) -> float:
    """Return the quality that TIME, BALANCED, BEAD or a number from 0 to 1 stands for; UsageError for anything else."""
    if text.upper() in QUALITIES:
        return QUALITIES[text.upper()]
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 1.0:
        raise UsageError(f"quality {text!r}: there are {', '.join(QUALITIES)}, or a number from 0 to 1")
    return value
