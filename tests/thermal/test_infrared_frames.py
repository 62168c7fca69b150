"""Frames: every form they come in, and every way in which they cannot be used, said with the frame's name."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from gcodectl.errors import InputError, UsageError
from gcodectl.thermal.frames import Frames, read_frames
from gcodectl.thermal.radiance import apparent, corrected

WARM = np.full((12, 16), 24.0, dtype=np.float32)
WARM[4:8, 4:8] = 180.0


def counts(image, scale=0.01, offset=-273.15):
    return np.round((image - offset) / scale).astype(np.uint16)


def folder(path: Path, images) -> Path:
    path.mkdir()
    for number, image in enumerate(images):
        cv2.imwrite(str(path / f"f{number}.png"), image)
    return path


def stack(images, times=None) -> Frames:
    when = np.arange(len(images), dtype=float) if times is None else np.asarray(times, dtype=float)
    return Frames(when, tuple(f"frame {k}" for k in range(len(images))), lambda k: images[k])


def test_sixteen_bits_are_centikelvin_unless_said_otherwise(tmp_path: Path):
    there = folder(tmp_path / "a", [counts(WARM)] * 2)
    np.testing.assert_allclose(read_frames(there)[1], WARM, atol=0.006)
    other = folder(tmp_path / "b", [counts(WARM, 0.04)])
    with pytest.raises(
        InputError, match=r"f0\.png: it would be -199 .* perhaps K / 0\.04 \(scale 0\.04, offset -273\.15\)"
    ):
        read_frames(other)
    np.testing.assert_allclose(read_frames(other, scale=0.04, offset=-273.15)[0], WARM, atol=0.021)
    with pytest.raises(UsageError, match="both numbers"):
        read_frames(other, scale=0.04)
    with pytest.raises(InputError, match=r"taken for centi-kelvin: say which scale and offset they have$"):
        read_frames(folder(tmp_path / "c", [np.array([[9, 60000]], np.uint16)]))


def test_floats_are_degrees(tmp_path: Path):
    path = tmp_path / "one.tiff"
    cv2.imwritemulti(str(path), [WARM, WARM + 1.0])
    frames = read_frames(path)
    assert len(frames) == 2
    np.testing.assert_array_equal(frames[1], WARM + 1.0)
    np.savez(tmp_path / "k.npz", frames=np.stack([7 * WARM + 1856.0]))
    with pytest.raises(
        InputError, match=r"frame 0: .*2024 to 3116 degC; floats are taken for degC: .* perhaps degC x 100"
    ):
        read_frames(tmp_path / "k.npz")


def test_times(tmp_path: Path):
    there = folder(tmp_path / "a", [counts(WARM)] * 3)
    np.testing.assert_array_equal(read_frames(there).times, [0, 1, 2])
    (there / "times.txt").write_text("5\n6.5\n7\n")
    np.testing.assert_array_equal(read_frames(there).times, [5, 6.5, 7])
    (there / "times.txt").write_text("5\n6.5\n6\n")
    with pytest.raises(InputError, match=r"f2\.png: its time is 6 s after 6\.5 s: times must rise"):
        read_frames(there)
    (there / "times.txt").write_text("5\nsix\n7\n")
    with pytest.raises(InputError, match=r"times\.txt:line 2: `six`"):
        read_frames(there)
    (there / "times.txt").write_text("5\n6\n")
    with pytest.raises(InputError, match="3 frames, but 2 times"):
        read_frames(there)
    with pytest.raises(InputError, match="frame 1: its time is nan"):
        stack([WARM, WARM], [0.0, np.nan])


def test_frames_of_another_size_are_named():
    frames = stack([WARM, WARM, WARM[:, :8]])
    frames[0]
    with pytest.raises(InputError, match="frame 2: it is 8 x 12 pixels, the frames before 16 x 12"):
        frames[2]
    assert len(frames.part(slice(1, 3))) == 2
    with pytest.raises(InputError, match="frame 2"):
        frames.part(slice(1, 3))[1]


def test_few_missing_pixels_are_filled_and_counted_many_refused():
    holes = np.tile(WARM, (3, 3))
    holes[5, 5], holes[20, 1] = np.nan, np.inf
    frames = stack([holes])
    assert frames[0][5, 5] == pytest.approx(180.0)
    assert frames[0][20, 1] == pytest.approx(24.0, abs=80.0)
    assert frames.mended == {"frame 0": 2}
    holes[:12] = np.nan
    with pytest.raises(InputError, match=r"frame 0: 577 of 1728 pixels \(33\.4 %\) are no numbers"):
        stack([holes])[0]


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.png", b"", "cannot be read as an image"),
        ("a.png", b"\x89PNG\r\n\x1a\nbroken", "cannot be read as an image"),
        ("a.tiff", b"II*\0broken", "cannot be read as an image"),
        ("a.npz", b"PK broken", "cannot be read as NPZ"),
        ("a.npz", b"", "cannot be read as NPZ"),
    ],
)
def test_what_is_damaged_is_named(tmp_path: Path, name: str, data: bytes, message: str):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=f"{name}: .*{message}"):
        read_frames(tmp_path / name)


def test_what_is_no_recording(tmp_path: Path):
    with pytest.raises(InputError, match=r"nowhere: there is no such file"):
        read_frames(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no file ends in \.png"):
        read_frames(tmp_path / "empty")
    np.savez(tmp_path / "x.npz", images=np.zeros((2, 3, 4)))
    with pytest.raises(InputError, match="no array `frames`, only images"):
        read_frames(tmp_path / "x.npz")
    np.savez(tmp_path / "y.npz", frames=np.zeros((3, 4)))
    with pytest.raises(InputError, match=r"must be \[frames, height, width\]"):
        read_frames(tmp_path / "y.npz")
    np.savez(tmp_path / "z.npz", frames=np.zeros((0, 3, 4)))
    with pytest.raises(InputError, match="no frame to read"):
        read_frames(tmp_path / "z.npz")
    colour = np.repeat(WARM[:, :, None].astype(np.uint8), 3, axis=2)
    with pytest.raises(InputError, match="colours are no temperatures"):
        read_frames(folder(tmp_path / "colour", [colour]))
    with pytest.raises(InputError, match="8 bits a pixel"):
        read_frames(folder(tmp_path / "grey", [WARM.astype(np.uint8)]))


def test_emissivity_is_there_and_back():
    for true in (24.0, 120.0, 250.0):
        assert corrected(np.array(apparent(true, 0.9, 24.0)), 0.9, 24.0) == pytest.approx(true)
        assert apparent(true, 1.0, 24.0) == pytest.approx(true)
    assert 234.0 < apparent(250.0, 0.9, 24.0) < 240.0
    with pytest.raises(UsageError, match="CF/PC has"):
        apparent(100.0, 90.0, 24.0)
