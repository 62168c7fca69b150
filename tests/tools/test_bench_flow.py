"""The flow bench on small parts: every column, the common form, one's own plant, the parts of the matrix."""

from __future__ import annotations

import argparse
import importlib.util
import json
import sys
from pathlib import Path

import pytest

from gcodectl.errors import UsageError

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
spec = importlib.util.spec_from_file_location("bench_flow", ROOT / "tools" / "bench_flow.py")
assert spec is not None
assert spec.loader is not None
bench_flow = importlib.util.module_from_spec(spec)
spec.loader.exec_module(bench_flow)

from flow_bench import cell as cell_module  # noqa: E402

HEAD = "G28\nG21\nG90\nM83\nG1 Z.6 F600\nG1 X0 Y0 F2400\nG1 X40 Y5\n"
LAYER = ";LAYER_CHANGE\nG1 F600\nG1 X80 E.11\nG1 Y45 E.11\nG1 X0 E.22\nG1 X5 Y5 F2400\n"
PLANT = """
from plant_models.linear import Linear
class Obedient:
    def __init__(self):
        self.inner = Linear(1.0, 0.2)
    def initial(self):
        return self.inner.initial()
    def run(self, state, u, dt):
        return self.inner.run(state, u, dt)
"""


@pytest.fixture
def part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(cell_module, "WHOLE_TRIALS", 8)
    path = tmp_path / "part.gcode"
    path.write_text(HEAD + 2 * LAYER)
    return path


def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    monkeypatch.setattr(sys, "argv", ["bench_flow", *(str(one) for one in arguments)])
    bench_flow.main()
    return capsys.readouterr().out


def test_every_column_and_the_targets(
    part: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = json.loads(run(monkeypatch, capsys, "--gcode", part, "--quick", "--json", "-o", tmp_path / "out"))
    assert set(found) == {"setting", "targets", "summary", "worse_than_pa", "fronts", "bounds", "cells"}
    assert {"plants", "parts", "cap", "seed", "seeds", "noise", "quick", "library"} <= set(found["setting"])
    (one,) = found["cells"]
    columns = one["columns"]
    assert list(columns) == ["none", "coasting", "pa", "expert", "basis", "ours", "whole"]
    assert one["max_flow"] == pytest.approx(5 * one["flow"])
    plain = columns["none"]["rmse"] + columns["none"]["off_path"]
    for name in ("coasting", "pa", "expert", "whole", "ours"):
        assert columns[name]["rmse"] + columns[name]["off_path"] <= plain + 1e-3
    for column in columns.values():
        assert column["drift_rmse"] > 0
        assert column["time_s"] > 1
    low, high = columns["ours"]["rmse_interval"]
    assert low <= columns["ours"]["rmse"] <= high
    assert len(columns["ours"]["rmse_seeds"]) == 2
    for row in found["targets"]:
        assert set(row) >= {"name", "value", "unit", "target", "met"}
    assert found["fronts"][0]["expert"] == one["expert_front"]
    times = [point["time_s"] for point in one["expert_front"]]
    assert times == sorted(times)
    assert (tmp_path / "out" / "flow_bench.png").stat().st_size > 20_000


def test_ones_own_plant_and_a_given_library_as_a_table(
    part: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plant = tmp_path / "mine.py"
    plant.write_text(PLANT)
    out = run(
        monkeypatch, capsys, "--gcode", part, "--plant", f"{plant}:Obedient", "--material", "paste-a", "--cap", "8",
        "--seeds", "1",
    )  # fmt: skip
    for name in ("none", "coasting", "pa", "expert", "whole", "basis", "ours"):
        assert name in out
    assert "MISSED" in out or "met" in out


def options(**given: object) -> argparse.Namespace:
    base = {"gcode": None, "plant": None, "machine": "syringe", "material": None, "library": None, "cap": 5.0}
    return argparse.Namespace(**{**base, "quick": False, **given})


def test_the_matrix_without_a_corpus_has_twelve_parts_a_plant(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GCODECTL_CORPUS", raising=False)
    cases = bench_flow.choose(options())
    parts = {name: [one.part for one in cases if one.plant == name] for name in {one.plant for one in cases}}
    assert len(parts) >= 10
    assert len({one.structure for one in cases}) >= 5
    for names in parts.values():
        assert len(set(names)) == len(names) >= 12
    quick = bench_flow.choose(options(quick=True))
    assert {one.part for one in quick} == set(bench_flow.QUICK_PARTS)
    assert {one.plant for one in quick} == set(bench_flow.QUICK_PLANTS)


def test_a_plant_of_ones_own_prints_every_part_of_its_machine(tmp_path: Path) -> None:
    plant = tmp_path / "mine.py"
    plant.write_text(PLANT)
    cases = bench_flow.choose(options(plant=[f"{plant}:Obedient"], machine="pellet"))
    assert len(cases) >= 12
    assert {one.machine.name for one in cases} == {"pellet"}
    with pytest.raises(UsageError, match="--gcode"):
        bench_flow.choose(options(plant=[f"{plant}:Obedient"], machine="other.toml"))
    with pytest.raises(UsageError, match="no plant"):
        bench_flow.choose(options(plant=["nothing-of-the-kind"]))


def test_a_library_is_named_or_learned() -> None:
    assert bench_flow.given_library(options()) is None
    assert bench_flow.given_library(options(material="paste-b")).material == "paste-b"
    with pytest.raises(UsageError, match="paste-a"):
        bench_flow.given_library(options(material="gold"))
