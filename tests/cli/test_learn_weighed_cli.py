"""A session whose prints are weighed, as a person goes through it; the printer and the scale are simulated."""

from __future__ import annotations

import json
import re

import pytest
from learning import call

from gcodectl.errors import InputError, UsageError
from gcodectl.flow.library import load_library
from gcodectl.session.record import load

DENSITY = 1.9


def weighed_print(folder, *words):
    """Print the trial that waits and weigh it; return what the scale shows."""
    said = call("simulate", folder, "--plant", "linear", "--as", "s,width", "--weigh", 0.0001, *words)
    return re.search(r"; weighs ([0-9.]+) g: --weighed \1 --density 1.9$", said.strip())[1]


def wider(path, more):
    """Make every road of a table so much wider, as shadows do."""
    head, *rows = path.read_text().splitlines()
    pairs = [[float(cell) for cell in row.split(",")] for row in rows]
    path.write_text("\n".join([head, *(f"{s},{w + more if w > 0 else 0.0}" for s, w in pairs)]))


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    """A session whose first print, seen 0.05 mm too wide, was weighed; and what was said."""
    folder = tmp_path_factory.mktemp("weighed") / "s"
    told = [call("start", folder, "--machine", "syringe", "--material", "clay", "--flow", 5, "--date", "2026-01-02")]
    grams = weighed_print(folder, "--density", DENSITY)
    wider(folder / "trial-00.csv", 0.05)
    words = ("next", folder, "--measured", folder / "trial-00.csv", "--weighed", grams)
    told.append(call(*words, error=UsageError))
    told.append(call(*words, "--density", DENSITY))
    return folder, told, grams


@pytest.fixture
def copy(one, tmp_path):
    for path in one[0].iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def test_the_start_says_which_scale_will_do(one):
    assert "It lays about 0.15 cm^3. Weighed, all of it, with a scale that reads 0.001 g" in one[1][0]
    assert "--weighed GRAMS --density" in one[1][0]
    assert "Weighed, all of it" not in one[1][2]  # once is enough said


def test_the_density_is_asked_for_once(one):
    assert "--weighed needs the density once" in one[1][1]
    assert load(one[0]).setup.density == DENSITY


def test_what_a_weight_changes_is_said_by_every_command(one, copy, tmp_path):
    folder, told, grams = one
    line = re.search(r"weighs ([0-9.]+) g: widths (-[0-9.]+) \+- ([0-9.]+) mm", told[2])
    assert line is not None
    assert (line[1], float(line[2])) == (f"{float(grams):g}", pytest.approx(-0.05, abs=0.003))
    assert line[0] in call("status", folder)
    grams = weighed_print(copy, "--seed", 3)  # the session knows the density
    wider(copy / "trial-01.csv", 0.05)
    facts = json.loads(call("next", copy, "--measured", copy / "trial-01.csv", "--weighed", grams, "--json"))
    by = [trial["weighed"] for trial in facts["trials"]]
    assert [[one["own"] for one in each] for each in by] == [[True], [True]]
    assert by[1][0]["offset_mm"] == pytest.approx(-0.05, abs=0.003)
    assert 0.0 < by[1][0]["standard_error"] < 0.02
    assert by[1][0]["grams"] == float(grams)
    (table,) = facts["weighed"]
    assert (table["weighed"], table["corrected"], table["density"]) == (2, 2, DENSITY)
    path = tmp_path / "clay.npz"
    said = call("finish", copy, "-o", path)
    assert "weighed: 2 of 2 prints (s,width) at 1.9 g/cm^3: -0.05" in said
    assert "if the density is" in said
    made = load_library(path).sets[0]
    assert made.training["weighed"] == [table]
    assert made.model.steady_rate(5.0) == pytest.approx(5.0, rel=0.015)  # a linear plant of gain 1, seen too wide


def test_a_print_that_was_not_weighed_is_corrected_too(copy):
    call("simulate", copy, "--plant", "linear", "--as", "s,width")
    wider(copy / "trial-01.csv", 0.05)
    said = call("next", copy, "--measured", copy / "trial-01.csv")
    assert re.search(r"not weighed, as those that were: widths -0\.0(49|50|51)", said)
    facts = json.loads(call("status", copy, "--json"))
    assert facts["trials"][1]["weighed"][0]["own"] is False
    assert facts["trials"][1]["weighed"][0]["grams"] is None


def test_a_print_that_was_measured_in_another_way_is_said_to_be_as_measured(copy):
    call("simulate", copy, "--plant", "linear", "--as", "s,area")
    said = call("next", copy, "--measured", copy / "trial-01.csv")
    assert "as measured: of prints that were measured so (s,area), none was weighed" in said
    facts = json.loads(call("status", copy, "--json"))
    assert facts["trials"][1]["weighed"] == [None]


def test_what_is_wrong_with_a_weight_leaves_the_session_as_it_was(copy):
    grams = weighed_print(copy)
    measured = copy / "trial-01.csv"
    before = (copy / "session.json").read_bytes()
    words = ("next", copy, "--measured", measured)
    assert "--weighed goes with the measurement of the same print" in call(
        "next", copy, "--weighed", grams, error=UsageError
    )
    assert "it looks like mg" in call(*words, "--weighed", 1000 * float(grams), error=InputError)
    assert "and before it dries" in call(*words, "--weighed", f"{0.7 * float(grams):.4f}", error=InputError)
    assert "which says less than the measurement" in call(*words, "--weighed", "0.3", error=InputError)
    assert "give grams as the scale shows them" in call(*words, "--weighed", "much", error=UsageError)
    assert "2 times for 1 prints" in call(*words, "--weighed", grams, "--weighed", grams, error=UsageError)
    assert "it must be a positive number" in call(*words, "--weighed", grams, "--density", 0, error=UsageError)
    assert (copy / "session.json").read_bytes() == before
    facts = json.loads(call(*words, "--weighed", f"{0.7 * float(grams):.4f}", "--anyway", "--json"))
    assert "weight: weighs" in facts["trials"][1]["faults"][0]


def test_a_simulated_scale_needs_a_density(tmp_path):
    folder = tmp_path / "s"
    call("start", folder, "--machine", "syringe", "--material", "clay", "--flow", 5)
    said = call("simulate", folder, "--plant", "linear", "--weigh", 0.001, error=UsageError)
    assert "--weigh needs --density" in said
    said = call("simulate", folder, "--plant", "linear", "--weigh", -1, "--density", 1, error=UsageError)
    assert "the scale's readability is -1" in said
    said = call("simulate", folder, "--plant", "linear", "--weigh", 0.001, "--density", -2, error=UsageError)
    assert "the scale's density is -2" in said
    assert not list(folder.glob("*.csv"))  # nor is anything written that the session does not call simulated
