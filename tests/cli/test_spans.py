"""Tasks of the target found again on another file's time axis."""

from __future__ import annotations

import numpy as np
import pytest

from gcodectl.cli.spans import find_spans
from gcodectl.config import load_machine
from gcodectl.records import TaskKind
from plant_models.bead import find_roads
from plant_models.firmware import execute
from plant_models.reading import read_moves

START, STOP, CORNER, STEADY, NO_FLOW = (
    TaskKind.START, TaskKind.STOP, TaskKind.CORNER, TaskKind.STEADY, TaskKind.NO_FLOW,
)  # fmt: skip
HEAD = b"G28\nG21\nG90\nM83\nG1 Z.6 F600\nG1 X0 Y0 F2400\nG4 P500\nG1 F600\n"
TARGET = HEAD + b"G1 X20 E.06\nG1 Y20 E.06\nG1 X0 E.06\nG1 X0 Y40 F2400\n"
SLOWER = HEAD + b"G1 X10 E.03 F300\nG1 X20 E.03\nG1 Y20 E.06\nG1 X0 E.06\nG1 X0 Y40 F2400\n"


@pytest.mark.parametrize(("data", "speed"), [(TARGET, 10.0), (SLOWER, 5.0)])
def test_spans_follow_the_file(data: bytes, speed: float):
    machine = load_machine("syringe")
    moves = read_moves(TARGET, machine)
    roads = find_roads(execute([moves], machine).segments, 1.0)
    execution = execute([read_moves(data, machine)], machine)
    spans = find_spans(moves, machine, roads, execution, {START: 0.7})
    kinds = [span.kind for span in spans]
    assert kinds == [NO_FLOW, START, STEADY, CORNER, STEADY, CORNER, STEADY, STOP, NO_FLOW]
    start, first, second, stop = (span for span in spans if span.kind in (START, CORNER, STOP))
    assert (start.lead, stop.lead) == (0.7, 0.0)
    assert first.anchor - start.anchor == pytest.approx(20 / speed, abs=0.1)
    assert second.anchor - first.anchor == pytest.approx(20 / speed, abs=0.1)
    assert execution.position(first.anchor * np.ones(1))[0] == pytest.approx((20, 0, 0.6), abs=0.01)
