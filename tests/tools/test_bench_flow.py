"""The flow bench on a small part: every row, the common form, the targets."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import pytest

from gcodectl.errors import UsageError

ROOT = Path(__file__).resolve().parents[2]
spec = importlib.util.spec_from_file_location("bench_flow", ROOT / "tools" / "bench_flow.py")
assert spec is not None
assert spec.loader is not None
bench_flow = importlib.util.module_from_spec(spec)
spec.loader.exec_module(bench_flow)

HEAD = "G28\nG21\nG90\nM83\nG1 Z.6 F600\nG1 X0 Y0 F2400\nG1 X40 Y5\n"
LAYER = ";LAYER_CHANGE\nG1 F600\nG1 X80 E.11\nG1 Y45 E.11\nG1 X0 E.22\nG1 X5 Y5 F2400\n"


def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    monkeypatch.setattr(sys, "argv", ["bench_flow", *(str(one) for one in arguments)])
    bench_flow.main()
    return capsys.readouterr().out


def test_every_row_and_the_targets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench_flow, "TRIALS", 10)
    part = tmp_path / "part.gcode"
    part.write_text(HEAD + LAYER + LAYER)
    result = json.loads(run(monkeypatch, capsys, "--gcode", part, "--quick", "--json", "-o", tmp_path / "out"))
    cells = {cell["baseline"]: cell for cell in result["cells"]}
    assert list(cells) == ["none", "coasting", "pa", "expert", "whole", "basis", "ours"]
    assert {"gcode", "plant", "machine", "cap", "seed", "quick", "nominal_flow", "max_flow"} <= set(result["setting"])
    assert result["setting"]["max_flow"] == pytest.approx(5 * result["setting"]["nominal_flow"])
    assert [row["name"] for row in result["targets"]] == ["rmse of ours over none", "off_path of ours over none"]
    for row in result["targets"]:
        column = row["name"].split()[0]
        assert row["value"] == pytest.approx(cells["ours"][column] / cells["none"][column])
        assert row["met"] == (row["value"] <= 0.5)
    for name in ("coasting", "pa", "expert", "whole", "ours"):
        assert cells[name]["rmse"] + cells[name]["off_path"] <= cells["none"]["rmse"] + cells["none"]["off_path"] + 1e-3
    assert (tmp_path / "out" / "flow_bench.png").stat().st_size > 5000


def test_a_table_for_people_without_a_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench_flow, "TRIALS", 2)
    part = tmp_path / "part.gcode"
    part.write_text(HEAD + LAYER)
    out = run(monkeypatch, capsys, "--gcode", part, "--plant", "linear", "--cap", "8")
    for name in ("none", "coasting", "pa", "expert", "whole"):
        assert name in out
    assert "basis" not in out


def test_the_part_is_found_or_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GCODECTL_CORPUS", str(tmp_path))
    (tmp_path / bench_flow.PART).write_text(HEAD)
    assert bench_flow.find_part(None) == tmp_path / bench_flow.PART
    assert bench_flow.find_part(Path("x.gcode")) == Path("x.gcode")
    monkeypatch.delenv("GCODECTL_CORPUS")
    monkeypatch.setattr(bench_flow, "ROOT", tmp_path)
    with pytest.raises(UsageError, match="--gcode"):
        bench_flow.find_part(None)
