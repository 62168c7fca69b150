"""`gcodectl thermal`, and `--thermal` of the other commands, run as a user runs them."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from heating import rings

from gcodectl.cli import main
from gcodectl.thermal.profile import load_profile
from gcodectl.thermal.scene import Scene, load_scene, scene_text
from plant_models.cooling import cooling_part
from plant_models.cooling_camera import EMISSIVITY, Camera

Run = Callable[..., tuple[int, str, str]]
PNG = b"\x89PNG"
HEAT = "bead = 20.0\n[cooling]\nb0 = 1.007\nb1 = -0.01003\n[head]\nslowest = 100\nfastest = 400\naccel = 200\n"
MACHINE = (
    'dialect = "klipper"\nbarrel_diameter = 20\nnozzle = 14.0\nmax_speed = [400, 400, 20]\naccel = 200\n'
    "travel_accel = 500\ncorner_speed = 8\nmax_flow = 200000\nmax_flow_slew = 1000000\nmax_bead = 1000000\n"
    "e_longest = 1000000000\ne_max_speed = 100000\ne_max_accel = 1000000\n"
)


@pytest.fixture
def gcodectl(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gcodectl", *map(str, words)])
        capfd.readouterr()
        status: object = 0
        try:
            main.run()
        except SystemExit as end:
            status = end.code or 0
        assert isinstance(status, int)
        return status, *capfd.readouterr()

    return run


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recording of two layers of the wall, a minute each, its scene, and what is true of the second."""
    folder = tmp_path_factory.mktemp("recorded")
    part = cooling_part("wall", 1)
    camera = Camera(part)
    xy, px = camera.matches()
    ring = np.array([*part.setting.outline, part.setting.outline[0]])
    scene = Scene(part.setting.bead, ring, np.column_stack([xy, px]).round(2), EMISSIVITY)
    (folder / "scene.toml").write_text(scene_text(scene))
    times = np.arange(60.0)
    images = [camera.frames(times)[k] for k in range(60)]
    part.print_layer(part.at_speed(60.0))
    images += [camera.frames(times + 60.0)[k] for k in range(60)]
    np.savez(folder / "frames.npz", frames=np.array(images), times=np.arange(120.0))
    truth = part.truth()
    np.savez(folder / "truth.npz", s=truth.s, b0=truth.b0, b1=truth.b1)
    return folder


def test_track_finds_every_layer_and_draws_it(recorded: Path, tmp_path: Path, gcodectl: Run) -> None:
    words = ("thermal", "track", recorded / "frames.npz", "--scene", recorded / "scene.toml")
    status, out, said = gcodectl(*words, "--json", "--plot", tmp_path / "surface.png")
    assert status == 0
    found = json.loads(out)
    assert [one["layer"] for one in found["layers"]] == [0, 1]
    assert found["layers"][1]["laid_from"] == pytest.approx(61.0, abs=2.0)
    assert found["layers"][1]["laid_to"] == pytest.approx(72.0, abs=4.0)
    assert found["layers"][1]["until"] == 119.0
    assert found["layers"][1]["residual"] < 1.5
    assert (tmp_path / "surface.png").read_bytes().startswith(PNG)
    assert "wrote" in said
    status, out, _ = gcodectl(*words)
    assert out.count("layer ") == 2


def test_fit_writes_a_profile_that_foretells_the_part(recorded: Path, tmp_path: Path, gcodectl: Run) -> None:
    base = tmp_path / "base.toml"
    base.write_text(HEAT + "[objective]\ntime = 3.0\n")
    made = tmp_path / "made.toml"
    words = (recorded / "frames.npz", "--scene", recorded / "scene.toml", "-o", made, "--profile", base, "--json")
    status, out, _ = gcodectl("thermal", "fit", *words)
    assert status == 0
    profile, told = load_profile(made), json.loads(out)
    assert (profile.time, profile.head and profile.head.slowest) == (3.0, 100.0)
    assert told["sigma"] == profile.sigma < 2.0
    truth = np.load(recorded / "truth.npz")
    road = load_scene(recorded / "scene.toml").road()
    place = np.abs(profile.at[:, None, :2] - road.xy[None, :, :]).sum(axis=2).argmin(axis=1)
    wanted, found = [
        24 - b0 / b1 + (top - 24 + b0 / b1) * np.exp(b1 * 150.0)
        for b0, b1, top in (
            (
                np.interp(road.s[place], truth["s"], truth["b0"]),
                np.interp(road.s[place], truth["s"], truth["b1"]),
                250.0,
            ),
            (profile.at[:, 2], profile.at[:, 3], profile.band.deposition),
        )
    ]
    assert np.sqrt(np.mean((wanted - found) ** 2)) < 3.0, "degC, 150 s after deposition, of which 48 s were seen"


def test_fit_of_frames_without_a_layer_says_so(recorded: Path, tmp_path: Path, gcodectl: Run) -> None:
    cold = tmp_path / "cold.npz"
    np.savez(cold, frames=np.full((30, 512, 640), 25.0, dtype=np.float32), times=np.arange(30.0))
    status, _, said = gcodectl("thermal", "fit", cold, "--scene", recorded / "scene.toml", "-o", tmp_path / "made.toml")
    assert status == 3
    assert "cold.npz" in said
    assert not (tmp_path / "made.toml").exists()
    status, _, said = gcodectl("thermal", "track", tmp_path / "none", "--scene", recorded / "scene.toml")
    assert status == 3
    assert "no such file or folder" in said


@pytest.mark.parametrize("what", [(), ("--scene",)])
def test_examples_are_what_the_readers_read(what: tuple[str, ...], tmp_path: Path, gcodectl: Run) -> None:
    status, out, _ = gcodectl("thermal", "example", *what)
    assert status == 0
    path = tmp_path / "example.toml"
    path.write_text(out)
    if what:
        assert load_scene(path).bead == 20.3
    else:
        assert load_profile(path).head is None, "what is optional is a comment: it says something of another machine"
        path.write_text("".join(line.removeprefix("# ") for line in out.splitlines(keepends=True)))
        found = load_profile(path)
        assert found.corner is not None
        assert found.head is not None
        assert len(found.at) == 1


@pytest.fixture
def sliced(tmp_path: Path) -> tuple[Path, Path, Path]:
    paths = tmp_path / "part.gcode", tmp_path / "large.toml", tmp_path / "heat.toml"
    for path, text in zip(paths, (rings(3), MACHINE, HEAT), strict=True):
        path.write_text(text)
    return paths


def test_filter_says_what_it_found_beneath(sliced: tuple[Path, Path, Path], tmp_path: Path, gcodectl: Run) -> None:
    part, machine, heat = sliced
    words = ("filter", part, "-o", tmp_path / "out.gcode", "--machine", machine, "--thermal", heat)
    status, out, said = gcodectl(*words, "--json")
    assert status == 0
    found = json.loads(out)
    assert found["limited_by"]["heat beneath"] > 0
    assert found["heat"]["as_sliced"]["too_hot"] == found["heat"]["beneath"]
    assert found["heat"]["planned"]["too_hot"] == 0
    assert [one["layer"] for one in found["heat"]["layers"]] == [1, 2]
    assert (tmp_path / "out.gcode").read_text().count("G4 P") == 2
    status, _, said = gcodectl(*words)
    assert "as sliced 100.0% too hot" in said
    assert "planned   0.0% too hot" in said
    status, _, said = gcodectl("filter", part, "--machine", machine, "--thermal", tmp_path / "none.toml")
    assert status == 2
    assert "there is no heat profile" in said


def test_check_and_tasks_show_the_plan_by_heat(sliced: tuple[Path, Path, Path], gcodectl: Run) -> None:
    part, machine, heat = sliced
    plain = json.loads(gcodectl("check", part, "--machine", machine, "--json")[1])
    status, out, _ = gcodectl("check", part, "--machine", machine, "--thermal", heat, "--json")
    found = json.loads(out)
    assert status == 0
    assert "heat" not in plain
    assert plain["limited_by"]["heat beneath"] == 0 < found["limited_by"]["heat beneath"]
    assert found["time_s"] == pytest.approx(
        plain["time_s"] + found["heat"]["wait_s"] + found["heat"]["slowed_s"], rel=0.02
    )
    assert "heat: planned" in gcodectl("check", part, "--machine", machine, "--thermal", heat)[1]
    rows = json.loads(gcodectl("tasks", part, "--machine", machine, "--thermal", heat, "--json")[1])
    assert rows[-1]["t_end"] == pytest.approx(found["time_s"], rel=0.1)


def test_plan_says_when_and_how_fast_to_lay_the_next_layer(recorded: Path, tmp_path: Path, gcodectl: Run) -> None:
    heat = tmp_path / "heat.toml"
    heat.write_text("[cooling]\nb0 = 0.387\nb1 = -0.00664\n[head]\nslowest = 135\nfastest = 360\naccel = 136\n")
    words = (recorded / "frames.npz", "--scene", recorded / "scene.toml", "--profile", heat, "--json")
    status, out, _ = gcodectl("thermal", "plan", *words, "--plot", tmp_path / "plan.png")
    assert status == 0
    found = json.loads(out)
    assert found["wait"] > 30.0
    assert 120.0 <= found["coolest"] < 135.0 < found["hottest"] <= 150.0
    assert all(134.9 <= one["speed"] <= 360.1 for one in found["partitions"])
    assert found["partitions"][-1]["to"] == pytest.approx(2225.0, abs=15.0)
    assert (tmp_path / "plan.png").read_bytes().startswith(PNG)


def test_simulate_beats_the_fixed_time_by_what_it_saw(tmp_path: Path, gcodectl: Run) -> None:
    words = ("thermal", "simulate", "wall", "--layers", 5, "--seed", 3, "--json", "--plot", tmp_path / "layers.png")
    status, out, _ = gcodectl(*words)
    assert status == 0
    found = json.loads(out)["policies"]
    assert found["plan"]["layer_times"][:3] == pytest.approx([250.0] * 3, abs=0.1)
    assert found["plan"]["mean_time"] < 0.75 * found["fixed"]["mean_time"]
    assert found["plan"]["mean_cost"] < 0.2 * found["fixed"]["mean_cost"]
    assert found["plan"]["outside"] < 0.1
    assert (tmp_path / "layers.png").read_bytes().startswith(PNG)
    status, _, said = gcodectl("thermal", "simulate", "wall", "--layers", 3)
    assert status == 2, "nothing is planned yet"
    assert "4 or more" in said
    status, _, said = gcodectl("thermal", "simulate", "tower")
    assert status == 2
    assert "wall" in said
