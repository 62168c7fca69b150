"""Moves made by hand and by hypothesis, for the tests of motion and flow: a pen that is led about, a row a call."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Self

import numpy as np
from hypothesis import strategies as st

from gcodectl.columns import Columns, column_fields
from gcodectl.config import Machine, load_machine
from gcodectl.records import Flag, Kind, Moves

SYRINGE = load_machine("syringe")
BEAD = 0.5
"""mm^2 of a road laid by `Pen.road`."""
PLANES = ((0, 1), (2, 0), (1, 2))


class Pen:
    """Leads a nozzle about; every call is one row, whose raw line names it."""

    def __init__(self, machine: Machine = SYRINGE, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        self.machine, self.at, self.tool_number = machine, np.array(at), 0
        self.rows: list[dict[str, Any]] = []

    def _row(self, kind: Kind, **columns: Any) -> Self:
        nan = math.nan
        row: dict[str, Any] = {
            "kind": kind, "flags": int(Flag.KNOWN | Flag.RELATIVE_E), "p0": self.at, "p1": self.at, "length": 0.0,
            "center": (0.0, 0.0), "sweep": 0.0, "plane": 0, "e": 0.0, "area": self.machine.area, "e_end": 0.0,
            "feed": 10.0, "speed_factor": 1.0, "flow_factor": 1.0, "dwell": 0.0, "accel": nan, "travel_accel": nan,
            "corner_speed": nan, "tool": self.tool_number, "layer": 0, "feature": 0, "width": nan, "height": nan,
            "decimals": (3, 5),
        }  # fmt: skip
        self.rows.append(row | columns)
        self.at = np.asarray(self.rows[-1]["p1"], dtype=float)
        return self

    def go(self, x: float, y: float, z: float | None = None, e: float = 0.0, feed: float = 10.0, **more: Any) -> Self:
        """A straight move to x, y, z that moves E by `e` mm."""
        target = np.array([x, y, self.at[2] if z is None else z])
        return self._row(Kind.LINE, p1=target, length=float(np.linalg.norm(target - self.at)), e=e, feed=feed, **more)

    def road(self, x: float, y: float, feed: float = 10.0, bead: float = BEAD, **more: Any) -> Self:
        """A straight move that lays `bead` mm^2."""
        length = math.hypot(x - self.at[0], y - self.at[1])
        return self.go(x, y, e=bead * length / self.machine.area, feed=feed, **more)

    def arc(
        self, centre: tuple[float, float], sweep: float, rise: float = 0.0, plane: int = 0, feed: float = 10.0,
        bead: float = 0.0, growth: float = 0.0, **more: Any,
    ) -> Self:  # fmt: skip
        """A turn by `sweep` rad about `centre` (in the plane's axes), its radius growing by `growth` on the way."""
        first, second = PLANES[plane]
        x, y = self.at[first] - centre[0], self.at[second] - centre[1]
        radius = math.hypot(x, y)
        angle, end = math.atan2(y, x) + sweep, radius + growth
        target = self.at.copy()
        target[first], target[second] = centre[0] + end * math.cos(angle), centre[1] + end * math.sin(angle)
        target[3 - first - second] += rise
        length = math.hypot(0.5 * (radius + end) * sweep, rise)
        e = bead * length / self.machine.area
        return self._row(
            Kind.ARC, p1=target, length=length, center=centre, sweep=sweep, plane=plane, e=e, feed=feed, **more
        )

    def push(self, e: float, feed: float = 5.0, **more: Any) -> Self:
        """A move of E alone."""
        return self._row(Kind.LINE, e=e, feed=feed, **more)

    def dwell(self, seconds: float) -> Self:
        return self._row(Kind.DWELL, dwell=seconds)

    def tool(self, number: int) -> Self:
        self.tool_number = number
        return self._row(Kind.TOOL)

    def barrier(self) -> Self:
        return self._row(Kind.BARRIER)

    def lost(self, x: float, y: float) -> Self:
        """A move whose start is unknown."""
        there = np.array([x, y, self.at[2]])
        flags = int(Flag.RELATIVE_E)
        return self._row(Kind.LINE, p0=np.full(3, np.nan), p1=there, length=math.nan, flags=flags)

    def plain(self, kind: Kind = Kind.NOTHING) -> Self:
        """A row without motion: a comment, or G10 and G11 by `kind`."""
        return self._row(kind)

    def moves(self) -> Moves:
        n = len(self.rows)
        columns = Moves.allocate(n)
        for k, row in enumerate(self.rows):
            for name, value in row.items():
                columns[name][k] = value
        text = b"".join(b"row %d\n" % k for k in range(n))
        ends = np.cumsum([len(b"row %d\n" % k) for k in range(n)], dtype=np.int64)
        columns["text"] = np.frombuffer(text, dtype=np.uint8)
        columns["start"], columns["end"] = np.concatenate([[0], ends[:-1]])[:n].astype(np.int64), ends
        columns["row"], columns["line"] = np.arange(n), np.arange(n) + 1
        return Moves(**columns)


def three_lines() -> Pen:
    """The paper's part: three straight lines with two corners, a travel before and after."""
    return Pen().go(10, 0, feed=40).road(30, 0).road(30, 20).road(50, 20).go(60, 20, feed=40)


@st.composite
def pens(draw: st.DrawFn, most: int = 25, roads_only: bool = False) -> Pen:
    """Random parts: roads, travels, arcs, E-only moves, dwells, barriers, tool changes, rows of nothing."""
    pen = Pen()
    reach = st.sampled_from([0.003, 0.05, 0.4, 2.0, 2.0, 9.0, 30.0])
    feeds = st.sampled_from([3.0, 10.0, 10.0, 10.0, 30.0, 500.0])
    calm = st.sampled_from(["road"] * 6 + ["travel", "arc", "nothing"])
    kinds = st.sampled_from(["road"] * 6 + ["travel", "travel", "arc", "arc", "push", "pull", "dwell", "nothing"]
                            + ["barrier", "tool", "lost", "retract", "slope", "turned"])  # fmt: skip
    for what in draw(st.lists(calm if roads_only else kinds, min_size=1, max_size=most)):
        length, turn, feed = draw(reach), draw(st.integers(-310, 310)) / 100, draw(feeds)
        x, y = pen.at[0] + length * math.cos(turn), pen.at[1] + length * math.sin(turn)
        if what == "road":
            pen.road(x, y, feed, draw(st.sampled_from([BEAD, BEAD, 0.2, 2.0])))
        elif what == "travel":
            pen.go(x, y, feed=feed)
        elif what == "slope":
            pen.go(x, y, pen.at[2] + 0.5, feed=feed)
        elif what in ("arc", "turned"):
            plane = 0 if what == "arc" else draw(st.integers(1, 2))
            centre = (pen.at[PLANES[plane][0]] + length, pen.at[PLANES[plane][1]])
            pen.arc(centre, turn if turn else 1.0, plane=plane, feed=feed, bead=draw(st.sampled_from([0.0, BEAD])))
        elif what in ("push", "pull"):
            pen.push(0.4 if what == "push" else -0.4)
        elif what == "dwell":
            pen.dwell(draw(st.sampled_from([0.0, 0.003, 0.4])))
        elif what == "tool":
            pen.tool(draw(st.integers(0, 2)))
        elif what == "lost":
            pen.lost(x, y)
        elif what == "barrier":
            pen.barrier()
        else:
            pen.plain(Kind.RETRACT if what == "retract" else Kind.NOTHING)
    return pen


def chunked(moves: Moves, size: int) -> Iterator[Moves]:
    """`moves` in chunks of `size` rows, with an empty one first."""
    yield moves[:0]
    for first in range(0, len(moves), size):
        yield moves[first : first + size]


def same(a: Columns, b: Columns) -> None:
    """Assert that two records hold bitwise the same rows (of text: the same lines)."""
    assert len(a) == len(b)
    for field in column_fields(type(a)):
        if field.name not in ("start", "end"):
            assert np.array_equal(getattr(a, field.name), getattr(b, field.name), equal_nan=True), field.name
    if isinstance(a, Moves) and isinstance(b, Moves):
        assert [a.raw(k) for k in range(len(a))] == [b.raw(k) for k in range(len(b))]


@contextmanager
def plain_python(*packages: str) -> Iterator[None]:
    """Run every kernel of the modules whose names begin with one of `packages` as plain Python inside the block."""
    modules = [module for name, module in sys.modules.items() if name.startswith(packages)]
    kernels = [(m, name, value) for m in modules for name, value in vars(m).items() if hasattr(value, "py_func")]
    assert kernels
    for module, name, value in kernels:
        setattr(module, name, value.py_func)
    try:
        yield
    finally:
        for module, name, value in kernels:
            setattr(module, name, value)
