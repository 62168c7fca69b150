"""Laying: a signal over time, laid over a part of a file that the machine plans as any other."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gcodectl.columns import Floats
from gcodectl.gcode.emit import emit
from gcodectl.pipeline import Options, read_moves, time_moves
from gcodectl.records import Command, Composed, Moves, Profile, SpeedPlan, Tasks


class Laid(NamedTuple):
    """A file with a signal laid over a part of it."""

    data: bytes
    lasts: float
    """Seconds that the part takes."""
    flow_factor: float
    """M221 in force there, 1: as it is."""


def lay(data: bytes, options: Options, u: Floats, dt: float, lines: tuple[int, int]) -> Laid:
    """Add `u` (n samples of dt s, mm^3/s) to a whole file's own E, from where the first of `lines` begins to move.

    `lines` are the first and the last line of the part that is timed, counted from 1.
    """
    timed = list(time_moves(read_moves([data], options), options.machine))
    moves = Moves.concat([one[0] for one in timed])
    speeds = SpeedPlan.concat([one[1] for one in timed])
    phases = Profile.concat([one[2] for one in timed])
    line = moves.line[phases.row - moves.row[0]]
    part = phases[(line >= lines[0]) & (line <= lines[1])]
    begin = float(part.t[0])
    ends = float(phases.t[-1] + phases.duration[-1])
    edges = np.arange(math.ceil(ends / dt) + 2) * dt
    pushed = np.concatenate([[0.0], np.cumsum(u) * dt])
    added = np.diff(np.interp(edges - begin, np.arange(len(pushed)) * dt, pushed)) / dt
    command = Command(t0=0.0, dt=dt, u=added, reference=np.zeros(len(added)))
    composed = Composed(moves, speeds, phases, Tasks.empty(), command)
    out = b"".join(emit([composed], options.machine, np.ones(1)))
    factor = float(moves.flow_factor[int(part.row[0] - moves.row[0])])
    return Laid(out, float(part.t[-1] + part.duration[-1]) - begin, factor)
