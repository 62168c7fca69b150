"""`gcodectl learn start|simulate|next|drop|status|finish`, as a person calls them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from learning import call

from gcodectl.cli import common
from gcodectl.errors import InputError, UnsafeError, UsageError
from gcodectl.flow.library import load_library
from gcodectl.learn.model import Model
from gcodectl.session import record
from gcodectl.session.held import held
from gcodectl.session.record import load
from gcodectl.session.weighing import counted


def start(folder, *words):
    return call("start", folder, "--machine", "syringe", "--material", "clay", "--flow", 5, *words)


def simulate(folder, *words):
    return call("simulate", folder, "--plant", "linear", "--noise", 0.1, *words)


def simulate_fails(folder):
    return call("simulate", folder, "--plant", "linear", error=InputError)


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A session of two measured trials."""
    folder = tmp_path_factory.mktemp("session") / "s"
    told = [start(folder, "--date", "2026-01-02")]
    for number in range(2):
        told.append(simulate(folder))
        told.append(call("next", folder, "--measured", folder / f"trial-{number:02}.csv"))
    return folder, told


@pytest.fixture
def copy(two, tmp_path):
    """The same, to be changed."""
    for name, data in files(two[0]).items():
        (tmp_path / name).write_bytes(data)
    return tmp_path


def test_every_step_says_what_to_do_next(two):
    folder, told = two
    assert f"print {folder}/trial-00.gcode" in told[0]
    assert f"gcodectl learn next {folder} --measured trial-00.csv" in told[0]
    assert "trial 0 on linear, seed 0, noise 0.1, as s,area" in told[1]
    assert "converges" in told[2]
    assert f"print {folder}/trial-01.gcode" in told[2]
    rows = [line.split() for line in told[4].splitlines() if line.strip()[:1].isdigit()]
    assert [row[0] for row in rows] == ["0", "1"]
    assert float(rows[1][3]) < 0.5
    assert rows[1][-1] == "best"


def test_the_first_trial_says_where_places_are_counted_from(two):
    head = files(two[0])["trial-00.gcode"].decode().splitlines()
    assert head[0] == "; gcodectl learn: trial 0 of clay, 0.84 mm nozzle"
    assert "from the datum's middle line" in head[1]


def test_finish_stores_a_material_that_says_what_made_it(two, tmp_path):
    path = tmp_path / "clay.npz"
    said = call("finish", two[0], "-o", path)
    assert "of trial 0, printed once: no spread is known" in said
    assert "serves: it predicted the last trial, unseen, to" in said
    assert "prints differ by" in said
    assert "clay@0.84 stored" in said
    made = load_library(path).sets[0]
    assert made.training["date"] == "2026-01-02"
    assert made.training["prints"] == 2
    assert made.training["plant"] == "linear, seed 0, noise 0.1"
    assert made.model is not None
    record = json.loads(call("finish", two[0], "-o", path, "--json"))
    assert record["trials"] == 2
    assert load_library(path).sets[0].model == made.model


def test_status_tells_and_writes_what_is_missing(copy, tmp_path):
    lost = (copy / "trial-01.gcode").read_bytes()
    (copy / "trial-01.gcode").unlink()
    facts = json.loads(call("status", copy, "--json", "--plot", tmp_path / "s.png"))
    assert (copy / "trial-01.gcode").read_bytes() == lost
    assert [one["number"] for one in facts["trials"]] == [0, 1]
    assert facts["trials"][0]["prints"][0].endswith("trial-00.csv")
    assert facts["best"] == 1
    assert (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG")
    assert call("status", copy) == call("status", copy)


def test_status_of_a_session_that_is_whole_writes_nothing(copy):
    before = {path.name: path.stat().st_mtime_ns for path in copy.iterdir()}
    call("status", copy)
    assert {path.name: path.stat().st_mtime_ns for path in copy.iterdir()} == before


def test_a_new_session_waits_for_its_first_trial(tmp_path):
    folder = tmp_path / "s"
    said = start(folder)
    assert said.startswith(call("status", folder))
    assert "heats nothing" in said
    assert "trial 0 is not measured" in call("finish", folder, "-o", tmp_path / "l.npz", error=InputError)
    assert not (tmp_path / "l.npz").exists()
    assert "holds a session already" in call(
        "start", folder, "--machine", "syringe", "--material", "x", error=UsageError
    )


def test_a_session_without_its_first_trial_has_facts_but_no_picture(copy, tmp_path):
    call("drop", copy, 0)
    facts = json.loads(call("status", copy, "--json"))
    assert facts["waiting"] == "trial-00.gcode"
    assert [one["number"] for one in facts["trials"]] == []
    assert facts["best"] is None
    assert set(facts) == set(json.loads(call("next", copy, "--measured", copy / "trial-00.csv", "--json")))
    call("drop", copy, 0)
    said = call("status", copy, "--plot", tmp_path / "s.png", error=UsageError)
    assert "trial 0 is not measured, so there is nothing to draw" in said


def test_a_trial_whose_file_is_another_is_named_and_written_again(copy):
    path = copy / "trial-02.gcode"
    whole = path.read_bytes()
    path.write_bytes(b"G28\n")
    said = simulate_fails(copy)
    assert said.startswith(f"{path}: does not go where its session says")
    assert said.endswith("delete it, and `gcodectl learn status` writes it again")
    path.unlink()
    call("status", copy)
    assert path.read_bytes() == whole


def test_dropping_and_printing_again(copy):
    said = call("drop", copy, 1)
    assert f"print {copy}/trial-01.gcode again, and give its measurement with --trial 1, or go on" in said
    facts = json.loads(call("status", copy, "--json"))
    assert [one["number"] for one in facts["trials"]] == [0]
    for seed in (5, 6):
        told = simulate(copy, "--trial", 0, "--seed", seed, "-o", copy / f"again-{seed}.csv")
        assert "trial 0 on linear" in told
    words = ("--measured", copy / "again-5.csv", "--measured", copy / "again-6.csv")
    said = call("next", copy, "--trial", 0, *words)
    assert "+-" in said
    facts = json.loads(call("status", copy, "--json"))
    assert len(facts["trials"][0]["prints"]) == 3
    assert facts["trials"][0]["standard_error"] > 0
    said = call("drop", copy, 0, "--print", 2)
    assert said.startswith(f"forgotten: {copy}/again-5.csv\n")
    assert said.count("again-5.csv") == 1
    assert "again-6.csv" in said
    assert "trial-02.gcode" not in call("drop", copy, 0).split("print ")[1]
    again = simulate(copy, "--seed", 7)  # the trial that `next` takes it for, not the last one without a measurement
    assert "trial 0 on linear" in again


def test_one_command_at_a_time(copy, tmp_path):
    before = (copy / "session.json").read_bytes()
    with held(copy):
        for words in (
            ("next", copy, "--measured", copy / "trial-00.csv", "--trial", 0), ("drop", copy, 0), ("status", copy),
        ):  # fmt: skip
            assert "another command works on" in call(*words, error=UsageError)
        call("finish", copy, "-o", tmp_path / "l.npz")  # only reads
    assert (copy / "session.json").read_bytes() == before


def test_a_number_stands_for_the_same_signal_for_ever(copy):
    simulate(copy, "--trial", 0, "--seed", 5, "-o", copy / "again.csv")
    planned = {one.number: one.u.tolist() for one in load(copy).trials}
    for words in (("next", copy, "--trial", 0, "--measured", copy / "again.csv"), ("drop", copy, 1), ("drop", copy, 0)):
        call(*words)
        now = {one.number: one.u.tolist() for one in load(copy).trials}
        assert planned.items() <= now.items()
        assert all((copy / f"trial-{number:02}.gcode").exists() for number in now)
        planned = now


def test_a_begin_that_cannot_be_read_says_which_line_of_it(tmp_path):
    begin = tmp_path / "begin.gcode"
    begin.write_text("G28\nG1 X1.2.3\n")
    said = call("start", tmp_path / "s", "--machine", "syringe", "--material", "x", "--begin", begin, error=InputError)
    assert "begin.gcode:line 2: `G1 X1.2.3`" in said
    assert not (tmp_path / "s").exists()


def test_every_form_of_measurement_gives_the_same_flow(tmp_path):
    rms = []
    for number, form in enumerate(("t,q", "s,area", "s,width")):
        folder = tmp_path / str(number)
        start(folder)
        call("simulate", folder, "--plant", "linear", "--as", form)
        facts = json.loads(call("next", folder, "--measured", folder / "trial-00.csv", "--json"))
        assert facts["waiting"] == "trial-01.gcode"
        rms.append(facts["trials"][0]["rms"])
    routine = load(folder).setup.routine
    lagging = Model(1.0, 1.0).predict(routine.q_ref, routine.dt)
    assert rms == pytest.approx([float(np.sqrt(np.mean((routine.q_ref - lagging) ** 2)))] * 3, rel=0.02)


def test_what_is_wrong_leaves_the_session_as_it_was(copy):
    before = files(copy)
    good = (copy / "trial-01.csv").read_text().splitlines()
    bad = {
        "empty.csv": ("", "is empty"),
        "swapped.csv": ("\n".join(["area,s", *good[1:]]), "swapped"),
        "minutes.csv": ("\n".join(["s [mm],area [mm]", *good[1:]]), "gives area in 'mm', which is not known"),
        "half.csv": ("\n".join(good[: len(good) // 2]), "measure the rest"),
        "back.csv": ("\n".join([*good[:300], *good[100:]]), "the place goes back"),
        "sixty.csv": ("\n".join([good[0], *(f"{a},{60 * float(b)}" for a, b in (x.split(",") for x in good[1:]))]),
                      "it looks like mm^3/min"),
        "again.csv": ("\n".join(good), "trial 1's measurement"),
    }  # fmt: skip
    for name, (text, said) in bad.items():
        path = copy.parent / name
        path.write_text(text)
        message = call("next", copy, "--trial", 1, "--measured", path, error=InputError)
        assert said in message
        assert name in message
    assert "say what was measured" in call("next", copy, error=UsageError)
    assert "there is no trial 9" in call("next", copy, "--trial", 9, "--measured", copy / "trial-01.csv",
                                         error=UsageError)  # fmt: skip
    assert files(copy) == before


def test_a_machine_or_a_guess_that_is_not_there(tmp_path):
    words = ("--machine", "toaster", "--material", "m")
    assert "no machine" in call("start", tmp_path / "s", *words, error=UsageError)
    words = ("--machine", "syringe", "--material", "m", "--begin", tmp_path / "none.gcode")
    assert "cannot be read" in call("start", tmp_path / "s", *words, error=InputError)
    assert not (tmp_path / "s").exists()


def test_an_extruder_that_gets_worse_stores_nothing(tmp_path):
    folder, plant = tmp_path / "s", tmp_path / "mine.py"
    plant.write_text(
        "import numpy as np\nclass Same:\n    def initial(self):\n        return np.zeros(1)\n"
        "    def run(self, state, u, dt):\n        return state, np.full(len(u), 2.0) + 0.2 * u\n"
    )
    start(folder)
    call("simulate", folder, "--plant", f"{plant}:Same")
    call("next", folder, "--measured", folder / "trial-00.csv", "--anyway")
    assert "nothing to store" in call("finish", folder, "-o", tmp_path / "l.npz", error=UnsafeError)
    assert not (tmp_path / "l.npz").exists()


def test_a_crash_between_any_two_writes_is_mended_by_calling_again(copy, monkeypatch):
    """The third trial is measured; the disk is full at every write in turn."""
    call("drop", copy, 1)
    simulate(copy, "--seed", 3)
    measured = copy / "trial-02.csv"
    before = (copy / "session.json").read_bytes()

    def full(*_words):
        raise OSError(28, "No space left on device")

    for module, name in ((common, "write_whole"), (record, "save")):
        with monkeypatch.context() as broken:
            broken.setattr(module, name, full)
            call("next", copy, "--measured", measured, error=OSError)
        assert (copy / "session.json").read_bytes() == before
    call("next", copy, "--measured", measured)
    once = files(copy)
    call("status", copy)
    assert files(copy) == once
    facts = json.loads(call("status", copy, "--json"))
    assert [one["number"] for one in facts["trials"]] == [0, 2]


def test_a_session_by_photographs(tmp_path):
    folder = tmp_path / "s"
    start(folder)
    assert (folder / "sheet.svg").read_text().startswith("<svg")
    told = call("simulate", folder, "--plant", "linear", "--as", "photo", "--weigh", 0.001, "--density", 1.5)
    grams = told.split("--weighed ")[1].split()[0]
    said = call("next", folder, "--images", folder / "trial-00.jpg", "--weighed", grams, "--density", 1.5)
    assert "trial-00.seen.jpg: see whether" in said
    facts = json.loads(call("status", folder, "--json"))
    (seen,) = facts["trials"]
    call("simulate", folder, "--plant", "linear", "--as", "t,q", "--trial", 0, "-o", tmp_path / "exact.csv")
    other = tmp_path / "other"
    start(other)
    call("next", other, "--measured", tmp_path / "exact.csv")
    exact, photographed, weighed = load(other).trials[0].q, load(folder).trials[0].q, counted(load(folder))[0].q
    off = float(np.sqrt(np.mean((photographed - exact) ** 2)))
    assert off < 0.1 * 5.0  # one photograph: 5 % in the median
    assert np.sqrt(np.mean((weighed - exact) ** 2)) < off
    assert seen["weighed"][0]["offset_mm"] != 0.0
    assert load(folder).trials[0].prints[0].way == "photo"
    assert any("off the sheet" in note for note in seen["notes"])
    before = files(folder)
    (tmp_path / "none.jpg").write_bytes(b"no image")
    for path, message in ((tmp_path / "none.jpg", "not an image"), (folder / "sheet.svg", "not an image")):
        assert message in call("next", folder, "--images", path, error=InputError)
    assert files(folder) == before
