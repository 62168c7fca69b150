"""The filter where there is nothing to say: a neutral material, files done before, files of no motion."""

from __future__ import annotations

from pathlib import Path

import pytest
from filtering import FILES, NEUTRAL, OWN, filtered, needs_corpus, options
from hypothesis import given, settings
from strategies import files

from gcodectl.errors import InputError
from gcodectl.filtered import is_filtered
from gcodectl.pipeline import filter_bytes, filter_stream
from gcodectl.summary import Summary
from gcodectl.version import VERSION


def with_trailer(data: bytes) -> bytes:
    newline = b"\r\n" if b"\r\n" in data[-3000:] else b"\n"
    return data + (b"" if data.endswith(b"\n") else newline) + TRAILER.replace(b"\n", newline)


TRAILER = f"; gcodectl {VERSION}: syringe, neutral\n".encode()


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
def test_a_neutral_material_leaves_every_byte(path: Path) -> None:
    data = path.read_bytes()
    assert filtered(data, NEUTRAL) == data + TRAILER


@needs_corpus
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_neutral_material_leaves_every_byte_of_the_corpus(path: Path) -> None:
    data = path.read_bytes()
    if path.suffix == ".ngc":
        with pytest.raises(InputError, match=r"line 8: .*numbered parameters"):
            filtered(data, NEUTRAL)
        return
    assert filtered(data, NEUTRAL) == with_trailer(data)


@settings(max_examples=60)
@given(files())
def test_a_neutral_material_leaves_every_byte_of_anything(data: bytes) -> None:
    assert filtered(data, NEUTRAL) == with_trailer(data)


@pytest.mark.parametrize("how", [NEUTRAL, options("paste-a")], ids=["neutral", "paste-a"])
@pytest.mark.parametrize(
    "data",
    [b"", b"\n", b"; only\n; comments\n", b"M104 S200\r\nM73 P1\r\n", b"; caf\xe9 \xff\xfe\n", b"G28\nG1 X5 E1", b"%"],
)
def test_without_known_motion_only_the_last_line_is_ours(data: bytes, how: object) -> None:
    out = filter_bytes(data, how)
    assert out.startswith(data)
    rest = out[len(data) :].splitlines()
    assert [line for line in rest if line] == [out.splitlines()[-1]]
    assert out.splitlines()[-1].startswith(b"; gcodectl")


@pytest.mark.parametrize("size", [1 << 20, 50])
def test_a_second_run_changes_nothing(size: int) -> None:
    once = filtered(OWN[0].read_bytes())
    summary = Summary()
    chunks = [once[k : k + size] for k in range(0, len(once), size)] if size == 1 << 20 else once.splitlines(True)
    assert b"".join(filter_stream(chunks, options(), summary)) == once
    assert summary.already_filtered
    assert is_filtered(once)
    assert not is_filtered(OWN[0].read_bytes())


def test_what_a_neutral_run_left_as_it_was_may_still_be_filtered() -> None:
    data = OWN[0].read_bytes()
    summary = Summary()
    out = b"".join(filter_stream([data + TRAILER], options(), summary))
    first, last = out.splitlines(keepends=True)[-2:]
    assert out[: -len(first + last)] == filtered(data)[: -len(last)]
    assert first == TRAILER
    assert last.endswith(b": syringe, paste-a@0.84\n")
    assert not summary.already_filtered
    assert filtered(out) == out


def test_a_comment_that_only_speaks_of_us_is_no_mark() -> None:
    data = b"; gcodectl filter is run on this\n" + OWN[0].read_bytes()
    assert filtered(data).endswith(filtered(OWN[0].read_bytes())[-2000:])
    assert not is_filtered(b"G1 X1\n; gcodectl is good\n")
