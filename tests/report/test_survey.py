"""What `check` says of a file in all: times that add up, and that the virtual firmware takes too."""

from __future__ import annotations

import dataclasses
import math
import os
from pathlib import Path

import numpy as np
import pytest
from filtering import DATA

from gcodectl.cli.check import NO_JERK
from gcodectl.config import Machine, load_machine
from gcodectl.pipeline import Options, read_moves, time_moves
from gcodectl.records import Moves
from gcodectl.report.survey import BEFORE, MOVING, PATH, ROADS, Survey, guess_kernel, ramped_kernel
from plant_models.firmware import execute

FILAMENT = load_machine("filament")
PART = b"""G21
G90
M83
G28
G1 X20 Y20 Z0.3 F6000
;LAYER_CHANGE
;TYPE:External perimeter
G1 X60 E2 F1200
G1 X60 Y60 E2
;LAYER_CHANGE
;TYPE:Internal infill
G1 X20 F6000
G1 Y20 E2 F1200
G4 P1500
"""
CORPUS = os.environ.get("GCODECTL_CORPUS", "")
SLICED = ("ps_mk3_cube20_relE", "cura_ender3_absE", "m486_objects_arcs.head3000", "paste_cube_prusaslicer",
          "3d-printer_creality_print.head4000", "ps_fwretract_G10G11", "ps_flavor_makerware")  # fmt: skip


def surveyed(data: bytes, machine: Machine, size: int = 1 << 20) -> tuple[Survey, list[Moves]]:
    machine = dataclasses.replace(machine, jerk=NO_JERK)
    lines = data.splitlines(keepends=True)
    chunks = [b"".join(lines[k : k + size]) for k in range(0, len(lines), size)]
    survey, parts = Survey(machine), []
    for moves, speeds, phases in time_moves(read_moves(chunks, Options(machine, pass_unknown=True)), machine):
        survey.add(moves, speeds, phases)
        parts.append(moves)
    return survey, parts


def test_time_is_told_by_layer_and_by_type() -> None:
    survey, _ = surveyed(PART, FILAMENT)
    layers, types = survey.by_layer(), survey.by_type()
    assert list(layers) == [BEFORE, "0", "1"]
    assert set(types) == {"external perimeter", "infill", "travel", "standing"}
    assert list(types.values()) == sorted(types.values(), reverse=True)
    assert types["standing"] == pytest.approx(1.5)
    assert types["external perimeter"] == pytest.approx(80 / 20, rel=0.05)
    assert types["infill"] == pytest.approx(40 / 20, rel=0.05)
    assert layers["1"] == pytest.approx(types["infill"] + 1.5 + 40 / 100, rel=0.1)
    assert layers[BEFORE] == pytest.approx(math.hypot(20, 20) / 100, rel=0.5)  # from home, which nobody knows
    assert (survey.counts[MOVING], survey.counts[ROADS], survey.counts[PATH]) == (4, 2, 120)
    assert survey.box.tolist() == [[20, 20, 0.3], [60, 60, 0.3]]


@pytest.mark.parametrize("name", ["star_rel.gcode", "box_fwretract.gcode", "box_two_tools.gcode"])
def test_both_tables_add_up_whatever_the_chunks(name: str) -> None:
    data = (DATA / name).read_bytes()
    whole, _ = surveyed(data, FILAMENT)
    for size in (1, 7, 100):
        some, _ = surveyed(data, FILAMENT, size)
        assert some.by_layer() == pytest.approx(whole.by_layer(), abs=1e-9)
        assert some.by_type() == pytest.approx(whole.by_type(), abs=1e-9)
        np.testing.assert_allclose(some.counts, whole.counts, rtol=1e-12)
    assert sum(whole.by_layer().values()) == pytest.approx(whole.time_s)
    assert sum(whole.by_type().values()) == pytest.approx(whole.time_s)


@pytest.mark.parametrize("machine", ["filament", "syringe"])
@pytest.mark.parametrize("name", ["box_abs", "box_fwretract", "arcs_rel", "star_rel", *SLICED])
def test_the_virtual_firmware_takes_as_long_within_a_percent(name: str, machine: str) -> None:
    path = Path(CORPUS if name in SLICED else DATA) / f"{name}.gcode"
    if name in SLICED and not CORPUS:
        pytest.skip("GCODECTL_CORPUS is not set")
    survey, parts = surveyed(path.read_bytes(), load_machine(machine))
    assert survey.time_s == pytest.approx(execute(parts, load_machine(machine)).duration, rel=0.01)


def test_what_the_plan_does_not_follow_is_guessed() -> None:
    assert ramped_kernel(10.0, 10.0, 100.0) == pytest.approx(1.1)
    assert ramped_kernel(0.01, 10.0, 100.0) == pytest.approx(0.02)
    assert ramped_kernel(0.0, 10.0, 100.0) == 0.0
    machine, place = Survey(FILAMENT).machine, np.zeros(4)
    there = np.array([30.0, 40.0, np.nan])
    for kernel in (guess_kernel, getattr(guess_kernel, "py_func", guess_kernel)):
        assert kernel(1, 0.0, 50.0, there, machine, place) == pytest.approx(1.0, rel=0.1)
        assert kernel(1, 0.0, np.nan, there, machine, place) == pytest.approx(2.0, rel=0.1)
        assert kernel(0, 0.0, 50.0, there, machine, place) == 0.0
        assert 0.02 < kernel(4, 0.0, 50.0, there, machine, place) < 0.1
