"""Where the API key comes from, and that it stays unsaid."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcodectl.errors import InputError, UsageError
from gcodectl.link.api_key import find_key, warning

NAMES = ("MOONRAKER_API_KEY",)


def test_the_file_goes_before_the_services_own_variable_and_that_before_the_general_one(tmp_path: Path):
    file = tmp_path / "key"
    file.write_text("from-file\n")
    environment = {"MOONRAKER_API_KEY": "own", "GCODECTL_API_KEY": " general "}
    assert find_key(NAMES, file, environment) == "from-file"
    assert find_key(NAMES, None, environment) == "own"
    assert find_key(("OCTOPRINT_API_KEY",), None, environment) == "general"
    assert find_key(NAMES, None, {"MOONRAKER_API_KEY": " ", "GCODECTL_API_KEY": "general"}) == "general"
    assert find_key(NAMES, None, {}) is None


@pytest.mark.parametrize("content", [b"", b"two words", b"one\nmore", b"\xff\xfe", b"x" * 2000])
def test_what_cannot_be_a_key_is_refused_unsaid(tmp_path: Path, content: bytes):
    file = tmp_path / "key"
    file.write_bytes(content)
    with pytest.raises(UsageError, match="no API key") as caught:
        find_key(NAMES, file, {})
    assert "two" not in str(caught.value)
    assert "xx" not in str(caught.value)


def test_a_file_that_cannot_be_read(tmp_path: Path):
    with pytest.raises(InputError, match="No such file"):
        find_key(NAMES, tmp_path / "none", {})
    with pytest.raises(InputError, match="directory"):
        find_key(NAMES, tmp_path, {})


def test_a_key_open_to_others_is_warned_of(tmp_path: Path):
    file = tmp_path / "key"
    file.write_text("k")
    file.chmod(0o600)
    assert warning(file) is None
    file.chmod(0o644)
    assert "mode 644" in str(warning(file))
