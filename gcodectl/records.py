"""What flows between the stages: Moves, SpeedPlan, Profile, Tasks, Signal, Command; and Blocks, for who asks.

    bytes -> Lines -> Moves -> SpeedPlan -> Profile -> Tasks -> Command -> lines out
             parse   interpret  plan       profile   segment  compose   emit

Rows are numbered once, from the start of the file: `Moves.row` counts moves, and Profile and Tasks name moves by it, so
a stage may cut its chunks wherever it likes. Units: mm, s, mm^3, mm^3/s; NaN means absent or unknown.
"""

from __future__ import annotations

import dataclasses
from enum import IntEnum, IntFlag
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Bools, Columns, Floats, Ints, TextColumns, column
from gcodectl.jit import jit_lean


@dataclasses.dataclass(frozen=True)
class Blocks(TextColumns):
    """One row a line of G-code: its words as the line has them, in the file's own units."""

    line: Ints = column(np.int64)
    """1-based line number in the file."""
    code: Ints = column(np.int64)
    """What the line commands: see `gcode.parse.Code`."""
    modes: Ints = column(np.int64)
    """Modal words found beside or as the command, as bits: see `gcode.parse.Mode`."""
    words: Floats = column(np.float64, width=26)
    """Value of each letter A..Z, NaN where absent; the last one counts where a letter comes twice."""
    decimals: NDArray[np.int8] = column(np.int8, width=2)
    """Digits after the point: the most of X, Y, Z, and E's; -1 where the line has none of them."""


class Kind(IntEnum):
    """What a move does to the machine."""

    NOTHING = 0
    """No motion, no time, no state that matters to flow: comments, fans, M73, temperatures not waited for."""
    LINE = 1
    """A straight move of any of X, Y, Z, E (one that only moves E has no path length)."""
    ARC = 2
    """An arc or helix, centre in `center`, `sweep` radians about it."""
    DWELL = 3
    """Standing still for `dwell` seconds (G4)."""
    RETRACT = 4
    """Firmware retraction, G10 or M103."""
    UNRETRACT = 5
    """Firmware unretraction, G11 or M101."""
    TOOL = 6
    """A tool change: the machine comes to rest, the material in the nozzle changes."""
    BARRIER = 7
    """Anything after which position, units or modes must be learned anew, or that waits: the machine comes to rest."""


_LINE, _ARC, _DWELL, _TOOL, _BARRIER = map(int, (Kind.LINE, Kind.ARC, Kind.DWELL, Kind.TOOL, Kind.BARRIER))


class Flag(IntFlag):
    """How a move's line must be written, and whether it may be."""

    KNOWN = 1
    """Start position, units, E mode and feedrate are known, and only X, Y, Z, E move: the line may be rewritten."""
    RELATIVE_XYZ = 2
    RELATIVE_E = 4
    INCHES = 8
    SETS_E = 16
    """G92 with an E word: sets the logical E."""
    G0 = 32
    """The line commands G0."""
    PART = 64
    """Written anew, whatever the signal: one of the parts that a line was cut into (the first has its bytes), a wipe
    that is not to pull any more, a line that heat slows, a wait without a line of its own."""
    GOES_ON = 128
    """A part that another one of the same line follows, without a corner."""


_KNOWN = int(Flag.KNOWN)


@jit_lean
def deposits_kernel(e: float, length: float, flags: int) -> bool:
    """Whether a row lays a road; see `Moves.deposits`."""
    return e > 0.0 and length > 0.0 and flags & _KNOWN != 0


@jit_lean
def starts_passage_kernel(kind: int, length: float, flags: int) -> bool:
    """Whether nothing sent before a row may count behind it; see `Moves.starts_passage`."""
    if kind in (_LINE, _ARC):
        return length != 0.0 and flags & _KNOWN == 0
    return kind in (_TOOL, _BARRIER)


@jit_lean
def deposit_rows_kernel(e: Floats, length: Floats, flags: NDArray[np.int16], out: Bools) -> None:
    """Fill `out` with whether each row lays a road."""
    for i in range(len(e)):
        out[i] = deposits_kernel(e[i], length[i], flags[i])


@jit_lean
def passage_rows_kernel(kind: NDArray[np.int8], length: Floats, flags: NDArray[np.int16], out: Bools) -> None:
    """Fill `out` with whether each row starts a passage."""
    for i in range(len(kind)):
        out[i] = starts_passage_kernel(kind[i], length[i], flags[i])


@dataclasses.dataclass(frozen=True)
class Moves(TextColumns):
    """One row or more a block, in file order: what the machine does, in mm and s.

    A block that moves nothing is one row of Kind.NOTHING. Rows of one block follow each other; all but the first have
    an empty raw line (start == end).
    """

    row: Ints = column(np.int64)
    """0-based number of the move since the start of the file."""
    line: Ints = column(np.int64)
    kind: NDArray[np.int8] = column(np.int8)
    flags: NDArray[np.int16] = column(np.int16)
    p0: Floats = column(np.float64, width=3)
    """Where the move starts, mm; NaN while unknown."""
    p1: Floats = column(np.float64, width=3)
    """Where the move ends, mm."""
    length: Floats = column(np.float64)
    """Path length, mm; arcs and helices along their curve; 0 for a move of E alone."""
    center: Floats = column(np.float64, width=2)
    """Arc centre in the first and second axis of its plane, mm."""
    sweep: Floats = column(np.float64)
    """Signed angle about the centre, rad (counter-clockwise positive); 0 for lines."""
    plane: NDArray[np.int8] = column(np.int8)
    """0 = XY (G17), 1 = ZX (G18), 2 = YZ (G19)."""
    e: Floats = column(np.float64)
    """How far the E axis moves, mm (or mm^3 where `area` is 1: volumetric E)."""
    area: Floats = column(np.float64)
    """Plunger or filament cross-section, mm^2: e * area is the volume, mm^3."""
    e_end: Floats = column(np.float64)
    """The file's logical E after the row, in the file's own units and mode base; NaN while unknown."""
    feed: Floats = column(np.float64)
    """Commanded speed, mm/s, M220 applied; along the path, or of E where E moves alone; NaN while unknown."""
    speed_factor: Floats = column(np.float64)
    """M220 in force (1 = 100 %): already applied to `feed`."""
    flow_factor: Floats = column(np.float64)
    """M221 in force (1 = 100 %): already applied to `e`."""
    dwell: Floats = column(np.float64)
    """Seconds to stand still."""
    accel: Floats = column(np.float64)
    """Acceleration the file asks for, mm/s^2; NaN: the machine's own."""
    travel_accel: Floats = column(np.float64)
    """The same for moves without extrusion."""
    corner_speed: Floats = column(np.float64)
    """Square corner velocity the file asks for, mm/s; NaN: the machine's own."""
    tool: NDArray[np.int16] = column(np.int16)
    layer: NDArray[np.int32] = column(np.int32)
    """0-based layer, by the slicer's marks, else by the height of deposition; -1 before the first."""
    feature: NDArray[np.int16] = column(np.int16)
    """Index into `gcode.dialects.FEATURES`; 0 where unmarked."""
    width: Floats = column(np.float64)
    """`;WIDTH:` in force, mm; NaN where unmarked."""
    height: Floats = column(np.float64)
    """`;HEIGHT:` in force, mm; NaN where unmarked."""
    decimals: NDArray[np.int8] = column(np.int8, width=2)
    """The file's own precision up to here: most digits after the point seen for X, Y, Z, and for E."""
    heat: Floats = column(np.float64)
    """The most that the heat of what lies beneath allows, mm/s along the path; 0: any."""

    @property
    def deposits(self) -> Bools:
        """Rows that lay a road whose line may be rewritten: path and E > 0."""
        out = np.empty(len(self), dtype=np.bool_)
        deposit_rows_kernel(self.e, self.length, self.flags, out)
        return out

    @property
    def starts_passage(self) -> Bools:
        """Rows behind which nothing sent earlier may count: tool changes, barriers, paths that may not be rewritten."""
        out = np.empty(len(self), dtype=np.bool_)
        passage_rows_kernel(self.kind, self.length, self.flags, out)
        return out

    @property
    def holds(self) -> Bools:
        """Dwells without a line, of no time of their own: where a Start may be waited for (`flow.holds`)."""
        return np.asarray((self.kind == _DWELL) & (self.start == self.end) & (self.dwell == 0))


@dataclasses.dataclass(frozen=True)
class SpeedPlan(Columns):
    """One row a move: how fast it may begin, run and end, and which limit won. Zeros where nothing moves.

    Moves that follow each other at one speed are a run, planned and profiled as one: entry and exit are the run's.
    """

    row: Ints = column(np.int64)
    run: Ints = column(np.int64)
    """0-based number of the run since the start of the file; -1 before the first."""
    distance: Floats = column(np.float64)
    """What the speeds are measured along, mm: the path, or E where E moves alone."""
    entry: Floats = column(np.float64)
    """Speed at the run's start, mm/s along the path (of E where E moves alone)."""
    cruise: Floats = column(np.float64)
    """The most the move may reach, mm/s."""
    exit: Floats = column(np.float64)
    """Speed at the run's end."""
    accel: Floats = column(np.float64)
    """mm/s^2."""
    own_accel: Floats = column(np.float64)
    """What it would be if the extruder followed everything, mm/s^2: what firmware takes corners by."""
    jerk: Floats = column(np.float64)
    """mm/s^3."""
    rests: Bools = column(np.bool_)
    """The machine stands still here, between the moves before and after."""
    limited_by: NDArray[np.int8] = column(np.int8)
    """Which limit set `cruise`: see `motion.limits.Limit`."""
    ruled_by: NDArray[np.int8] = column(np.int8)
    """Which edge of a road set `accel` to what the extruder can follow there: Limit.START, STOP; 0 for none."""


@dataclasses.dataclass(frozen=True)
class Profile(Columns):
    """One row a phase of constant jerk (or of standing still), in time order; each belongs to one move."""

    row: Ints = column(np.int64)
    """The move's row."""
    t: Floats = column(np.float64)
    """When the phase begins, s since the start of the file's known motion."""
    duration: Floats = column(np.float64)
    s: Floats = column(np.float64)
    """Where along the move it begins, mm."""
    v: Floats = column(np.float64)
    a: Floats = column(np.float64)
    j: Floats = column(np.float64)


class TaskKind(IntEnum):
    """Hoelzle's basis tasks; a smaller number has priority (Stop over Start over Corner ...)."""

    STOP = 0
    START = 1
    CORNER = 2
    STEADY = 3
    NO_FLOW = 4

    @property
    def label(self) -> str:
        """The paper's spelling."""
        return ("Stop", "Start", "Corner", "Steady-State", "No-Flow")[self]


@dataclasses.dataclass(frozen=True)
class Tasks(Columns):
    """One row a basis task, in time order: what flow must do there."""

    kind: NDArray[np.int8] = column(np.int8)
    first: Ints = column(np.int64)
    """First move (row) of the task."""
    last: Ints = column(np.int64)
    """Last move (row) of the task, included."""
    first_line: Ints = column(np.int64)
    last_line: Ints = column(np.int64)
    road: Ints = column(np.int64)
    """0-based number of the road; for No-Flow, of the road that comes next."""
    layer: NDArray[np.int32] = column(np.int32)
    tool: NDArray[np.int16] = column(np.int16)
    t0: Floats = column(np.float64)
    t1: Floats = column(np.float64)
    """From when to when, s. Start begins and Stop ends at the road's end; a Corner spans its dip of speed."""
    x: Floats = column(np.float64)
    y: Floats = column(np.float64)
    """Where the task is, mm."""
    flow: Floats = column(np.float64)
    """Nominal flow rate, mm^3/s, bead times speed: after a Start, in a Steady-State, before a Corner or a Stop."""
    gap: Floats = column(np.float64)
    """Start and Stop: seconds of No-Flow before the one, after the other, GAP (`flow.tasks`) at most; 0 elsewhere."""
    flow_after: Floats = column(np.float64)
    """What it goes on with: another flow where a Corner or a Steady-State ends in a lasting change of it."""
    dip: Floats = column(np.float64)
    """Corners: seconds of nominal flow that the dip of speed leaves out; 0 elsewhere."""


@dataclasses.dataclass(frozen=True)
class Signal:
    """Samples of a signal over time: `values[channel, n]` holds from t0 + n dt until t0 + (n + 1) dt.

    Channel c is the plunger of tool `channels[c]`; u in mm^3/s.
    """

    t0: float
    dt: float
    values: Floats
    channels: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        assert self.values.ndim == 2, "a signal is channels x samples"
        assert len(self.values) == len(self.channels), "a row a channel"

    @property
    def t1(self) -> float:
        """When the last sample ends, s."""
        return self.t0 + self.dt * int(self.values.shape[1])


@dataclasses.dataclass(frozen=True)
class Command:
    """Samples of the plunger's rate over time: sample n holds from t0 + n dt until t0 + (n + 1) dt, mm^3/s."""

    t0: float
    dt: float
    u: Floats
    """What the plunger is told."""
    reference: Floats
    """What it would be told if nothing were learned but the gain: q_ref / K."""

    def __post_init__(self) -> None:
        assert self.u.shape == self.reference.shape, "as many samples of u as of the reference"

    @classmethod
    def none(cls, dt: float) -> Command:
        """No samples."""
        return cls(t0=0.0, dt=dt, u=np.zeros(0), reference=np.zeros(0))

    @property
    def t1(self) -> float:
        """When the last sample ends, s."""
        return self.t0 + self.dt * len(self.u)


class Composed(NamedTuple):
    """Moves with everything that is known about them; the command spans at least their phases."""

    moves: Moves
    speeds: SpeedPlan
    profile: Profile
    tasks: Tasks
    command: Command
