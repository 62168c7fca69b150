"""The parts of tools/reproduce_basis_signals: learned once, then held against the paper and drawn."""

from __future__ import annotations

import importlib.util
import itertools
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from gcodectl.config import load_machine
from gcodectl.learn.segmentation import basis_set
from gcodectl.pipeline import Options, read_moves
from gcodectl.records import TaskKind
from gcodectl.report.basis import spans
from plant_models.parts import Style, fig9_gcode, tic_tac_toe_gcode
from plant_models.plant import load_plant

TOOL = Path(__file__).resolve().parents[2] / "tools" / "reproduce_basis_signals.py"


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("reproduce_basis_signals", TOOL)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def runs(tool):
    return tool.all_runs(tool.paper_machine(), 0)


@pytest.fixture(scope="module")
def one(runs):
    learner = runs["parts"][0].learner
    return basis_set(learner.best.u, learner.routine, material="paste-a", nozzle=0.84)


def test_every_target_is_met_and_json_has_the_benches_form(tool, runs, monkeypatch, capsys):
    monkeypatch.setattr(tool, "all_runs", lambda _machine, _seed: runs)
    monkeypatch.setattr(sys, "argv", ["reproduce_basis_signals", "--quick", "--json", "--seed", "3"])
    tool.main()
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"setting", "targets", "cells"}
    assert found["setting"]["seed"] == 3
    assert all(set(row) == {"name", "value", "unit", "target", "met"} for row in found["targets"])
    assert [row["name"] for row in found["targets"] if not row["met"]] == []
    assert len(found["cells"]) == 14 + 1
    monkeypatch.setattr(sys, "argv", ["reproduce_basis_signals", "--quick"])
    tool.main()
    assert "Fig. 9: {No-Flow, Start, Steady-State, Corner, Steady-State, Corner," in capsys.readouterr().out


def test_pictures_of_learning(tool, runs, tmp_path):
    tool.draw_learning(runs, tmp_path, 0)
    names = {path.name for path in tmp_path.iterdir() if path.read_bytes().startswith(b"\x89PNG")}
    assert names == {f"{name}.png" for name in (
        "fig3_responses", "fig4_errors", "fig5_signals", "fig6_segments", "convergence"
    )}  # fmt: skip


def test_the_three_lines_of_fig9(tool, one, tmp_path):
    machine = tool.paper_machine()
    row = tool.fig9(one, machine, load_plant("paste-a"), tmp_path, "a note")
    assert row["sequence"] == tool.FIG9
    assert row["rms"] < 0.15 * row["rms_none"]
    assert (tmp_path / "fig10_sequence.png").stat().st_size > 20_000
    assert (tmp_path / "fig9_tasks.png").exists()
    part = tool.composed(fig9_gcode(Style.of(machine, 5.0)), Options(machine, (one,), sequencer="basis"))
    pieces = spans(part.tasks, one)
    assert [kind.label for kind, *_ in pieces] == tool.FIG9
    assert all(before[2] == after[1] for before, after in itertools.pairwise(pieces))
    assert pieces[1][3] - pieces[1][1] == pytest.approx(one.signals[TaskKind.START].lead)


def test_signals_that_meet_cut_each_other_short(tool, one):
    machine = tool.paper_machine()
    part = tool.composed(tic_tac_toe_gcode(Style.of(machine, 5.0)), Options(machine, (one,), sequencer="basis"))
    pieces = spans(part.tasks, one)
    assert all(before[2] == pytest.approx(after[1]) for before, after in itertools.pairwise(pieces))
    kinds = part.tasks.kind.tolist()
    assert [kinds.count(kind) for kind in (TaskKind.START, TaskKind.STOP, TaskKind.CORNER)] == [11, 11, 4]


@pytest.mark.parametrize("write", [fig9_gcode, tic_tac_toe_gcode])
def test_the_parts_ask_for_one_flow_everywhere(write):
    machine = load_machine("syringe")
    (moves,) = list(read_moves([write(Style.of(machine, 5.0))], Options(machine)))
    laid = (moves.e > 0) & (moves.length > 0)
    bead = moves.e[laid] * machine.area / moves.length[laid]
    np.testing.assert_allclose(bead * moves.feed[laid], 5.0, rtol=2e-3)
    assert np.unique(moves.feed[laid]).tolist() == [10.0]
    assert np.isfinite(moves.p1[laid]).all()
