"""`gcodectl filter`, `check` and `tasks` in this process: options, outputs, refusals, odd input."""

from __future__ import annotations

import csv
import io
import json
import os
from pathlib import Path

import pytest
from filtering import DATA, OWN, filtered, options
from flow_models import PLUNGER, modelled
from typer.testing import CliRunner, Result

from gcodectl.cli.main import app
from gcodectl.errors import GcodectlError, InputError, UsageError
from gcodectl.flow.library import Library, save_library
from gcodectl.pipeline import Options

BOX = DATA / "box_abs.gcode"
SLICER = [name for name in os.environ if name.startswith("SLIC3R_")]


def call(*words: object, ok: bool = True, stdin: bytes | None = None, **environment: str) -> Result:
    env = {**dict.fromkeys(SLICER), **environment}
    result = CliRunner().invoke(app, [str(word) for word in words], input=stdin, env=env)
    if ok and result.exception:
        raise result.exception
    return result


def refused(*words: object, **more: object) -> GcodectlError:
    error = call(*words, ok=False, **more).exception
    assert isinstance(error, GcodectlError), error
    return error


def test_file_pipe_and_in_place_give_the_same(tmp_path: Path) -> None:
    wanted = filtered(BOX.read_bytes())
    copy = tmp_path / "part.gcode"
    copy.write_bytes(BOX.read_bytes())
    copy.chmod(0o640)
    link = tmp_path / "link.gcode"
    link.symlink_to(copy)
    assert call("filter", BOX, "--material", "paste-a").stdout_bytes == wanted
    assert call("filter", "--material", "paste-a", stdin=BOX.read_bytes()).stdout_bytes == wanted
    call("filter", BOX, "--material", "paste-a", "-o", tmp_path / "out.gcode")
    assert (tmp_path / "out.gcode").read_bytes() == wanted
    call("filter", "--in-place", "--material", "paste-a", link)
    assert copy.read_bytes() == wanted
    assert link.is_symlink()
    assert copy.stat().st_mode & 0o777 == 0o640
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.gcode", "out.gcode", "part.gcode"]
    second = call("filter", "--in-place", "--material", "paste-a", copy)
    assert "already" in second.stderr
    assert copy.read_bytes() == wanted
    assert call("filter", "--material", "paste-a", stdin=wanted).stdout_bytes == wanted
    call("filter", copy, "-o", copy, "--material", "neutral")
    assert copy.read_bytes() == wanted


def test_output_over_the_input_and_to_a_device(tmp_path: Path) -> None:
    part = tmp_path / "part.gcode"
    part.write_bytes(BOX.read_bytes())
    call("filter", part, "-o", part)
    assert part.read_bytes().startswith(BOX.read_bytes())
    call("filter", BOX, "-o", "/dev/null")


def test_a_missing_folder_is_named_and_not_the_input(tmp_path: Path) -> None:
    part = tmp_path / "part.gcode"
    part.write_text("G28\nG1 X10 F600\n")
    assert "no folder" in str(refused("filter", part, "-o", tmp_path / "nowhere" / "out.gcode"))


def test_refusals_name_line_text_and_reason_and_leave_the_output(tmp_path: Path) -> None:
    part, out = tmp_path / "part.ngc", tmp_path / "out.gcode"
    part.write_text("G21\nG90\n#1=5\nG1 X#1\n")
    out.write_text("old")
    for words in (("filter", part, "-o", out), ("filter", "--in-place", part), ("check", part), ("tasks", part)):
        error = refused(*words)
        assert error.exit_status == 3
        assert "line 3" in str(error)
        assert "#1=5" in str(error)
        assert "not followed" in str(error)
    assert out.read_text() == "old"
    assert part.read_text() == "G21\nG90\n#1=5\nG1 X#1\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.gcode", "part.ngc"]
    call("filter", part, "-o", out, "--pass-unknown")
    assert out.read_text().startswith(part.read_text())
    assert json.loads(call("check", part, "--pass-unknown", "--json").stdout)["barriers"] == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("filter", "--in-place", "-"), "--in-place takes a FILE"),
        (("filter", BOX, "--in-place", "-o", "x"), "no -o"),
        (("filter", BOX, "--machine", "none"), "no machine 'none'"),
        (("filter", BOX, "--machine", "none.toml"), "no machine profile"),
        (("filter", BOX, "--material", "none"), "no material 'none'"),
        (("filter", BOX, "--material", "none.npz"), "none.npz"),
        (("filter", BOX, "--material", f"{BOX}.npz:x"), "npz"),
        (("filter", BOX, "--retracts", "maybe"), "replace and keep"),
        (("filter", BOX, "--sequencer", "maybe"), "superpose"),
        (("tasks", BOX, "--json", "--csv"), "not both"),
        (("check", "none.gcode"), "no such file"),
        (("check", DATA), "folder"),
    ],
)
def test_a_wrong_call_says_what_is_wrong(words: tuple[object, ...], said: str) -> None:
    error = refused(*words)
    assert isinstance(error, UsageError | InputError)
    assert said in str(error)


ODD = {
    "zip": b"PK\x03\x04\x00\x00\x00\x08\x00\n" * 20,
    "utf-16": "G21\nG1 X5\n".encode("utf-16"),
    "long": b"G1 X5 " + b"1" * (2 << 20),
    "huge": b"G21\nG90\nG1 X0 Y0 Z0 F600\nG1 X9" + b"9" * 60 + b"\n",
}


@pytest.mark.parametrize("name", ODD)
def test_odd_input_is_refused_in_a_sentence(name: str) -> None:
    error = refused("filter", stdin=ODD[name])
    assert error.exit_status == 3
    assert "line" in str(error)
    assert len(str(error)) < 500


def test_a_material_file_that_is_no_library(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.npz"
    wrong.write_bytes(b"not a zip")
    assert str(wrong) in str(refused("filter", BOX, "--material", wrong))


def test_the_slicer_is_heard() -> None:
    text = b"G21\nG92 E0\nG1 X0 Y0 Z0.6 F600\nG1 X10 E1\nG1 X20 E2\n"
    told = {"SLIC3R_FILAMENT_DIAMETER": "2,2", "SLIC3R_USE_RELATIVE_E_DISTANCES": "1", "SLIC3R_NOZZLE_DIAMETER": "0.84"}
    found = json.loads(call("check", "--json", stdin=text, **told).stdout)
    assert found["volume_mm3"] == pytest.approx(3 * 3.14159265)
    assert found["source"] == "standard input"
    told["SLIC3R_USE_RELATIVE_E_DISTANCES"] = "0"
    assert json.loads(call("check", "--json", stdin=text, **told).stdout)["e_total"] == pytest.approx(2)
    assert "SLIC3R_FILAMENT_DIAMETER" in str(refused("check", BOX, SLIC3R_FILAMENT_DIAMETER="wide"))
    other = call("filter", BOX, "--material", "paste-a", "-o", "/dev/null", SLIC3R_NOZZLE_DIAMETER="1.2")
    assert "0.84 mm" in other.stderr


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
def test_check_says_what_a_file_does(path: Path) -> None:
    found = json.loads(call("check", path, "--json").stdout)
    assert found["lines"] == len(path.read_text().splitlines())
    assert found["time_s"] > 5
    assert found["volume_mm3"] > 30
    assert found["tools"] == ([0, 1] if "two" in path.name else [0])
    table = call("check", path).stdout
    assert f"{found['lines']} lines" in table


def test_three_lines_are_the_papers_sequence() -> None:
    rows = json.loads(call("tasks", DATA / "three_lines.gcode", "--json").stdout)
    assert [row["kind"] for row in rows] == [
        "No-Flow", "Start", "Steady-State", "Corner", "Steady-State", "Corner", "Steady-State", "Stop", "No-Flow",
    ]  # fmt: skip
    corners = [row for row in rows if row["kind"] == "Corner"]
    assert [(row["x"], row["y"]) for row in corners] == [(50.0, 20.0), (50.0, 50.0)]
    assert all(row["t_start"] <= row["t_end"] for row in rows)


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
def test_tasks_as_table_csv_and_json_are_the_same(path: Path) -> None:
    rows = json.loads(call("tasks", path, "--json").stdout)
    read = list(csv.DictReader(io.StringIO(call("tasks", path, "--csv").stdout)))
    table = call("tasks", path).stdout.splitlines()
    assert [row["kind"] for row in rows] == [row["kind"] for row in read] == [row.split()[0] for row in table[1:]]
    assert [str(row["first_line"]) for row in rows] == [row["first_line"] for row in read]


def test_what_was_done_is_said_as_json(tmp_path: Path) -> None:
    out = tmp_path / "out.gcode"
    done = json.loads(call("filter", BOX, "-o", out, "--json").stdout)
    assert done["bytes"] == out.stat().st_size
    assert done["layers"] == 3
    assert done["roads"] == 6
    piped = call("filter", BOX, "--json")
    assert json.loads(piped.stderr)["output"] == "-"


def test_one_material_serves_every_tool() -> None:
    two = DATA / "box_two_tools.gcode"
    assert call("filter", two, "--material", "paste-a").stdout_bytes == filtered(two.read_bytes(), options("paste-a"))


def test_check_says_what_the_firmware_would_refuse_and_slow_down(tmp_path: Path) -> None:
    head = "G21\nG90\nM83\nG1 X0 Y0 Z0.6 F600\n"
    part = tmp_path / "part.gcode"
    part.write_text(head + "G1 X20 E0.04\nG1 X40 E0.5\nG1 X60 E0.5\nG1 X60.01 E0.0001\n")
    assert "marlin takes every line" not in call("check", part).stdout
    result = call("check", part, "--machine", "syringe-klipper", ok=False)
    assert "klipper would refuse 2 lines by bead" in result.stdout
    assert isinstance(result.exception, GcodectlError)
    assert result.exception.exit_status == 4
    said = str(result.exception)
    assert str(part) in said
    assert "line 6" in said
    assert "max_extrude_cross_section" in said
    assert "in 1 more" in said
    found = json.loads(call("check", part, "--machine", "syringe-klipper", "--json", ok=False).stdout)["firmware"]
    assert found["firmware"] == "klipper"
    assert found["refused"] == 2
    assert [one["line"] for one in found["rules"]["bead"]["first"]] == [6, 7]
    assert found["rules"]["bead"]["worst"] == pytest.approx(0.5 / 20 * 196.07 / 2.8224, rel=1e-3)
    part.write_text(head + "G1 X20 E0.04000\nG1 X40 E0.04000\n")
    assert "klipper takes every line as it is" in call("check", part, "--machine", "syringe-klipper").stdout


def test_filter_says_which_rule_of_the_firmware_makes_starts_slow_and_check_what_to_do(tmp_path: Path) -> None:
    part, out, profile = (tmp_path / name for name in ("part.gcode", "out.gcode", "mine.toml"))
    part.write_text("G21\nG90\nM83\nG1 X0 Y0 Z0.2 F3000\nG1 X30 E1.1 F1800\nG1 Y5 F6000\nG1 X0 E1.1 F1800\n")
    how = ("filter", part, "--material", "filament-bowden", "-o", out)
    said = call(*how, "--machine", "filament-klipper").stderr
    assert "E's speed step by 1 mm/s" in said
    assert "instantaneous_corner_velocity in [extruder], and e_corner_speed" in said
    found = call("check", out, "--machine", "filament-klipper").stdout
    assert "by E speed step" in found
    assert "raise instantaneous_corner_velocity in [extruder] (e_corner_speed)" in found
    profile.write_text(
        "dialect = 'klipper'\nbarrel_diameter = 1.75\nnozzle = 0.4\ne_corner_speed = 20\nmax_flow = 75\n"
    )
    said = call(*how, "--machine", profile).stderr
    assert "26 mm^3/s in short lines" in said
    assert "max_extrude_cross_section" in said
    profile.write_text(profile.read_text() + "max_bead = 5\n")
    assert "without that limit" not in call(*how, "--machine", profile).stderr
    told = json.loads(call(*how, "--machine", "filament-klipper", "--json").stdout)["pace"]
    assert len(told) == 1
    assert json.loads(call(*how, "--machine", "filament", "--json").stdout)["pace"] == []
    part.write_text("G21\nG90\nM83\nG1 X0 Y0 Z0.2 F3000\n")  # with no start, none is slow
    assert json.loads(call(*how, "--machine", "filament-klipper", "--json").stdout)["pace"] == []


def test_quality_has_names_and_numbers_and_changes_nothing_where_nothing_is_known_of_the_extruder() -> None:
    wanted = call("filter", BOX, "--material", "neutral").stdout_bytes
    for quality in ("TIME", "balanced", "BEAD", "0.3"):
        assert call("filter", BOX, "--material", "neutral", "--quality", quality).stdout_bytes == wanted
    assert "TIME, BALANCED, BEAD" in str(refused("filter", BOX, "--quality", "best"))


@pytest.fixture
def with_model(tmp_path: Path) -> Path:
    path = tmp_path / "modelled.npz"
    save_library(Library((modelled(PLUNGER),)), path)
    return path


def test_quality_trades_time_for_the_bead_where_a_model_is_known(with_model: Path, tmp_path: Path) -> None:
    said = {}
    for quality in ("TIME", "0.25", "Balanced", "BEAD"):
        words = ("filter", BOX, "--material", with_model, "--quality", quality, "-o", tmp_path / quality, "--json")
        said[quality] = json.loads(call(*words).stdout)
    times = [one["time_s"] for one in said.values()]
    assert times == sorted(times)
    assert times[-1] > times[0]
    assert said["TIME"]["slowed_starts"] == said["TIME"]["slowed_s"] == 0
    assert said["BEAD"]["slowed_starts"] > 0
    plain = call("filter", BOX, "--material", with_model, "-o", tmp_path / "plain")
    assert (tmp_path / "plain").read_bytes() == (tmp_path / "Balanced").read_bytes()
    assert "slowed for the extruder by" in plain.stderr
    assert "slowed" not in call("filter", BOX, "--material", with_model, "--quality", "0").stderr


def test_every_sequencer_may_be_asked_for(with_model: Path) -> None:
    found = {}
    for sequencer in ("model", "superpose", "basis"):
        out = call("filter", BOX, "--material", with_model, "--sequencer", sequencer).stdout_bytes
        how = Options(options().machine, sets=(modelled(PLUNGER),), sequencer=sequencer)
        assert out == filtered(BOX.read_bytes(), how)
        found[sequencer] = out
    assert len(set(found.values())) == 3
    assert call("filter", BOX, "--material", with_model).stdout_bytes == found["model"]
    said = str(refused("filter", BOX, "--sequencer", "best"))
    assert all(one in said for one in found)
