from pathlib import Path

import pytest

from gcodectl.errors import InputError
from gcodectl.link import journal
from gcodectl.link.job import Line, read_lines
from gcodectl.link.journal import Entry, digest, journal_path
from gcodectl.link.resume import Resumed, State


def test_a_journal_is_written_read_and_removed(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "part.json"
    entry = Entry("part.gcode", "abc", 12, 30, 1.5)
    journal.write(path, entry)
    journal.write(path, entry)
    assert journal.read(path) == entry
    assert [one.name for one in path.parent.iterdir()] == ["part.json"]
    journal.remove(path)
    journal.remove(path)
    with pytest.raises(InputError, match="nothing to resume"):
        journal.read(path)


@pytest.mark.parametrize("text", ["", "{}", '{"file": 1, "odd": 2}', "[1]"])
def test_a_journal_that_is_none_is_said(tmp_path: Path, text: str) -> None:
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"cannot be read.*remove it"):
        journal.read(path)


def test_a_journal_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "x.json").mkdir()
    (tmp_path / "x.json" / "full").touch()
    with pytest.raises(OSError, match=r"x\.json"):
        journal.write(tmp_path / "x.json", Entry("a", "b", 1, None, 0.0))
    assert [one.name for one in tmp_path.iterdir()] == ["x.json"]


def test_files_and_filterings_are_told_apart(tmp_path: Path) -> None:
    one, two = tmp_path / "a.gcode", tmp_path / "b.gcode"
    one.write_text("G28")
    two.write_text("G28")
    assert digest(one, "plain") == digest(two, "plain") != digest(one, "clay")
    assert journal_path(one, {"XDG_STATE_HOME": "/s"}) != journal_path(two, {"XDG_STATE_HOME": "/s"})
    assert journal_path(one, {"XDG_STATE_HOME": "/s"}).parent == Path("/s/gcodectl")
    assert journal_path(one, {}).is_relative_to(Path.home())


PART = b"""M140 S60
M104 S200
M190 S60
M109 S205
G28
G21
G90
T1
G92 E0
M204 S500
M106 S99
G1 X10 Y20 Z0.3 F1200
G1 X20 E1.5
G91 ; E too, as Marlin has it
G1 Z1 F600
G90
M107
G1 Y30 E3.5
G1 X0 E3
"""


def state_after(lines: list[Line], last: int) -> State:
    state = State()
    for line in lines:
        if line.source <= last:
            state.take(line.command)
    return state


def test_the_state_before_the_next_line_is_brought_back() -> None:
    lines = list(read_lines([PART]))
    state = state_after(lines, 18)
    assert state.lines(pulled=2.0) == [
        b"T1", b"M190 S60", b"M109 S205", b"M83", b"G1 E2.0000 F300", b"G21", b"G90",
        b"G0 X20.0000 Y30.0000 Z1.3000", b"G1 F600", b"G92 E3.50000", b"M204 S500", b"M107", b"G90", b"M82",
    ]  # fmt: skip


def test_absolute_e_and_inches_are_brought_back_and_an_unknown_place_is_left_alone() -> None:
    state = state_after(
        [Line(1, b"G20"), Line(2, b"G1 Z.5 E2"), Line(3, b"G1 E2.5"), Line(4, b"G91"), Line(5, b"M82")], 5
    )
    assert state.lines() == [b"G20", b"G90", b"G0 Z0.5000", b"G92 E2.50000", b"G91", b"M82"]
    homed = state_after([Line(1, b"G1 X1 Y1 Z1"), Line(2, b"G28 X"), Line(3, b"M104 T1 S180"), Line(4, b"M141 S40")], 4)
    assert homed.lines()[:4] == [b"M109 T1 S180", b"M191 S40", b"G21", b"G90"]
    assert b"G0 Y1.0000 Z1.0000" in homed.lines()


def test_a_resumed_job_is_the_state_and_the_rest_and_knows_what_it_owes() -> None:
    lines = [*read_lines([PART])]
    resumed = Resumed([lines[0], None, *lines[1:]], 12, 2.0)
    given, owed = [], []
    for line in resumed:
        owed.append(resumed.owed)
        given.append(line)
    assert given[0] is None
    commands = [line.command for line in given if line]
    push = commands.index(b"G1 E2.0000 F300")
    assert [line.source for line in given if line][: push + 1] == [12] * (push + 1)
    assert commands[-len(lines[12:]) :] == [one.command for one in lines[12:]]
    assert owed[: push + 2] == [2.0] * (push + 2)
    assert set(owed[push + 2 :]) == {0.0}
    assert list(Resumed(lines, 100, 0.0)) == []
