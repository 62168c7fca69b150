"""What holds of the rows of any file: chunking, continuity, every byte, and the same rows with the JIT off."""

import numpy as np
import pytest
from gcode_reading import machine, moves_of, plain_python, same_rows
from hypothesis import given
from hypothesis import strategies as st
from strategies import files

from gcodectl.errors import InputError
from gcodectl.gcode.modal import interpret
from gcodectl.gcode.parse import parse
from gcodectl.records import Flag, Kind, Moves

KNOWN, BARRIER = Flag.KNOWN, Kind.BARRIER


@given(files(), st.integers(1, 60), st.sampled_from(["marlin", "klipper", "reprapfirmware"]))
def test_any_chunking_gives_the_same_rows(data: bytes, size: int, dialect: str) -> None:
    whole = moves_of(data, dialect, pass_unknown=True)
    same_rows(whole, moves_of(data, dialect, size, pass_unknown=True))
    same_rows(whole, moves_of(data, dialect, 1, pass_unknown=True))
    lines = parse(data.splitlines(keepends=True))
    same_rows(whole, Moves.concat(list(interpret(lines, machine(dialect), pass_unknown=True))))


@given(files(), st.sampled_from(["marlin", "klipper", "reprapfirmware"]))
def test_rows_follow_each_other_and_keep_every_byte(data: bytes, dialect: str) -> None:
    moves = moves_of(data, dialect, pass_unknown=True)
    assert b"".join(moves.raw(k) for k in range(len(moves))) == data
    assert np.array_equal(moves.p0[1:], moves.p1[:-1], equal_nan=True)
    sure = (moves.flags & KNOWN) != 0
    for name in ("p0", "p1", "length", "e", "feed"):
        assert np.isfinite(getattr(moves, name)[sure]).all(), name
    absolute = sure & (moves.flags & Flag.RELATIVE_E == 0)
    assert np.isfinite(moves.e_end[absolute]).all()
    chord = np.linalg.norm((moves.p1 - moves.p0)[sure], axis=1)
    assert (moves.length[sure] >= chord - 1e-9)[moves.kind[sure] != BARRIER].all()


EVERYTHING = """\ufeff; all of it
N5 G21 G90 G17 M83 (mode) "text"
G1 X0 Y0 Z.2 F1200
;TYPE:Perimeter
;WIDTH:.4
G1 X10 E1
G3 X20 Y10 J10 E.5
G2 X30 Y10 R5
G18 G2 K2
G19 G3 J2 E1
G17 G90.1 G3 I31 J10
G91.1 G20 G91 G1 X1e-01 E-.5
G21 G90 X12 Y3
G1 X5 A3
G1 X#1
G1 X5*3
O1 call
G1 X1e+9
G1 Xa
G1 X1\rY2
T?
T1 M6
M6 T0
M84
T-1
G92 X1 E0
G92
G4 P5
G10
G11
G10 L2 X5
G81 X1
G80
X5
M101
M103
M204 S5
M204 P3 T4
M201 X3 Y4
M205 X3
M205 J.1
M566 X60
M200 D2
M200 S0
M220 B
M220 R
M220 S50
M221 S90
M117 text
M104 S[x]
M600
M400
G93
M808
MACRO
PAUSE
SET_VELOCITY_LIMIT ACCEL=5 VELOCITY=3 SQUARE_CORNER_VELOCITY=2 ; c
EXCLUDE_OBJECT NAME=5
M104 S1:2:3 M
;LAYER:1
;LAYER_CHANGE
;LAYER:2
; CHANGE_LAYER
;TYPE:Odd
;HEIGHT:.2
G28 G29
G90 G91
G1 H1 X5
AB\0C
"""


@pytest.mark.parametrize("dialect", ["marlin", "klipper", "reprapfirmware"])
def test_kernels_as_plain_python_give_the_same_rows(dialect: str) -> None:
    whole = moves_of(EVERYTHING, dialect, pass_unknown=True)
    with plain_python():
        same_rows(whole, moves_of(EVERYTHING, dialect, pass_unknown=True))
    rounds = "M83\nG90\n" + EVERYTHING.replace("\n", "\nG92 X1 Y2 Z3 E4\nG1 F900\nM82\n")
    whole = moves_of(rounds, dialect, pass_unknown=True)
    with plain_python():
        same_rows(whole, moves_of(rounds, dialect, pass_unknown=True))
        with pytest.raises(InputError):
            moves_of(EVERYTHING, dialect)


@given(files(12), st.sampled_from(["marlin", "klipper", "reprapfirmware"]))
def test_generated_files_as_plain_python(data: bytes, dialect: str) -> None:
    whole = moves_of(data, dialect, pass_unknown=True)
    with plain_python():
        same_rows(whole, moves_of(data, dialect, pass_unknown=True))
