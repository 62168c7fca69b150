"""What was executed, as it happens: rows of numbers that grow cheaply, made an Execution when asked.

Times are of whatever clock the blocks were begun by; an Execution begins at 0, with the first thing that took time.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Sequence

import numpy as np

from gcodectl.columns import Floats
from plant_models.firmware import SMOOTH_TIME, Execution
from plant_models.gantry import PAUSE, Segments
from plant_models.planner import Phases
from plant_models.printer.chords import Point
from plant_models.printer.ring import Block

_FIELDS = (
    ("line", 1), ("kind", 1), ("p0", 3), ("p1", 3), ("length", 1), ("e", 1), ("volume", 1), ("speed", 1), ("accel", 1),
    ("corner_speed", 1), ("e_corner_speed", 1), ("pause", 1), ("rest", 1), ("broken", 1), ("tool", 1), ("advance", 1),
)  # fmt: skip
_WIDTH = sum(width for _, width in _FIELDS)
_PAUSE = sum(width for _, width in _FIELDS[: [name for name, _ in _FIELDS].index("pause")])
_PHASE = 6
"""Numbers a phase: segment, t, duration, s, v, a."""


class Record:
    """Segments and phases so far; time has no gaps."""

    def __init__(self) -> None:
        self._segments, self._phases = array("d"), array("d")
        self._block: Block | None = None
        self._block_phases = 0
        self.begun = math.nan
        """When the first thing began, s; NaN before."""
        self.end = 0.0
        """When the last thing ends, s."""

    def __len__(self) -> int:
        return len(self._segments) // _WIDTH

    def block(self, block: Block, t: float, phases: Sequence[tuple[float, float, float, float]]) -> float:
        """Add a block that begins at `t`, behind a pause where there is a gap; returns when it ends."""
        self._stand_until(t, block.start, block.tool, block.line)
        number = len(self)
        self._segments.extend((
            block.line, block.kind, *block.start, *block.end, block.length, block.e, block.e * block.area, block.speed,
            block.accel, block.corner, block.e_corner, 0.0, block.rest, block.broken, block.tool, block.advance,
        ))  # fmt: skip
        self._block, self._block_phases = block, len(self._phases)
        row: list[float] = []
        for duration, s, v, a in phases:
            row += (number, t, duration, s, v, a)
            t += duration
        self._phases.extend(row)
        self.end = t
        return t

    def dwell(self, t: float, seconds: float, at: Point, tool: int, line: int, marks: tuple[bool, bool]) -> float:
        """Add a pause that is asked for, `marks`: rest and broken; returns when it ends."""
        self._stand_until(t, at, tool, line)
        self._pause(t, seconds, at, tool, line, marks)
        return self.end

    def cut(self, now: float) -> float:
        """End what runs at `now`; returns the share of the last block, or pause, that was executed."""
        if not len(self) or now >= self.end:
            return 1.0
        block, self._block = self._block, None
        kept = 0.0
        for place in range(len(self._phases) - _PHASE, self._block_phases - 1, -_PHASE):
            _, t, duration, s, v, a = self._phases[place : place + _PHASE]
            since = min(now - t, duration)
            if since <= 0:
                del self._phases[place:]
                continue
            self._phases[place + 2] = since
            kept = max(kept, s + (v + 0.5 * a * since) * since)
        self.end = now
        if block is None:
            self._segments[_PAUSE - _WIDTH] = now - self._phases[-5] if len(self._phases) > self._block_phases else 0.0
            return 0.0
        return self._shorten(block, kept)

    def _shorten(self, block: Block, kept: float) -> float:
        """Make the last segment what was executed of it: `kept` mm."""
        share = min(kept / block.length, 1.0)
        del self._segments[-_WIDTH:]
        x, y, z = (a + share * (b - a) for a, b in zip(block.start, block.end, strict=True))
        self._segments.extend((
            block.line, block.kind if kept > 0 else PAUSE, *block.start, x, y, z, kept, share * block.e,
            share * block.e * block.area, block.speed, block.accel, block.corner, block.e_corner, 0.0, block.rest,
            block.broken, block.tool, block.advance,
        ))  # fmt: skip
        return share

    def _stand_until(self, t: float, at: Point, tool: int, line: int) -> None:
        if math.isnan(self.begun):
            self.begun = self.end = t
        if t > self.end:
            self._pause(self.end, t - self.end, at, tool, line, (False, False))

    def _pause(self, t: float, seconds: float, at: Point, tool: int, line: int, marks: tuple[bool, bool]) -> None:
        number = len(self)
        rest, broken = marks
        self._segments.extend((line, PAUSE, *at, *at, *[0.0] * 7, seconds, rest, broken, tool, 0.0))
        self._block, self._block_phases = None, len(self._phases)
        self._phases.extend((number, t, seconds, 0.0, 0.0, 0.0))
        self.end = t + seconds

    def execution(self) -> Execution:
        """Return all that was executed; what runs is in it whole."""
        count, begun = len(self), self.begun if len(self) else 0.0
        table = dict(zip((name for name, _ in _FIELDS), self._columns(), strict=True))
        line, advance = table["line"].astype(np.int64), table["advance"]
        segments = Segments(
            row=line - 1, line=line, kind=table["kind"].astype(np.int8), p0=table["p0"], p1=table["p1"],
            length=table["length"], e=table["e"], volume=table["volume"], speed=table["speed"], accel=table["accel"],
            corner_speed=table["corner_speed"], e_corner_speed=table["e_corner_speed"], pause=table["pause"],
            rest=table["rest"].astype(np.bool_), broken=table["broken"].astype(np.bool_),
            tool=table["tool"].astype(np.int16), layer=np.zeros(count, dtype=np.int32),
        )  # fmt: skip
        segment, t, duration, s, v, a = np.array(self._phases).reshape(-1, _PHASE).T.copy()
        phases = Phases(segment=segment.astype(np.int64), t=t - begun, duration=duration, s=s, v=v, a=a)
        most = float(advance.max(initial=0.0))
        return Execution(
            segments, phases, most, 0.0 if most else SMOOTH_TIME, advanced=advance / most if most else None
        )

    def _columns(self) -> Iterator[Floats]:
        rows, first = np.array(self._segments).reshape(-1, _WIDTH), 0
        for _, width in _FIELDS:
            yield rows[:, first].copy() if width == 1 else rows[:, first : first + width].copy()
            first += width
