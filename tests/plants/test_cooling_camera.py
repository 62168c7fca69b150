"""The simulated camera: what it reads is the surface through emissivity and noise, the head stands before it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcodectl.errors import UsageError
from gcodectl.thermal.frames import read_frames
from gcodectl.thermal.radiance import apparent
from plant_models.cooling import cooling_part
from plant_models.cooling_camera import EMISSIVITY, HEAD_TEMPERATURE, NOISE, Camera
from plant_models.recording import write_frames


def at(image, pixels):
    near = np.round(pixels).astype(int)
    return image[near[:, 1], near[:, 0]]


@pytest.fixture(scope="module")
def wall():
    part = cooling_part("wall", 2)
    part.print_layer(part.at_speed(200.0))
    return part, Camera(part)


def test_the_middle_of_the_road_reads_as_a_grey_body(wall):
    part, camera = wall
    t = 260.0
    true = part.temperatures(t)
    expected = np.array([apparent(one, EMISSIVITY, 24.0) for one in true])
    error = (at(camera.frame(t), camera.pixels(part.points)) - expected)[1:]  # over the first lies the ring's end
    assert 0.7 * NOISE < np.std(error) < 1.5 * NOISE
    assert abs(error.mean()) < 0.3
    np.testing.assert_array_equal(camera.frame(t), Camera(part).frame(t))
    assert np.abs(camera.frame(t)[0] - camera.frame(t + 1.0)[0]).max() > NOISE  # noise anew in every frame


def test_the_head_hides_a_part_of_the_road_while_it_prints(wall):
    part, camera = wall
    t = float(part.deposited[30])
    seen = at(camera.frame(t), camera.pixels(part.points))
    cold = np.abs(seen - apparent(HEAD_TEMPERATURE, EMISSIVITY, 24.0)) < 5 * NOISE
    assert cold[30]
    assert 3 < cold.sum() < 80
    assert seen[5] > 225.0  # laid
    below = at(camera.frame(t), camera.pixels(part.points, 0))
    assert 100.0 < below[100] < 160.0  # not laid yet: the layer below is seen


def test_the_road_moves_upwards_in_the_frame_layer_by_layer(wall):
    part, camera = wall
    moved = camera.pixels(part.points, 0) - camera.pixels(part.points, 1)
    assert np.all((moved[:, 1] > 1.0) & (moved[:, 1] < 4.0))
    known, marked = camera.matches()
    assert np.abs(marked - camera.pixels(known, 0)).max() < 3.0
    assert not np.array_equal(marked, camera.pixels(known, 0))


@pytest.mark.parametrize("name", ["recorded", "recorded.tiff", "recorded.npz"])
def test_recordings_are_read_back_as_they_were(wall, tmp_path: Path, name: str):
    _, camera = wall
    frames = camera.frames(np.array([201.0, 202.5, 204.0]))
    write_frames(frames, tmp_path / name)
    back = read_frames(tmp_path / name)
    np.testing.assert_allclose(back[1], frames[1], atol=0.006)
    np.testing.assert_array_equal(back.times, [0.0, 1.0, 2.0] if name.endswith("tiff") else frames.times)
    with pytest.raises(UsageError, match=r"\.avi"):
        write_frames(frames, tmp_path / "recorded.avi")
