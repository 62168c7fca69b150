from __future__ import annotations

import io
import json
import sys
from types import SimpleNamespace

import pytest
import typer
from typer.testing import CliRunner

from gcodectl.cli import learn, learn_run, library
from gcodectl.errors import InputError, UnsafeError, UsageError
from gcodectl.flow.library import load_library

app = typer.Typer()
app.add_typer(learn.app, name="learn")
app.add_typer(library.app, name="library")

PLANT = """
import numpy as np
class Lazy:
    def initial(self):
        return np.zeros(1)
    def run(self, state, u, dt):
        q, x = np.empty(len(u)), float(state[0])
        for k, now in enumerate(u):
            x += (now - x) * dt / 0.3
            q[k] = x
        return np.array([x]), q
class Fickle(Lazy):
    # from trial to trial it gives twice as much, some of it at random; in the step experiment it is as it should be
    trials = 0
    def run(self, state, u, dt):
        state, q = super().run(state, u, dt)
        if len(u) > 2000:
            Fickle.trials += 1
            noise = np.random.default_rng(Fickle.trials).normal(size=len(u) // 100 + 1).repeat(100)[: len(u)]
            q = (q + 5.0 * np.abs(noise)) * 2.0 ** Fickle.trials
        return state, q
class Blocked(Lazy):
    def run(self, state, u, dt):
        return state, np.zeros(len(u))
"""


def call(*words, ok=True):
    result = CliRunner().invoke(app, [str(word) for word in words])
    if ok and result.exception:
        raise result.exception
    return result


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    path = tmp_path_factory.mktemp("learned") / "lib.npz"
    words = ("--plant", "paste-a", "--material", "paste-a", "--nozzle", 0.84, "--date", "2026-01-02")
    result = call("learn", "run", *words, "-o", path)
    return path, result


def test_learning_prints_the_check_the_errors_and_why_it_stopped(learned):
    path, result = learned
    assert "converges" in result.stderr
    assert "gain 1.08" in result.stderr
    assert "settled" in result.stderr
    assert "settled" not in result.stdout
    rows = [line.split() for line in result.stdout.splitlines()[1:-1]]
    assert [int(row[0]) for row in rows] == list(range(len(rows)))
    assert min(float(row[2]) for row in rows) < 0.3  # what a lag of 2.7 s leaves under the plunger's cap
    assert len(rows) <= 9
    assert "paste-a@0.84 stored" in result.stdout
    made = load_library(path).sets[0].training
    assert made["date"] == "2026-01-02"
    assert made["plant"] == "paste-a"
    assert made["versions"]["gcodectl"]


def test_json_is_one_object_on_stdout_and_sets_are_added_or_replaced(learned, tmp_path):
    path = tmp_path / "lib.npz"
    path.write_bytes(learned[0].read_bytes())
    plant = tmp_path / "mine.py"
    plant.write_text(PLANT)
    words = ("learn", "run", "--plant", f"{plant}:Lazy", "--trials", 3, "-o", path, "--json", "--flow", 4)
    result = call(*words, "--material", "mine")
    record = json.loads(result.stdout)
    assert 1 < record["trials"] <= 3
    assert record["stop"] in ("trials", "settled")
    assert record["flow_model"]["serves"]
    assert [one.key for one in load_library(path).sets] == ["paste-a@0.84", "mine@0.84"]
    call(*words, "--material", "paste-a")
    sets = load_library(path).sets
    assert [one.key for one in sets] == ["paste-a@0.84", "mine@0.84"]
    assert sets[0].flow == 4.0


def test_noise_is_seeded(tmp_path):
    def rms(seed):
        words = ("--trials", 2, "--material", "m", "--noise", 0.2, "--seed", seed, "--json", "-o", tmp_path / "n.npz")
        return json.loads(call("learn", "run", "--plant", "linear", *words).stdout)["rms"]

    assert rms(1) == rms(1)
    assert rms(1) != rms(2)


def test_what_cannot_be_learned_says_so_and_leaves_no_file(tmp_path):
    plant, path = tmp_path / "mine.py", tmp_path / "lib.npz"
    plant.write_text(PLANT)
    for words, error, said in (
        (("--plant", f"{plant}:Blocked"), InputError, "does not follow"),
        (("--plant", "nothing"), UsageError, "no plant 'nothing'"),
        (("--plant", "paste-a", "--flow", 0), UsageError, "positive"),
        (("--plant", "paste-a", "--machine", "toaster"), UsageError, "no machine"),
    ):
        result = call("learn", "run", *words, "--material", "m", "-o", path, ok=False)
        assert isinstance(result.exception, error)
        assert said in str(result.exception)
    assert not path.exists()


def test_what_only_diverges_is_refused_and_not_stored(tmp_path):
    plant, path = tmp_path / "mine.py", tmp_path / "lib.npz"
    plant.write_text(PLANT)
    result = call("learn", "run", "--plant", f"{plant}:Fickle", "--material", "m", "-o", path, ok=False)
    assert isinstance(result.exception, UnsafeError)
    assert "no trial was better than the first" in str(result.exception)
    assert not path.exists()


def test_progress_is_a_bar_on_a_terminal_only(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    trial = SimpleNamespace(rms=0.5)
    for stream, shown in ((Terminal(), True), (io.StringIO(), False)):
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setenv("TERM", "xterm")
        with learn_run._progress(2) as show:
            show(trial)
        assert ("learning" in stream.getvalue()) is shown


def test_a_file_that_is_no_library_fails_before_learning(tmp_path):
    path = tmp_path / "lib.npz"
    path.write_bytes(b"G28\n")
    result = call("learn", "run", "--plant", "paste-a", "--material", "m", "-o", path, ok=False)
    assert isinstance(result.exception, InputError)
    assert result.stderr == ""
    assert path.read_bytes() == b"G28\n"


def test_list_names_every_set(learned):
    assert "paste-b@0.84" in call("library", "list").stdout
    assert "paste-a@0.84" in call("library", "list", learned[0]).stdout
    facts = json.loads(call("library", "list", learned[0], "--json").stdout)
    assert facts[0]["signals"]["Corner"]["dip"] == pytest.approx(0.22, abs=0.01)


def test_show_prints_facts_and_a_picture(learned, tmp_path):
    picture = tmp_path / "set.png"
    result = call("library", "show", "paste-a", "--library", learned[0], "--plot", picture)
    assert "lead s" in result.stdout
    assert "*****" in result.stdout
    assert "plant: paste-a" in result.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert json.loads(call("library", "show", "paste-b", "--json").stdout)["material"] == "paste-b"


@pytest.mark.parametrize("form", ["json", "csv"])
def test_export_and_import_give_the_same_library(learned, tmp_path, form):
    text, again = tmp_path / f"sets.{form}", tmp_path / "again.npz"
    assert "1 set written" in call("library", "export", "paste-a", "--library", learned[0], "-o", text).stderr
    call("library", "import", text, "-o", again)
    assert again.read_bytes() == learned[0].read_bytes()
    call("library", "import", text, "-o", again)
    assert again.read_bytes() == learned[0].read_bytes()


def test_export_writes_to_standard_output_and_knows_its_materials(learned):
    assert json.loads(call("library", "export", "--library", learned[0]).stdout)["sets"][0]["material"] == "paste-a"
    assert call("library", "export", "paste-a", "--csv").stdout.startswith("# gcodectl-library 1 ")
    assert isinstance(call("library", "export", "zoo", ok=False).exception, UsageError)


def test_import_of_something_else_is_an_input_error(tmp_path):
    library = tmp_path / "l.npz"
    for name, data in (("a.json", b"{}"), ("a.csv", b"x"), ("b.json", b"\xff\xfe"), ("none.json", None)):
        if data is not None:
            (tmp_path / name).write_bytes(data)
        result = call("library", "import", tmp_path / name, "-o", library, ok=False)
        assert isinstance(result.exception, InputError)
        assert name in str(result.exception)
    assert not library.exists()
