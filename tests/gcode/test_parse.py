import math

import numpy as np
import pytest
from gcode_reading import FILES, blocks_of, needs_corpus, plain_python, same_rows
from hypothesis import given
from hypothesis import strategies as st
from strategies import Words, files, spelled, words

from gcodectl.gcode import words as words_module
from gcodectl.gcode.codes import Code, Mode, command_name
from gcodectl.gcode.lines import read_chunks
from gcodectl.gcode.numbers import digits_kernel, number_kernel, scaled_kernel
from gcodectl.gcode.parse import parse


def one(line: str | bytes) -> tuple[int, Mode, dict[str, float]]:
    blocks = blocks_of(line)
    assert len(blocks) == 1
    row = blocks.words[0]
    found = {chr(65 + k): float(row[k]) for k in range(26) if not math.isnan(row[k])}
    return int(blocks.code[0]), Mode(int(blocks.modes[0])), found


@given(data=st.data(), found=words("ABCDEFHIJKPQRSUVWXYZ"), code=st.sampled_from(["G0", "G1", "G2", "G92", "M204"]))
def test_generated_words_come_back(data: st.DataObject, found: Words, code: str) -> None:
    line = data.draw(spelled(code, found))
    read, _, got = one(line)
    got.pop("N", None)
    assert command_name(read) == code
    assert got == {letter: float(number) for letter, number in found.items()}


@given(st.floats(-1e6, 1e6, allow_nan=False))
def test_numbers_are_read_as_python_reads_them(value: float) -> None:
    for text in (f"{value:.5f}", f"{value:.9g}", repr(value)):
        _, _, got = one(f"G1 X{text}")
        assert got["X"] == pytest.approx(float(text), rel=1e-15, abs=1e-300)
    assert one(f"G1 X{value:.4f}")[2]["X"] == float(f"{value:.4f}")


@pytest.mark.parametrize(
    ("line", "name", "found"),
    [
        ("G1X10Y5F300", "G1", {"X": 10, "Y": 5, "F": 300}),
        ("g1 x10 e.5", "G1", {"X": 10, "E": 0.5}),
        ("G 1 X 10", "G1", {"X": 10}),
        ("G01 X1", "G1", {"X": 1}),
        ("G92.1", "G92.1", {}),
        ("G1 X1E5", "G1", {"X": 1, "E": 5}),
        ("G1X1E-5", "G1", {"X": 1, "E": -5}),
        ("g1x1e-5", "G1", {"X": 1, "E": -5}),
        ("G1 Z0.001 B1e-06 E0.006269", "G1", {"Z": 0.001, "B": 1e-06, "E": 0.006269}),
        ("G1 X3.2e-05 E1e-05", "G1", {"X": 3.2e-05, "E": 1e-05}),
        ("G1 X2e+01", "G1", {"X": 20}),
        ("G1 (X9) X1 (and) Y2 ; Z3", "G1", {"X": 1, "Y": 2}),
        ("G1 X1 X2", "G1", {"X": 2}),
        ("N10 G1 X5", "G1", {"N": 10, "X": 5}),
        ("M117 G1 X5 ; X", "M117", {}),
        ("M203 E80:80 X1", "M203", {"E": 80, "X": 1}),
        ("T0 M6", "T0", {}),
        ("M104 T1 S200", "M104", {"T": 1, "S": 200}),
        ("G1 X5 M3", "G1", {"X": 5}),
        ("M3 G1 X5", "G1", {"X": 5}),
        ('M862.6 P"Input X9"', "M862.6", {}),
        ("\ufeffG1 X5", "G1", {"X": 5}),
        ("G1 X1000000000000000000000", "G1", {"X": 1e21}),
        ("G1 X0.1234567890123456789012", "G1", {"X": 0.12345678901234568}),
    ],
)
def test_spellings(line: str, name: str, found: dict[str, float]) -> None:
    code, _, got = one(line)
    assert command_name(code) == name
    assert got == pytest.approx(found, rel=1e-15)


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("", Code.NONE), ("; G1 X5", Code.NONE), ("(G1)", Code.NONE), ("%", Code.NONE), ("  \t", Code.NONE),
        ("N5", Code.NONE),
        ("START_PRINT BED=60", Code.EXTENDED), ("/G1 X5", Code.EXTENDED), ("@pause", Code.EXTENDED),
        ("G", Code.EXTENDED),
        ("T_MACRO", Code.EXTENDED), ("G1 X0 Y{depth}", Code.EXTENDED), ("Q5", Code.BARE),
        ("M104 S{t}", Code.M106 - 20), ("M221 S{f}", Code.UNSAFE),
        ("TIMELAPSE_RENDER", Code.HARMLESS),
        ("exclude_object_start name=a", Code.HARMLESS), ("TIMELAPSE_TAKE_FRAME", Code.RETURNS), ("X10 Y5", Code.BARE),
        ("F100", Code.BARE), ("G90 X5", Code.BARE), ("N5 X1", Code.BARE), ("S1000", Code.BARE),
        ("G28 M104", Code.SEVERAL),
        ("T?", Code.T_OTHER), ("Tx", Code.T_OTHER), ("Tc", Code.T_OTHER), ("T-1", Code.T_OTHER), ("T1.5", Code.T_OTHER),
        ("#<x> = 1", Code.UNSAFE), ("G1 X#5", Code.UNSAFE), ("G1 X[1+2]", Code.UNSAFE), ("N3 X[#1]", Code.UNSAFE),
        ("O100 sub", Code.UNSAFE), ("o<test> call", Code.UNSAFE), ("G1 X1\rG1 X2", Code.UNSAFE),
        ("; a\rG1 X2", Code.UNSAFE),
        ("G90 G91", Code.UNSAFE), ("G17 G18", Code.UNSAFE), ("G1 X1, Y2", Code.UNSAFE), ("G1 Xnan", Code.UNSAFE),
        ("GCDE\x00\x01", Code.UNSAFE), ("?", Code.UNSAFE), ("M221 S#1", Code.UNSAFE), ("M104 S[t]", Code.M106 - 20),
        ("G1 G5.x", Code.SEVERAL), ("G123456 X1", Code.UNSAFE), ("M104 M", Code.M106 - 20),
    ],
)  # fmt: skip
def test_what_a_line_is(line: str, code: int) -> None:
    assert one(line + "\n")[0] == code


def test_modal_words_become_bits_beside_any_command() -> None:
    code, modes, found = one("N10G90G1X1")
    assert (command_name(code), modes, found) == ("G1", Mode.G90, {"N": 10, "X": 1})
    code, modes, _ = one("G21 G90 G64 G40 G17 M83")
    assert command_name(code) == "M83"
    assert modes == Mode.G21 | Mode.G90 | Mode.CANCEL | Mode.G17 | Mode.M83
    assert one("G91.1 G90.1")[0] == Code.UNSAFE
    assert one("G19 G20")[1] == Mode.G19 | Mode.G20
    assert one("G80")[0] == Code.G80
    assert one("G80 G1 X1")[:2] == (Code.G1, Mode.CANCEL)
    assert Mode.ODD in one("G1 X")[1]
    assert Mode.ODD in one('M104 P "MK3" S5')[1]


def test_checksums_are_checked() -> None:
    line = "N10 G1 X1"
    good = 0
    for byte in line.encode():
        good ^= byte
    code, modes, _ = one(f"{line}*{good}")
    assert (code, modes) == (Code.G1, Mode.CHECKSUM)
    assert one(f"{line}*{good ^ 1}")[0] == Code.UNSAFE
    assert one(f"{line}*")[0] == Code.UNSAFE
    assert one(f"{line}*12345")[0] == Code.G1  # RepRapFirmware's CRC, taken on trust


def test_klipper_limits_are_read_into_words() -> None:
    code, _, found = one("SET_VELOCITY_LIMIT velocity=300 ACCEL=5e ACCEL_TO_DECEL=2500 SQUARE_CORNER_VELOCITY=7.5 ; X")
    assert (code, found) == (Code.VELOCITY_LIMIT, {"A": 5, "S": 7.5, "V": 300})


def test_decimals_are_counted() -> None:
    blocks = blocks_of("G1 X1.25 Y3 E.00123\nG1 Z2\nG1 X1e-06\nM105\n")
    assert blocks.decimals.tolist() == [[2, 5], [0, -1], [6, -1], [-1, -1]]


def test_rows_point_at_their_lines() -> None:
    text = b"G28\r\nG1 X1 \xff\xfe;\r\n\r\nM84"
    blocks = blocks_of(text)
    assert [blocks.raw(k) for k in range(4)] == [b"G28\r\n", b"G1 X1 \xff\xfe;\r\n", b"\r\n", b"M84"]
    assert blocks.line.tolist() == [1, 2, 3, 4]
    assert list(parse([])) == list(parse([b""])) == []


@needs_corpus
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_corpus_lines_leave_byte_for_byte(path) -> None:  # type: ignore[no-untyped-def]
    with path.open("rb") as stream:
        parts = [lines.blocks for lines in parse(read_chunks(stream, 50_000))]
    joined = b"".join(part.raw(row) for part in parts for row in range(len(part)))
    assert joined == path.read_bytes()
    line = np.concatenate([part.line for part in parts])
    assert np.array_equal(line, np.arange(1, len(line) + 1))


@given(files(15))
def test_kernels_as_plain_python_read_the_same(data: bytes) -> None:
    blocks = blocks_of(data)
    with plain_python():
        same_rows(blocks, blocks_of(data))


def test_number_kernels_agree_with_the_jit_off() -> None:
    for text in (b"12.5", b"-.5", b"+3.", b"-", b"1e-06", b"1e+400", b"1e-400", b"9" * 40, b"1e", b".", b""):
        array = np.frombuffer(text, np.uint8)
        compiled = number_kernel(array, 0, len(array), True)
        plain = digits_kernel.py_func(array, 0, len(array), True)  # type: ignore[attr-defined]
        assert compiled == plain or (compiled[3] is False and not plain[3])
    assert scaled_kernel.py_func(1.0, 400) == math.inf == scaled_kernel(1.0, 400)  # type: ignore[attr-defined]
    assert scaled_kernel.py_func(1.0, -400) == 0.0 == scaled_kernel(1.0, -400)  # type: ignore[attr-defined]
    assert words_module.mode_bit_kernel.py_func(Code.G18) == Mode.G18  # type: ignore[attr-defined]
