"""Real files on the virtual printer."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest

from gcodectl.config import load_machine
from plant_models.bead import bin_width, find_roads
from plant_models.firmware import execute
from plant_models.reading import first_layers, read_moves
from plant_models.score import score

CORPUS = os.environ.get("GCODECTL_CORPUS")
needs_corpus = pytest.mark.skipif(not CORPUS, reason="GCODECTL_CORPUS does not name the folder of real files")
LAYERS = b"G21\nG90\nM83\nG1 X0 Y0 Z.6 F600\n;LAYER_CHANGE\nG1 X9 E1\n;LAYER_CHANGE\nG1 Z1.2\nG1 X0 E1\n"


def test_a_file_is_cut_where_a_layer_begins():
    machine = load_machine("syringe")
    moves = read_moves(LAYERS, machine)
    assert first_layers(LAYERS, moves, 1).endswith(b"G1 X9 E1\n")
    assert first_layers(LAYERS, moves, 9) == LAYERS


@needs_corpus
@pytest.mark.parametrize(
    ("name", "machine", "minutes"),
    [
        ("paste_cube_prusaslicer.gcode", "syringe", 24 + 51 / 60),
        ("ps_vase_spiral.gcode", "filament", 3 + 36 / 60),
        ("ps_cube10_relE.gcode", "filament", 8 + 29 / 60),
    ],
)
def test_the_time_is_about_what_the_slicer_says(name: str, machine: str, minutes: float):
    profile = load_machine(machine)
    execution = execute([read_moves((Path(str(CORPUS)) / name).read_bytes(), profile)], profile)
    assert execution.duration / 60 == pytest.approx(minutes, rel=0.03)


@needs_corpus
def test_every_file_of_the_corpus_runs_and_scores_itself():
    profile = load_machine("filament")
    for path in sorted(Path(str(CORPUS)).iterdir()):
        if path.suffix not in (".gcode", ".ngc", ".nc"):
            continue
        execution = execute([read_moves(path.read_bytes(), profile, pass_unknown=True)], profile)
        assert math.isfinite(execution.duration), path.name
        roads = find_roads(execution.segments, bin_width(profile.nozzle))
        if not len(roads.target):
            continue
        u = execution.command(0.02, 0.1)
        result = score(roads, execution, u)
        assert result.unvisited < 1e-6, path.name
        laid = (result.on_road + result.off_path) * result.target_volume
        assert laid == pytest.approx(np.maximum(u.values, 0).sum() * 0.02, rel=1e-6), path.name
