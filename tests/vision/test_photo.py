"""Photographs: read as they were written; what is none is refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcodectl.errors import InputError
from gcodectl.vision.photo import SRGB, light, read_photograph, write_photograph

IMAGE = np.random.default_rng(0).integers(0, 256, (240, 320, 3)).astype(np.uint8)


def test_an_image_comes_back_as_it_was(tmp_path: Path):
    write_photograph(tmp_path / "a.png", IMAGE)
    np.testing.assert_array_equal(read_photograph(tmp_path / "a.png"), IMAGE)
    write_photograph(tmp_path / "grey.png", IMAGE[:, :, 0])
    assert read_photograph(tmp_path / "grey.png").shape == IMAGE.shape


@pytest.mark.parametrize("content", [b"", b"this is a text, not a picture\n", b"\x89PNG\r\n\x1a\n"])
def test_a_file_that_is_no_image_is_refused_by_name(tmp_path: Path, content):
    (tmp_path / "text.png").write_bytes(content)
    with pytest.raises(InputError, match=r"text\.png.*not an image"):
        read_photograph(tmp_path / "text.png")


def test_a_file_that_is_not_there_is_said_so(tmp_path: Path):
    with pytest.raises(InputError, match=r"no\.png.*no such"):
        read_photograph(tmp_path / "no.png")
    with pytest.raises(InputError, match=r"\.png, \.jpg"):
        write_photograph(tmp_path / "a.word", IMAGE)


def test_light_is_linear():
    assert SRGB[0] == 0.0
    assert SRGB[255] == pytest.approx(1.0)
    assert SRGB[188] == pytest.approx(0.5, abs=0.01)
    np.testing.assert_allclose(light(IMAGE), SRGB[IMAGE])
