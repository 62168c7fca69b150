"""The filter in every way a file may be written: E modes, units, factors, line ends; lines copied and made."""

from __future__ import annotations

import re

import numpy as np
import pytest
from filtering import DATA, HEAD, body, composed, filtered, moves_of, options
from hypothesis import given, settings
from strategies import files

from gcodectl.gcode.emit import MARK
from gcodectl.pipeline import Options
from gcodectl.records import Flag, Kind, Moves

ROAD = "G1 X12 E0.02831 ; side a\nG1 Y12 E0.02831\nG1 X20 Y12 F2400\n"


def laid(moves: Moves) -> float:
    """Volume that E moves in all, mm^3."""
    return float(np.sum(moves.e * moves.area))


def same_end(before: str, after: bytes, how: Options | None = None) -> None:
    """Both end in one place with one logical E and F, and the later has moved what was composed."""
    a, b = moves_of(before, how), moves_of(after, how)
    assert np.allclose(a.p1[-1], b.p1[-1], atol=1e-6, equal_nan=True)
    c = composed(before.encode(), how)
    stays = ~c.moves.deposits & (c.moves.end > c.moves.start)
    kept = c.moves.e[stays].sum() * c.moves.area[-1]
    assert laid(b) == pytest.approx(c.command.u.sum() * c.command.dt + kept, abs=0.05)


WRITTEN = {
    "relative": HEAD + ROAD,
    "absolute": HEAD.replace("M83", "M82\nG92 E0") + ROAD.replace("Y12 E0.02831", "Y12 E0.05662"),
    "inches": "G20\nG90\nM82\nG92 E0\nG1 X0 Y0 Z0.0236 F23.622\nG1 X0.5 E0.00119\nG1 Y0.5 E0.00238\n",
    "relative xyz": HEAD + "G91\nM83\n" + ROAD.replace("X20 Y12", "X-3"),
    "inches, relative": "G20\nG90\nM83\nG1 X0 Y0 Z0.0236 F23.622\nG91\nG1 X0.5 E0.00119\nG1 Y0.5 E0.00119\n",
    "factors": HEAD + "M220 S50\nM221 S200\n" + ROAD,
    "lower case": HEAD + ROAD.lower(),
    "no spaces": HEAD + ROAD.replace(" X", "X").replace(" E", "E"),
    "dwell": HEAD + "G1 X12 E0.02831\nG4 P400 ; think\nG1 Y12 E0.02831\n",
}


@pytest.mark.parametrize("name", WRITTEN)
def test_the_same_end_however_it_is_written(name: str) -> None:
    out = filtered(WRITTEN[name])
    assert MARK in out
    same_end(WRITTEN[name], out)
    assert len(body(out)) > len(WRITTEN[name].splitlines()) + 15


def test_the_same_part_however_it_is_written() -> None:
    absolute, relative = moves_of(filtered(WRITTEN["absolute"])), moves_of(filtered(WRITTEN["relative"]))
    assert len(absolute) == len(relative) + 1  # G92 E0
    assert absolute.p1[5:-1] == pytest.approx(relative.p1[4:-1])
    assert np.abs(np.cumsum(absolute.e)[6:-1] - np.cumsum(relative.e)[5:-1]).max() < 2.1e-5


def test_a_speed_factor_is_not_applied_twice() -> None:
    slow = [float(f) for line in body(filtered(WRITTEN["factors"])) for f in re.findall(r"X\S+.* F(\S+)", line)]
    assert max(slow) == 2400.0
    assert 600.0 in slow


def test_comments_are_kept_once_and_line_ends_are_the_files() -> None:
    text = (HEAD + ROAD + "G4 P300 ; think\n; the end").replace("\n", "\r\n")
    out = filtered(text)
    assert out.count(b"; side a") == out.count(b"; think") == 1
    lines = out.splitlines(keepends=True)
    assert b"; the end\r\n" in lines
    assert all(line.endswith(b"\r\n") for line in lines)
    same_end(text, out)


def test_what_comes_after_a_last_line_without_its_end_is_a_line_of_its_own() -> None:
    out = filtered(HEAD + ROAD + "; the end")
    assert b"; the end\n" in out.splitlines(keepends=True)
    same_end(HEAD + ROAD + "; the end", out)
    assert filtered(HEAD + "G1 X12 E0.02831").splitlines()[-1].startswith(b"; gcodectl")


def check(line: str) -> str:
    total = 0
    for byte in line.encode():
        total ^= byte
    return f"{line}*{total}"


def test_lines_with_a_checksum_stay_as_they_are() -> None:
    text = (
        HEAD + "\n".join(check(f"N{k} {line.partition(' ;')[0]}") for k, line in enumerate(ROAD.splitlines(), 1)) + "\n"
    )
    assert filtered(text).startswith(text.encode())


def test_lines_with_another_axis_stay_as_they_are() -> None:
    text = HEAD + "G1 X5 E0.0118\nG1 X6 E0.0024 A5\nG1 X12 E0.01415\n"
    out = body(filtered(text))
    assert "G1 X6 E0.0024 A5" in out
    assert moves_of("\n".join(out)).p1[-1] == pytest.approx([12, 0, 0.6])


def test_a_line_that_sets_a_mode_keeps_it() -> None:
    text = HEAD + "G1 X6 E0.01415\nG91 G1 X6 E0.01415\nM83\nG1 Y6 E0.01415\nG90 G1 X0\n"
    out = filtered(text)
    assert "G91 G1 X6 E0.01415" in body(out)
    assert moves_of(out).p1[-1] == pytest.approx([0, 6, 0.6])


RETRACTED = HEAD + "G1 X12 E0.02831\nG1 E-0.02 F120\nG1 X20 F2400\nG1 E0.02 F120\nG1 X30 E0.02359 F600\n"


def test_retracts_are_replaced_or_kept() -> None:
    replaced, kept = body(filtered(RETRACTED)), body(filtered(RETRACTED, options("paste-a", keep_retracts=True)))
    for line in ("G1 E-0.02 F120", "G1 E0.02 F120"):
        assert line not in replaced
        assert line in kept
    firmware = (DATA / "box_fwretract.gcode").read_bytes()
    assert not any(line.startswith(("G10", "G11")) for line in body(filtered(firmware)))
    out = filtered(firmware, options("paste-a", keep_retracts=True))
    assert [x for x in body(out) if x[:3] in ("G10", "G11")] == [x for x in body(firmware) if x[:3] in ("G10", "G11")]


def test_absolute_e_is_brought_back_before_a_line_that_is_copied() -> None:
    text = HEAD.replace("M83", "M82\nG92 E0") + "G1 X12 E0.02831\nG1 X20 F2400\nG1 E2.0 F120\nG1 X30 E2.02359 F600\n"
    out = body(filtered(text, options("paste-a", keep_retracts=True)))
    at = out.index("G1 E2.0 F120")
    assert out[at - 1] == "G92 E0.02831"
    same_end(text, filtered(text, options("paste-a", keep_retracts=True)), options("paste-a", keep_retracts=True))


def test_e_is_known_where_a_file_goes_from_relative_to_absolute() -> None:
    text = HEAD.replace("M83", "M83\nG92 E0") + "G1 X6 E0.01415\nM82\nG1 X8 E0.02\nG1 X9 E0.03\nG1 X9 E0.03\nG92 E0\n"
    out = filtered(text)
    same_end(text, out)
    assert max(abs(float(e)) for line in body(out) for e in re.findall(r"E(\S+)", line)) < 1.0


def test_text_with_an_e_in_it_says_nothing_of_e() -> None:
    text = WRITTEN["absolute"].replace("G1 Y12", "M117 Here E\nEXCLUDE_OBJECT_END NAME=a\nG1 Y12")
    assert not [line for line in body(filtered(text)) if line.startswith("G92") and line != "G92 E0"]


def test_a_feed_rate_is_brought_back_before_a_line_that_relies_on_it() -> None:
    text = HEAD + "G1 X12 E0.02831\nG1 X12 Y6 E0.01415 A5\nG1 Y12 E0.01415\n"
    out = body(filtered(text))
    at = out.index("G1 X12 Y6 E0.01415 A5")
    last = [f for line in out[:at] for f in re.findall(r"F(\S+)", line)][-1]
    assert last == "600"


def test_a_feed_rate_on_its_own_line_counts() -> None:
    text = HEAD + "G1 X6 E0.01415 F300\nG1 X7 E0.00236 F600\nF300\nG1 X20 E0.03\nF900\nG1 X40 E0.04\n"
    out = moves_of(filtered(text))
    on_path = out.kind == Kind.LINE
    for low, high, feed in ((7.0, 20.0, 5.0), (20.0, 40.0, 15.0)):
        part = on_path & (out.p0[:, 0] >= low) & (out.p1[:, 0] <= high) & (out.length > 0)
        assert out.feed[part].max() == pytest.approx(feed)


def test_a_file_that_asks_for_nothing_learned_has_no_mark() -> None:
    travels = HEAD + "G1 X50 F2400\nG1 Y50\n"
    assert filtered(travels).startswith(travels.encode())
    assert MARK not in filtered(travels)


@settings(max_examples=20)
@given(files(30))
def test_anything_is_still_readable_and_ends_where_it_did(data: bytes) -> None:
    how = options("paste-a", keep_retracts=True)
    before, after = moves_of(data, how), moves_of(filtered(data, how), how)
    assert np.allclose(before.p1[-1], after.p1[-1], atol=2e-3, equal_nan=True)
    modes = int(Flag.RELATIVE_XYZ | Flag.RELATIVE_E | Flag.INCHES)
    assert after.flags[-1] & modes == before.flags[-1] & modes
