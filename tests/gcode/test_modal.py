import math

import numpy as np
import pytest
from gcode_reading import moves_of

from gcodectl.config import Machine
from gcodectl.errors import InputError
from gcodectl.gcode.modal import interpret
from gcodectl.gcode.parse import parse
from gcodectl.records import Flag, Kind, Moves

KNOWN, NOTHING, LINE, BARRIER = Flag.KNOWN, Kind.NOTHING, Kind.LINE, Kind.BARRIER


def last(text: str, dialect: str = "marlin") -> Moves:
    return moves_of(text, dialect)[-1:]


def known(text: str, dialect: str = "marlin") -> bool:
    return bool(last(text, dialect).flags[0] & KNOWN)


def test_a_line_in_mm_and_seconds() -> None:
    moves = moves_of("G21\nG90\nM83\nG1 X1 Y2 Z3 F600\nG1 X4 Y6 E.5\n")
    assert moves.kind.tolist() == [NOTHING, NOTHING, NOTHING, LINE, LINE]
    move = moves[-1:]
    assert (move.p0.tolist(), move.p1.tolist()) == ([[1, 2, 3]], [[4, 6, 3]])
    assert (move.length[0], move.e[0], move.feed[0], move.area[0]) == (5, 0.5, 10, pytest.approx(math.pi))
    assert move.flags[0] == KNOWN | Flag.RELATIVE_E
    assert moves.row.tolist() == [0, 1, 2, 3, 4]
    assert move.line[0] == 5
    assert np.isnan(moves.p0[3]).all()
    assert not moves.flags[3] & KNOWN
    assert moves.decimals[-1].tolist() == [0, 1]


def test_nothing_is_known_until_position_mode_and_speed_are() -> None:
    assert not known("G90\nM83\nG1 X1 Y1 F600\nG1 X2 E1")
    assert not known("G90\nM83\nG1 X1 Y1 Z1\nG1 X2 E1")
    assert not known("G1 X1 Y1 Z1 F600\nG1 X2 E1", "klipper")
    assert not known("G90\nM82\nG1 X1 Y1 Z1 F600\nG1 X2 E1")
    assert known("G90\nM82\nG1 X1 Y1 Z1 F600\nG1 X2 E1\nG1 X3 E2")
    assert known("G90\nM82\nG92 E0\nG1 X1 Y1 Z1 F600\nG1 X2 E1")
    assert known("M83\nG1 X1 Y1 Z1 F600\nG1 X2 E1")
    assert known("M83\nG1 X1 Y1 Z1\nG1 X2 F600 E1")


@pytest.mark.parametrize("word", ["A1", "B1", "H1", "S5", "T1", "I1", "P1"])
def test_foreign_words_pass_but_are_tracked(word: str) -> None:
    moves = last(f"M83\nG1 X1 Y1 Z1 F600\nG1 X5 {word}")
    assert not moves.flags[0] & KNOWN
    assert (moves.length[0], moves.p1[0, 0]) == (4, 5)


def test_checksummed_and_odd_lines_are_not_rewritten() -> None:
    line = "N1 G1 X5"
    check = 0
    for byte in line.encode():
        check ^= byte
    assert not known(f"M83\nG1 X1 Y1 Z1 F600\n{line}*{check}")
    assert known(f"M83\nG1 X1 Y1 Z1 F600\n{line}")
    assert not known("M83\nG1 X1 Y1 Z1 F600\nG1 X5 E1:2")
    assert not known("M83\nG1 X1 Y1 Z1 F600\nG1 X5 Y")


def test_moves_that_move_nothing_are_nothing() -> None:
    head = "G90\nM82\nG92 E3\nG1 X1 Y1 Z1 F600\n"
    for line in ("G1 F900", "G1 X1 Y1", "G1 E3", "G1"):
        move = last(head + line)
        assert (move.kind[0], move.length[0], move.e[0]) == (NOTHING, 0, 0)
    assert last(head + "G1 F900").feed[0] == 15
    assert last(head + "G1 F0").feed[0] == 10
    assert last(head + "G1 E2").kind[0] == LINE
    assert last(head + "G0 X2").flags[0] == KNOWN | Flag.G0
    assert last("G1 X5").kind[0] == LINE
    assert math.isnan(last("G1 X5").length[0])


@pytest.mark.parametrize(
    ("modes", "marlin", "klipper", "reprap"),
    [
        ("M82", 0, 0, 0),
        ("M83", 1, 1, 1),
        ("G90", 0, None, None),
        ("G91", 1, 1, None),
        ("M82\nG91", 1, 1, 0),
        ("M82\nG91\nG90", 0, 0, 0),
        ("M83\nG91\nG90", None, 1, 1),
        ("M83\nG90", None, 1, 1),
        ("G90\nM83", 1, 1, 1),
        ("M83\nG90\nM82", 0, 0, 0),
        ("G91 M82", 0, 1, 0),
        ("START_PRINT\nM82", 0, None, 0),
    ],
)
def test_e_mode_by_dialect(modes: str, marlin: int | None, klipper: int | None, reprap: int | None) -> None:
    for dialect, expected in (("marlin", marlin), ("klipper", klipper), ("reprapfirmware", reprap)):
        move = last(f"G92 E4\n{modes}\nG92 E4\nG1 E6", dialect)
        assert move.e[0] == {0: 2.0, 1: 6.0, None: 0.0}[expected], dialect
        relative = {0: False, 1: True, None: False}[expected]
        assert bool(move.flags[0] & Flag.RELATIVE_E) == relative
        assert move.e_end[0] == {0: 6, 1: 10}.get(expected, move.e_end[0]) or expected is None
        assert math.isnan(move.e_end[0]) == (expected is None)


def test_inches_relative_and_units_of_e() -> None:
    head = "G90\nM82\nG92 E0\nG1 X0 Y0 Z0 F600\n"
    move = last(head + "G20\nG91\nM82\nG1 X1 E2 F10\n")
    assert move.p1[0].tolist() == [25.4, 0, 0]
    assert move.e[0] == pytest.approx(50.8)
    assert move.e_end[0] == 2
    assert move.feed[0] == pytest.approx(25.4 / 6)
    assert move.flags[0] == KNOWN | Flag.INCHES | Flag.RELATIVE_XYZ
    assert last(head + "G1 E25.4\nG20").e_end[0] == pytest.approx(1)
    assert last(head + "M200 D1.75\nG1 E2").area[0] == 1
    assert last(head + "M200 D1.75\nM200 S0\nG1 E2").area[0] == pytest.approx(math.pi)
    assert last(head + "M200 D1.75\nG20\nG1 E1").e[0] == pytest.approx(25.4**3)
    assert last(head + "M200 D1.75\nG1 E2", "klipper").area[0] == pytest.approx(math.pi)


def test_g92_sets_e_quietly_and_xyz_as_a_barrier() -> None:
    head = "G90\nM82\nG92 E0\nG1 X1 Y2 Z3 E5 F600\n"
    move = last(head + "G92 E1")
    assert (move.kind[0], move.flags[0], move.e_end[0]) == (NOTHING, KNOWN | Flag.SETS_E, 1)
    move = last(head + "G92 X0")
    assert (move.kind[0], move.p0[0].tolist(), move.p1[0].tolist()) == (BARRIER, [1, 2, 3], [0, 2, 3])
    move = last(head + "G92", "klipper")
    assert (move.p1[0].tolist(), move.e_end[0], move.kind[0]) == ([0, 0, 0], 0, BARRIER)
    move = last(head + "G92")
    assert np.isnan(move.p1).all()
    assert math.isnan(move.e_end[0])
    assert np.isnan(last(head + "G92 X").p1).all()


HEAD = "G90\nM83\nG92 E0\nG1 X1 Y2 Z3 F600\n"


@pytest.mark.parametrize(
    ("line", "kind", "lost"),
    [
        ("M105", NOTHING, ""), ("; c", NOTHING, ""), ("EXCLUDE_OBJECT NAME=a", NOTHING, ""), ("M486 S1", NOTHING, ""),
        ("M109 S200", BARRIER, ""), ("M400", BARRIER, ""), ("G28", BARRIER, "XYZ"), ("G28 X", BARRIER, "XYZ"),
        ("G29", BARRIER, "XYZ"),
        ("G80", BARRIER, "XYZ"), ("M600", BARRIER, "XY"), ("M0", BARRIER, "XY"), ("PAUSE", BARRIER, "XY"),
        ("MY_MACRO A=1", BARRIER, "XYZEF"), ("/G1 X2", BARRIER, "XYZEF"), ("M808 L2", BARRIER, "XYZEF"),
        ("M9999", BARRIER, "XYZ"),
        ("T1", Kind.TOOL, "XYE"), ("T1 M6", Kind.TOOL, "XYE"), ("M6 T1", Kind.TOOL, "XYE"),
        ("T1000", BARRIER, "XYZE"), ("Tx", BARRIER, "XYZE"),
        ("M6", BARRIER, "XYZE"), ("G10", Kind.RETRACT, ""), ("G11", Kind.UNRETRACT, ""), ("G10 S1", Kind.RETRACT, ""),
        ("M103", Kind.RETRACT, ""), ("M101", Kind.UNRETRACT, ""), ("G10 P0 S200", NOTHING, ""),
        ("G10 P0 R1 S1", NOTHING, ""),
        ("G10 L2 P1 X5", BARRIER, "XYZ"), ("G10 P1 X3", BARRIER, "XYZ"), ("G54", BARRIER, "XYZ"),
        ("M3 S100", NOTHING, ""),
        ("S1000", NOTHING, ""), ("F1200", NOTHING, ""), ("G5 X1", BARRIER, "XYZ"), ("G4 P10", Kind.DWELL, ""),
        ("M106 M107", BARRIER, "XYZEF"),
        ("M84", BARRIER, "XYZ"), ("M862.3 P \"a\"", NOTHING, ""), ("G40", NOTHING, ""),
    ],
)  # fmt: skip
def test_what_stays_known(line: str, kind: Kind, lost: str) -> None:
    move = last(HEAD + line)
    assert move.kind[0] == kind
    values = dict(zip("XYZEF", [*move.p1[0], move.e_end[0], move.feed[0]], strict=True))
    assert "".join(name for name, value in values.items() if math.isnan(value)) == lost
    assert bool(move.flags[0] & KNOWN) == (kind not in (BARRIER, Kind.TOOL))
    if line.endswith("T1"):
        assert move.tool[0] == 1


def test_modes_after_a_macro_must_be_said_again() -> None:
    after = HEAD + "START_PRINT\nG1 X5 Y5 Z5 F600\nG1 X6 E1"
    assert not known(after)
    assert np.isnan(last(after).p1).any()
    assert known(HEAD + "START_PRINT\nG90\nM83\nG1 X5 Y5 Z5 F600\nG1 X6 E1")


@pytest.mark.parametrize(
    ("line", "dialect", "seconds"),
    [("P250", "marlin", 0.25), ("S2", "marlin", 2), ("S2 P5", "reprapfirmware", 2), ("P5 S2", "klipper", 0.005),
        ("", "marlin", 0)],
)  # fmt: skip
def test_dwells(line: str, dialect: str, seconds: float) -> None:
    assert last(f"G4 {line}", dialect).dwell[0] == seconds


@pytest.mark.parametrize(
    ("lines", "dialect", "accel", "travel", "corner"),
    [
        ("M204 S800", "marlin", 800, 800, None),
        ("M204 P500 T900", "marlin", 500, 900, None),
        ("M204 P500 T900", "klipper", 500, 500, None),
        ("M204 S700", "klipper", 700, 700, None),
        ("M204 P500", "klipper", None, None, None),
        ("M201 X400 Y300 Z50", "marlin", 300, 300, None),
        ("M201 X4000", "marlin", None, None, None),
        ("M201 X600\nM204 S500", "marlin", 500, 500, None),
        ("M201 X300", "klipper", None, None, None),
        ("M205 X8 Y9", "marlin", None, None, 8),
        ("M205 J0.05", "marlin", None, None, math.sqrt(1000 * 0.05 * math.sqrt(0.5) / (1 - math.sqrt(0.5)))),
        ("M566 X600 Y900", "reprapfirmware", None, None, 10),
        ("M205 X8", "klipper", None, None, None),
        ("SET_VELOCITY_LIMIT ACCEL=3000 SQUARE_CORNER_VELOCITY=7 VELOCITY=100", "klipper", 3000, 3000, 7),
        ("M204", "marlin", None, None, None),
    ],
)
def test_limits(lines: str, dialect: str, accel: float | None, travel: float | None, corner: float | None) -> None:
    move = last(lines, dialect)
    for value, expected in ((move.accel[0], accel), (move.travel_accel[0], travel), (move.corner_speed[0], corner)):
        assert math.isnan(value) if expected is None else value == pytest.approx(expected)


def test_speed_and_flow_factors() -> None:
    head = HEAD + "M220 S50\nM221 S90\nG1 X2 E1\n"
    move = last(head)
    assert (move.feed[0], move.e[0], move.flow_factor[0]) == (5, 0.9, 0.9)
    assert move.e_end[0] == 1
    assert last(HEAD + "M220 B\nM220 S200\nG1 X9\nM220 R").feed[0] == 10
    assert last(HEAD + "M220 S80\nM220 B ; remember\nM220 S200\nM220 R").feed[0] == 8
    assert last(head + "M221 S").flow_factor[0] == 0.9
    assert last(head + "M221 T3 S10").flow_factor[0] == 0.9


def test_bare_lines_go_on_with_the_last_motion() -> None:
    moves = moves_of("M83\nG1 X0 Y0 Z0 F600\nX3 Y4\nF1200\nG90 X0\nG80\nM105\n")
    assert moves.kind.tolist()[2:5] == [LINE, NOTHING, LINE]
    assert moves.length[2] == 5
    assert moves.feed[4] == 20
    with pytest.raises(InputError, match=r"part.gcode:line 2: `X5`.*no G0"):
        moves_of("G80\nX5\n")


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("G1 X#1", "numbered parameters"), ("#1=5", "numbered parameters"), ("G1 X[1]", "expressions"),
        ("o1 while", "subroutines"),
        ("G93", "inverse-time"), ("G41 D1", "cutter"), ("G42", "cutter"), ("G81 X1 Z1 R2", "canned"),
        ("G68 R5", "rotated"),
        ("G1 X1*9", "checksum"), ("G1\rG1", "carriage return"), ("AB\0", "binary"), ("G1 X1e+9", "too large"),
        ("G1 X1, Y", "stray"),
        ("G92 X99999999", "too large"), ("G92 E99999999", "too large"), ("G4 S9999999", "too large"),
        ("G90 G91", "opposite"),
        ("M221 S{f}", "write the number"), ("G95", "per revolution"), ("G41.1", "cutter"), ("G51 X2", "scaling"),
    ],
)  # fmt: skip
def test_refusals_name_line_text_reason_and_remedy(line: str, reason: str) -> None:
    text = HEAD + line + "\nM105\n"
    stream = interpret(parse([text.encode()]), Machine("m"), source="part.gcode")
    assert len(next(stream)) == 4
    with pytest.raises(InputError, match=reason) as caught:
        next(stream)
    assert caught.value.line == 5
    assert caught.value.exit_status == 3
    assert str(caught.value).startswith("part.gcode:line 5")
    assert "--pass-unknown" in str(caught.value)
    passed = moves_of(text, pass_unknown=True)
    assert passed.kind.tolist()[4:] == [BARRIER, NOTHING]
    assert np.isnan(passed.p1[4]).all()
    assert math.isnan(passed.feed[4])
    assert not passed.flags[4:] @ np.array([KNOWN, KNOWN])


def test_endstop_moves_of_reprapfirmware_lose_the_position() -> None:
    for line in ("G1 H1 X-300", "G1 S1 X-300"):
        move = last(HEAD + line, "reprapfirmware")
        assert move.kind[0] == BARRIER
        assert np.isnan(move.p1[0]).all()
        assert last(HEAD + line).kind[0] == LINE
