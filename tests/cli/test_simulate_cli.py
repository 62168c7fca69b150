"""`gcodectl simulate` from outside."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from gcodectl.cli import simulate
from gcodectl.errors import InputError, UsageError

app = typer.Typer()
app.command("simulate")(simulate.command)
HEAD = "G28\nG21\nG90\nM83\nG1 Z.6 F600\nG1 X0 Y0 F2400\n"
ROADS = "G1 F600\nG1 X20 E.055\nG1 Y20 E.055\nG1 X0 E.055\nG1 X5 Y5 F2400\nG1 X15 Y5 E.0275 F600\n"


def run(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(one) for one in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture
def part(tmp_path: Path) -> Path:
    path = tmp_path / "part.gcode"
    path.write_text(HEAD + ROADS)
    return path


ON = ("--machine", "syringe", "--plant")


def test_the_score_is_one_json_object(part: Path):
    result = json.loads(run(part, *ON, "paste-a", "--json"))
    assert (result["roads"], result["bins"]) == (2, 70)
    assert 0.2 < result["rmse"] < 1.1
    assert result["time_s"] == pytest.approx(7.4, abs=0.5)
    assert result["max_flow"] == 25
    assert json.loads(run(part, *ON, "paste-a", "--json")) == result


def test_people_get_a_few_lines(part: Path):
    out = run(part, *ON, "paste-a")
    assert [line.split()[0] for line in out.splitlines()] == ["rmse", "off_path", "time_s", "bias", "worst", "on_road"]


def test_the_cap_and_pressure_advance_matter(part: Path):
    plain, capped, advanced = (
        json.loads(run(part, *ON, "linear", "--json", *more))
        for more in ((), ("--cap", "2"), ("--pressure-advance", "0.5", "--smooth-time", "0.02"))
    )
    assert capped["max_flow"] == pytest.approx(2 * 10 * 0.055 / 20 * 196.07, rel=1e-3)
    assert advanced["rmse"] < plain["rmse"]


def test_another_file_is_scored_against_the_target(part: Path, tmp_path: Path):
    louder = tmp_path / "louder.gcode"
    louder.write_text(HEAD + ROADS.replace("E.055", "E.066").replace("E.0275", "E.033"))
    own = json.loads(run(louder, *ON, "linear", "--json"))
    other = json.loads(run(louder, "--target", part, *ON, "linear", "--json"))
    assert other["on_road"] == pytest.approx(1.2 * own["on_road"])
    moved = tmp_path / "moved.gcode"
    moved.write_text((HEAD + ROADS).replace("X20", "X23"))
    with pytest.raises(InputError, match="never passed over"):
        run(moved, "--target", part, *ON, "linear")
    half = tmp_path / "half.gcode"
    half.write_text(HEAD + ROADS.rpartition("G1 X5 Y5")[0])
    assert "unvisited" in run(half, "--target", part, *ON, "linear")


def test_a_tool_may_have_its_own_plant(tmp_path: Path):
    path = tmp_path / "two.gcode"
    path.write_text(HEAD + ROADS + "T1\n" + "G90\nM83\nG1 X30 Y30 F2400\nG1 X50 E.055 F600\n")
    one = json.loads(run(path, *ON, "linear", "--json"))
    two = json.loads(run(path, *ON, "linear", "--tool-plant", "1=paste-b", "--json"))
    assert two["rmse"] > one["rmse"]


def test_pictures_are_written(part: Path, tmp_path: Path):
    folder = tmp_path / "pictures"
    run(part, *ON, "paste-a", "--plot", folder, "--material", "paste-a", "--window", "0,8")
    assert sorted(path.name for path in folder.iterdir()) == ["flow.png", "part.png"]
    run(part, *ON, "paste-a", "--plot", folder)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--window", "5"), "FROM,TO"),
        (("--window", "5,1"), "before it begins"),
        (("--tool-plant", "paste-b"), "TOOL=PLANT"),
        (("--plot", "x", "--material", "marble"), "no material"),
        (("--cap", "-1"), "cap"),
    ],
)
def test_wrong_options_are_explained(part: Path, more: tuple[str, ...], said: str):
    with pytest.raises(UsageError, match=said):
        run(part, *ON, "linear", *more)


def test_a_file_that_lays_nothing_is_an_input_error(tmp_path: Path):
    path = tmp_path / "travel.gcode"
    path.write_text(HEAD)
    with pytest.raises(InputError, match="no road"):
        run(path, *ON, "linear")
