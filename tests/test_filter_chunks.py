"""The filter as a stream: any chunking gives the same bytes, lines leave in time, and kernels are plain Python too."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from filtering import DATA, OWN, filtered, options

from gcodectl.pipeline import filter_stream

SMALL = "G21\nG90\nM82\nG92 E0\nG1 X0 Y0 Z0.6 F600\nG1 X6 E0.01415 ; a\nG3 X6 Y4 J2 E0.029\nG1 X20 F2400\nG4 P100\n"


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
@pytest.mark.parametrize("size", [7, 900])
def test_any_chunking_gives_the_same_bytes(path: Path, size: int) -> None:
    data = path.read_bytes()
    data = data[: data.find(b"; filament used")] if size == 7 else data
    assert filtered(data, size=size) == filtered(data)


def test_the_papers_sequencer_may_be_cut_anywhere_too() -> None:
    data = (DATA / "arcs_rel.gcode").read_bytes()
    how = options("paste-a", sequencer="basis")
    assert filtered(data, how, size=7) == filtered(data, how)


def test_lines_leave_a_bounded_time_behind() -> None:
    lines = (DATA / "box_abs.gcode").read_bytes().splitlines(keepends=True)[:150] * 3
    given = 0

    def feed():  # type: ignore[no-untyped-def]
        nonlocal given
        for line in lines:
            given += 1
            yield line

    behind, out = [], 0
    for chunk in filter_stream(feed(), options()):
        out += sum(line in lines for line in chunk.splitlines(keepends=True) if line.startswith(b";"))
        behind.append(given - out)
    assert max(behind[: len(behind) // 2]) < 250
    assert len(behind) > 20


def test_plain_python_writes_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = filtered(SMALL)
    names = [name for name in sys.modules if name.startswith("gcodectl.") and "learn" not in name]
    found = 0
    for name in names:
        for key, value in list(vars(sys.modules[name]).items()):
            if hasattr(value, "py_func"):
                monkeypatch.setattr(sys.modules[name], key, value.py_func)
                found += 1
    assert found > 30
    assert filtered(SMALL) == wanted
