"""Feeds a live planner as fast as it takes lines, or as slowly as is asked, on a clock of its own."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from gcodectl.config import load_machine
from plant_models.firmware import Execution, execute
from plant_models.gantry import Firmware
from plant_models.printer.live import Live
from plant_models.reading import read_moves

MACHINE = load_machine("syringe")
DATA = Path(__file__).parent.parent / "data"
MANY = 1_000_000
SETTLED = [b"G21", b"G90", b"M83", b"G92 E0"]

MOVES = st.one_of(
    st.tuples(st.integers(-60, 60), st.integers(-60, 60), st.integers(0, 9), st.sampled_from([5, 20, 150])).map(
        lambda it: b"G1 X%.1f Y%.1f E%.4f F%d" % (it[0] / 10, it[1] / 10, it[2] / 1000, 60 * it[3])
    ),
    st.sampled_from([b"G1 E-0.05 F300", b"G1 E0.05", b"G1 Z0.4", b"G1 Z0", b"G10", b"G11", b"G2 I3 J1 F1200 E0.02"]),
    st.sampled_from([b"G4 P40", b"M400", b"T1", b"T0", b"M204 S200", b"M205 X2", b"M220 S70", b"M221 S80", b"G92 X0"]),
)
JOBS = st.lists(MOVES, max_size=40).map(lambda moves: [*SETTLED, *moves])
"""Lines of all kinds, some of which wait."""


def make_live(blocks: int = 16, firmware: Firmware | None = None, machine: str = "syringe") -> Live:
    """A planner; with more than 16 blocks one that sees all it is given before it begins."""
    first = 3 if blocks <= 16 else blocks
    return Live(load_machine(machine), firmware or Firmware(), blocks=blocks, first=first)


def feed(live: Live, lines: list[bytes], now: float = 0.0) -> float:
    """Give all lines, each as soon as it is taken; returns when the last was."""
    for line in lines:
        while not live.ready():
            now = max(now, live.deadline())
            assert now < math.inf, "it waits for nothing"
            live.advance(now)
        live.take(line, now)
    return now


def drain(live: Live) -> Live:
    """Let all that was taken be done."""
    while live.deadline() < math.inf:
        live.advance(live.deadline())
    assert live.idle
    return live


def run(lines: list[bytes], **options: object) -> Live:
    live = make_live(**options)  # type: ignore[arg-type]
    feed(live, lines)
    return drain(live)


def whole(data: bytes, firmware: Firmware | None = None, machine: str = "syringe") -> Execution:
    """What the planner that sees the whole file makes of it."""
    profile = load_machine(machine)
    return execute([read_moves(data, profile, pass_unknown=True)], profile, firmware=firmware)


def assert_same(live: Execution, other: Execution) -> None:
    """The same segments at the same times, limits included."""
    assert len(live.segments) == len(other.segments)
    moving = other.segments.kind != 2
    for name in ("kind", "p0", "p1", "length", "e", "volume", "tool"):
        a, b = getattr(live.segments, name), getattr(other.segments, name)
        np.testing.assert_allclose(a, b, atol=1e-9, err_msg=name)
    for name in ("speed", "accel", "corner_speed", "e_corner_speed"):
        a, b = getattr(live.segments, name), getattr(other.segments, name)
        np.testing.assert_allclose(a[moving], b[moving], rtol=1e-9, err_msg=name)
    np.testing.assert_allclose(live.begins(), other.begins(), atol=1e-6)
    assert live.duration == pytest.approx(other.duration, abs=1e-6)


def corpus(name: str) -> bytes:
    """A file of real G-code; skips where there is no corpus."""
    folder = os.environ.get("GCODECTL_CORPUS")
    if not folder:
        pytest.skip("no GCODECTL_CORPUS")
    return (Path(folder) / name).read_bytes()
