from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "calibrate"))

from known import by_rule

from gcodectl.calibrate.store import add, read
from gcodectl.cli import calibrate, learn
from gcodectl.errors import InputError, UnsafeError, UsageError
from gcodectl.flow.library import builtin_libraries
from plant_models.plant import load_plant

app = typer.Typer()
app.add_typer(calibrate.app, name="calibrate")
app.add_typer(learn.app, name="learn")


def call(*words):
    result = CliRunner().invoke(app, [str(word) for word in words])
    if result.exception:
        raise result.exception
    return result


@pytest.fixture
def store(tmp_path):
    path = tmp_path / "known.sqlite"
    add(path, by_rule(4, 2))
    return path


def test_add_and_list(tmp_path):
    path = tmp_path / "own.sqlite"
    words = ("material=clay", "nozzle_diameter=0.84mm", "elasticity=low", "pushouttime=0.4s")
    assert "clay added to" in call("calibrate", "add", path, *words).stderr
    assert "was in already" in call("calibrate", "add", path, *words).stderr
    call("calibrate", "add", path, *words, "--source", "again")
    assert [one.source for one in read(path)] == ["", "again"]
    shown = call("calibrate", "list", path)
    assert "clay (by hand): elasticity=low nozzle_diameter=0.84 pushouttime=0.4" in shown.stdout
    assert "2 calibrations of 1 materials" in shown.stderr
    assert json.loads(call("calibrate", "list", path, "--json").stdout)[0]["parameters"]["pushouttime"] == 0.4


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("material=x",), "at least one control parameter"),
        (("clay",), "'clay' is no name=value"),
        (("material=x", "material=y"), "material is given twice"),
        (("material=x", "tau=3"), "no attribute or parameter 'tau'"),
    ],
)
def test_what_cannot_be_added(tmp_path, words, said):
    with pytest.raises(UsageError, match=said):
        call("calibrate", "add", tmp_path / "own.sqlite", *words)
    assert not (tmp_path / "own.sqlite").exists()


def test_import_says_what_it_left_out(tmp_path):
    files = [tmp_path / name for name in ("10ccGreenTaper-Clay.tool", "10ccGreenTaper.tool", "notes.tool")]
    text = "TIPDIAM 0.8\nPATHWIDTH 0.8\nPATHHEIGHT 0.7\nPUSHOUT 0.3\nSUCKBACK 0.2\nDEPOSITIONRATE 0.0035\n"
    for file in files[:2]:
        file.write_text(f"{text}PATHSPEED 5\nBARRELDIAM 15.8\nMOTOR 3 -1 0.0004\n")
    files[2].write_text("buy clay\n")
    path = tmp_path / "own.sqlite"
    said = call("calibrate", "import", path, *files).stderr
    assert "10ccGreenTaper.tool: its name has no material" in said
    assert "notes.tool: is no Fab@Home tool file" in said
    assert "1 of 3 files added" in said
    with pytest.raises(InputError, match="none of these files"):
        call("calibrate", "import", path, files[2])
    assert [one.material for one in read(path)] == ["clay"]


def test_a_suggestion_becomes_the_first_trial(store, tmp_path):
    guess, library = tmp_path / "guess.json", tmp_path / "lib.npz"
    words = ("material=new", "elasticity=high", "path_width=0.84", "path_height=0.6")
    shown = call("calibrate", "suggest", store, *words, "-o", guess)
    assert "nearest known materials" in shown.stdout
    assert "no known calibration tells inputaccel" in shown.stdout
    facts = json.loads(guess.read_text())
    assert facts["low"]["pushouttime"] < facts["parameters"]["pushouttime"] < facts["high"]["pushouttime"]
    learned = {}
    for name, more in (("flat", ()), ("guessed", ("--guess", guess))):
        asked = ("--plant", "linear", "--material", name, "--flow", 5, "--trials", 1, "--json", *more)
        learned[name] = json.loads(call("learn", "run", *asked, "-o", library).stdout)
    assert learned["guessed"]["guess"] == "guess.json"
    assert learned["guessed"]["rms"][0] < 0.8 * learned["flat"]["rms"][0]


def test_a_suggestion_has_a_flow_model_where_learned_materials_are_described(store, tmp_path):
    guess, library = tmp_path / "guess.json", tmp_path / "lib.npz"
    for number in range(3):
        asked = ("--plant", "linear" if number == 1 else f"{__file__}:lag_{number}", "--flow", 5, "--trials", 2)
        call("learn", "run", *asked, "--material", f"stuff {number}", "-o", library)
    words = ("material=new", "elasticity=medium", "path_width=0.84", "path_height=0.6")
    shown = call("calibrate", "suggest", store, *words, "--learned", library, "-o", guess)
    assert "flow model: plunger" in shown.stdout
    assert json.loads(guess.read_text())["model"]["store"] == pytest.approx(5.0, rel=0.3)
    asked = ("--plant", "linear", "--material", "new", "--flow", 5, "--trials", 1, "--json", "--guess", guess)
    assert json.loads(call("learn", "run", *asked, "-o", library).stdout)["rms"][0] < 0.6
    with pytest.raises(InputError, match="no learned material that the store describes"):
        call("calibrate", "suggest", store, *words, "--learned", builtin_libraries()["clay"])


def lag_0(flow):
    return load_plant("linear", flow=flow, tau=0.8)


def lag_2(flow):
    return load_plant("linear", flow=flow, tau=1.2)


def test_a_guess_for_another_extruder_stops_before_anything_is_pushed(store, tmp_path):
    words = ("material=new", "path_width=0.84", "path_height=0.6")
    call("calibrate", "add", store, "material=known", "tool=syringe pump", "pushouttime=0.2")
    with pytest.raises(UnsafeError, match="nothing is known of air pressure tools"):
        call("calibrate", "suggest", store, *words, "tool=air pressure", "-o", tmp_path / "air.json")
    assert not (tmp_path / "air.json").exists()
    guess = tmp_path / "guess.json"
    call("calibrate", "suggest", store, *words, "-o", guess)
    facts = json.loads(guess.read_text())
    facts["parameters"] |= {"pushoutspeed": 400.0, "pullbackspeed": 400.0}
    guess.write_text(json.dumps(facts))
    with pytest.raises(UnsafeError, match="would push"):
        call("learn", "run", "--plant", "linear", "--material", "x", "--guess", guess, "-o", tmp_path / "lib.npz")
    assert not (tmp_path / "lib.npz").exists()


def test_suggest_takes_attributes_only(store):
    with pytest.raises(UsageError, match="pushouttime: that is what is suggested"):
        call("calibrate", "suggest", store, "material=new", "pushouttime=1")


def test_evaluate_shows_both_ways_of_leaving_out(store):
    rows = json.loads(call("calibrate", "evaluate", store, "--json").stdout)
    learners = {row["learner"] for row in rows if row["parameter"] == "pushouttime"}
    assert {"mean", "chosen", "committee", "gaussian"} < learners
    assert all(row["one_out"] >= 1.0 and row["material_out"] >= 1.0 for row in rows if row["factor"])
