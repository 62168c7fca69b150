"""Heat profiles and scenes: read and written, and what is wrong with them said."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from gcodectl.errors import UsageError
from gcodectl.thermal.profile import Corner, HeatProfile, load_profile, profile_text
from gcodectl.thermal.scene import Scene, load_scene, scene_text
from gcodectl.thermal.surface import Band, Head

FULL = HeatProfile(
    b0=1.007, b1=-0.01003, band=Band(110.0, 130.0, 151.5, 20.0, 240.0), sigma=0.7, corner=Corner(0.9, -0.009, 40.0),
    at=np.array([[0.0, 1.5, 1.1, -0.0101], [9.0, 1.5, 1.0, -0.0099]]), head=Head(5.0, 90.0, 300.0), time=2.0, alpha=0.1,
    bead=7.5,
)  # fmt: skip


def same(one: HeatProfile, other: HeatProfile) -> bool:
    return np.array_equal(one.at, other.at) and all(
        getattr(one, field.name) == getattr(other, field.name)
        for field in dataclasses.fields(HeatProfile)
        if field.name not in ("at", "name")
    )


@pytest.mark.parametrize("profile", [FULL, HeatProfile(b0=1.0, b1=-0.01)])
def test_a_profile_reads_back_as_it_was_written(profile: HeatProfile, tmp_path: Path) -> None:
    path = tmp_path / "heat.toml"
    path.write_text(profile_text(profile, "made for a test\nof two lines"))
    assert same(load_profile(path), profile)


def test_the_hottest_is_the_band_less_what_is_not_known() -> None:
    assert dataclasses.replace(FULL, sigma=0.0).hottest == 151.5
    assert dataclasses.replace(FULL, sigma=2.0, alpha=0.05).hottest == pytest.approx(151.5 - 3.29, abs=0.01)


COOLING = "[cooling]\nb0 = 1.0\nb1 = -0.01\n"
WRONG = {
    "no b1": ("[cooling]\nb0 = 1.0\n", "has no b1"),
    "no section": ("bead = 4.0\n", "has no b0"),
    "nothing cools": ("[cooling]\nb0 = 1.0\nb1 = 0.01\n", "b1 must be below 0"),
    "never cool enough": ("[cooling]\nb0 = 2.0\nb1 = -0.01\n", "never cools below 224.0"),
    "a corner that never does": (COOLING + "[cooling.corner]\nb0 = 2.0\nb1 = -0.01\nreach = 9\n", "cooling.corner"),
    "half a corner": (COOLING + "[cooling.corner]\nb0 = 1.0\n", "takes b0, b1 and reach"),
    "a place that never does": (COOLING[:-1] + "\nat = [[1, 2, 2.0, -0.01]]\n", "at X1 Y2"),
    "a place nowhere": (COOLING + "at = [[nan, 2, 1.0, -0.01]]\n", "no number"),
    "places of three": (COOLING + "at = [[1, 2, 3]]\n", "four numbers"),
    "a band upside down": (COOLING + "[band]\nlow = 140.0\n", "must rise"),
    "a strange key": (COOLING + "[band]\nlowest = 140.0\n", "no 'lowest'"),
    "a strange section": (COOLING + "[nozzle]\nd = 1\n", "'nozzle'"),
    "a word": (COOLING + "[head]\nslowest = 'slow'\n", "takes a number, not 'slow'"),
    "half a head": (COOLING + "[head]\nslowest = 3\n", "slowest, fastest and accel"),
    "a head that stands": (COOLING + "[head]\nslowest = 0\nfastest = 3\naccel = 3\n", "above 0"),
    "alpha": (COOLING + "[objective]\nalpha = 0.7\n", "alpha is 0.7"),
    "too little known": (COOLING + "sigma = 20.0\n", "measure better"),
    "no section but a value": ("cooling = 3\n", "write [cooling]"),
    "no TOML": ("[cooling\n", "heat.toml"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_with_a_profile_is_said_with_file_and_key(name: str, tmp_path: Path) -> None:
    text, said = WRONG[name]
    path = tmp_path / "heat.toml"
    path.write_text(text)
    with pytest.raises(UsageError) as error:
        load_profile(path)
    assert said in str(error.value)
    assert "heat.toml" in str(error.value)


def test_a_missing_profile_is_said(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no heat profile"):
        load_profile(tmp_path / "none.toml")


SCENE = Scene(
    bead=20.0, path=np.array([[0.0, 0.0], [900.0, 0.0], [900.0, 200.0]]), emissivity=0.9, scale=0.04, offset=-273.15,
    matches=np.array([[0, 0, 10, 10], [900, 0, 500, 12], [900, 200, 480, 200], [0, 200, 40, 205.5], [450, 0, 256, 11]]),
)  # fmt: skip


def test_a_scene_reads_back_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(scene_text(SCENE))
    found = load_scene(path)
    assert np.array_equal(found.matches, SCENE.matches)
    assert np.array_equal(found.path, SCENE.path)
    assert (found.bead, found.emissivity, found.scale, found.offset) == (20.0, 0.9, 0.04, -273.15)
    assert len(found.road()) == 55


SCENES = {
    "no path": (lambda text: text.replace("path", "way"), "no such setting as 'way'"),
    "rows of three": (lambda text: text.replace("[900.0, 0.0]", "[900.0, 0.0, 1.0]"), "rows of 2"),
    "emissivity": (lambda text: text.replace("0.9\n", "1.9\n"), "emissivity is 1.9"),
    "bead": (lambda text: text.replace("bead = 20.0", "bead = 0.0"), "bead is 0"),
    "a word": (lambda text: text.replace("bead = 20.0", "bead = 'wide'"), "takes a number"),
}


@pytest.mark.parametrize("name", SCENES)
def test_what_is_wrong_with_a_scene_is_said(name: str, tmp_path: Path) -> None:
    change, said = SCENES[name]
    path = tmp_path / "scene.toml"
    path.write_text(change(scene_text(SCENE)))
    with pytest.raises(UsageError) as error:
        load_scene(path)
    assert said in str(error.value)


def test_matches_that_no_camera_sees_are_refused() -> None:
    wrong = SCENE.matches.copy()
    wrong[:, 2] = wrong[[2, 0, 4, 1, 3], 2]
    with pytest.raises(UsageError, match="no camera sees"):
        dataclasses.replace(SCENE, matches=wrong).perspective()
    with pytest.raises(UsageError, match="there is no scene"):
        load_scene(Path("none.toml"))
