"""Survey: what a file does in all, counted as its timed moves come by: time by layer and by the slicer's types.

    time of a move -> the layer it is on (those before the first: BEFORE)
                   -> its `;TYPE:` where it lays a road; "travel" where it moves without; "standing" where nothing moves

Every phase of the profile counts once in each of the two tables, so each adds up to the time of the whole build.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats, Ints
from gcodectl.gcode.dialects import FEATURES
from gcodectl.jit import jit_lean
from gcodectl.motion.limits import Limit
from gcodectl.records import Kind, Moves, Profile, SpeedPlan

BEFORE = "before the first layer"
STANDING = len(FEATURES)
LABELS = ("unmarked", *FEATURES[1:], "standing")
"""Of `Survey.types`."""
MOST_TOOLS = 100
_TRAVEL = FEATURES.index("travel")
_BARRIER = int(Kind.BARRIER)
MOVING, BARRIERS, ROADS, LAYING, VOLUME, EXTRUDED, PATH, COUNTS = range(8)
"""Counts and sums: of moves, barriers and roads; whether the last move laid one; mm^3, mm of E, mm of road."""


@jit_lean
def survey_kernel(
    kind: NDArray[np.int8], tool: NDArray[np.int16], layer: NDArray[np.int32], feature: NDArray[np.int16],
    limited_by: NDArray[np.int8], ruled_by: NDArray[np.int8], row: Ints,
    e: Floats, length: Floats, area: Floats, distance: Floats, p0: Floats, p1: Floats, phase_row: Ints,
    duration: Floats, counts: Floats, box: Floats, limited: Ints, tools: Ints, layers: Floats, types: Floats,
) -> None:  # fmt: skip
    """Count a chunk in; `layers` begins with what is before the first."""
    phase = 0
    for i in range(len(kind)):
        lays = e[i] > 0 and length[i] > 0
        seconds = 0.0
        while phase < len(phase_row) and phase_row[phase] <= row[i]:
            seconds += duration[phase]
            phase += 1
        layers[layer[i] + 1] += seconds
        types[feature[i] if lays else (_TRAVEL if distance[i] > 0 else STANDING)] += seconds
        counts[MOVING] += distance[i] > 0
        counts[BARRIERS] += kind[i] == _BARRIER
        counts[EXTRUDED] += 0.0 if np.isnan(e[i]) else e[i]
        limited[limited_by[i]] += 1
        limited[ruled_by[i]] += 1
        if lays:
            counts[ROADS] += counts[LAYING] == 0
            counts[VOLUME] += e[i] * area[i]
            counts[PATH] += length[i]
            tools[tool[i] % MOST_TOOLS] = 1
            for axis in range(3):
                for place in (p0[i, axis], p1[i, axis]):
                    if place < box[0, axis]:
                        box[0, axis] = place
                    if place > box[1, axis]:
                        box[1, axis] = place
        counts[LAYING] = lays


class Survey:
    """What the timed moves so far did."""

    def __init__(self) -> None:
        self.lines = 0
        self.time_s = 0.0
        self.counts = np.zeros(COUNTS)
        self.box = np.array([[np.inf] * 3, [-np.inf] * 3])
        """Lowest and highest place of a road, mm."""
        self.limited = np.zeros(len(Limit), dtype=np.int64)
        """Moves by the limit that set their speed, and those by the one that set their acceleration."""
        self.tools = np.zeros(MOST_TOOLS, dtype=np.int64)
        self.layers = np.zeros(1)
        """Seconds before the first layer, then of each."""
        self.types = np.zeros(len(LABELS))
        """Seconds by LABELS."""

    def add(self, moves: Moves, speeds: SpeedPlan, phases: Profile) -> None:
        """Count a chunk in."""
        if not len(moves):
            return
        self.lines = int(moves.line[-1])
        if len(phases):
            self.time_s = float(phases.t[-1] + phases.duration[-1])
        more = int(moves.layer.max()) + 2 - len(self.layers)
        if more > 0:
            self.layers = np.concatenate([self.layers, np.zeros(more)])
        survey_kernel(
            moves.kind, moves.tool, moves.layer, moves.feature, speeds.limited_by, speeds.ruled_by, moves.row,
            moves.e, moves.length, moves.area, speeds.distance, moves.p0, moves.p1, phases.row,
            phases.duration, self.counts, self.box, self.limited, self.tools, self.layers, self.types,
        )  # fmt: skip

    def by_layer(self) -> dict[str, float]:
        """Seconds of each layer, from 0, and before the first; they add up to `time_s`."""
        names = (BEFORE, *map(str, range(len(self.layers) - 1)))
        return dict(zip(names, self.layers.tolist(), strict=True))

    def by_type(self) -> dict[str, float]:
        """Seconds of each type that took any, the longest first; they add up to `time_s`."""
        some = {label: float(seconds) for label, seconds in zip(LABELS, self.types, strict=True) if seconds > 0}
        return dict(sorted(some.items(), key=lambda one: -one[1]))
