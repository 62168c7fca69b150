"""Feeds a live planner as fast as it takes lines, or as slowly as is asked, on a clock of its own."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from gcodectl.config import load_machine
from plant_models.firmware import Execution, execute
from plant_models.gantry import Firmware
from plant_models.printer.live import Live
from plant_models.reading import read_moves

MACHINE = load_machine("syringe")
DATA = Path(__file__).parent.parent / "data"
MANY = 1_000_000


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
