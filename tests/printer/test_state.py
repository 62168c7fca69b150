"""A line's words, the modal state, and what the machine is to do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from feeding import MACHINE
from hypothesis import given, settings
from hypothesis import strategies as st

from gcodectl.config import load_machine
from plant_models.gantry import Firmware, cut
from plant_models.printer.pieces import blocks_of
from plant_models.printer.state import Halt, Motion, State
from plant_models.printer.words import command_of, words_of
from plant_models.reading import read_moves


def state(machine: str = "syringe") -> State:
    return State(load_machine(machine), Firmware())


def play(*lines: bytes) -> State:
    one = state()
    for line in lines:
        one.read(line)
    return one


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        (b"G1 X10 Y-.5 F600", "G1", {"X": 10, "Y": -0.5, "F": 600}),
        (b"g01x10y-.5 ; X7", "G1", {"X": 10, "Y": -0.5}),
        (b"  G1\tX1.", "G1", {"X": 1}),
        (b"G1(out)X+2", "G1", {"X": 2}),
        (b"G1X1", "G1", {"X": 1}),
        (b"G28 X Y", "G28", {"X": None, "Y": None}),
        (b"M220 S90 B", "M220", {"S": 90, "B": None}),
        (b"G1 X1E5", "G1", {"X": 1, "E": 5}),
        (b"G1 X1 Y_ ENAN", "G1", {"X": 1, "Y": None, "E": None, "N": None, "A": None}),
        (b"G92.1", "G92.1", {}),
        (b"T1", "T1", {}),
        (b"; only a comment", "", {}),
        (b"\xff\xfe", "", {}),
        (b"SET_LED RED=1", "", {}),
        (b"", "", {}),
    ],
)
def test_words(text: bytes, name: str, words: dict[str, float | None]):
    found, rest = command_of(text)
    assert found == name
    if name:
        assert words_of(rest) == words


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=30))
def test_any_bytes_are_read(text: bytes):
    state().read(text)
    state().read(b"G1 " + text)
    state().read(b"G2 " + text)


LINES = st.one_of(
    st.tuples(st.sampled_from([b"G0", b"G1"]), st.integers(-50, 50), st.integers(-9, 9), st.integers(1, 60)).map(
        lambda it: b"%s X%.1f E%.2f F%d" % (it[0], it[1], it[2] / 10, 60 * it[3])
    ),
    st.sampled_from([b"G92 E0", b"G92 E1.5", b"M82", b"M83", b"M220 S50", b"M220 S100", b"M221 S90", b"G20", b"G21"]),
    st.sampled_from([b"M204 S300", b"M204 P200 T400", b"M201 X250 Y350", b"M205 X3 Y4", b"M205 J0.02", b"G10", b"G11"]),
    st.sampled_from(
        [
            b"G91\nM83",
            b"G90\nM82",
            b"G90\nM83",
            b"G1 Y5 Z0.3",
            b"G4 P250",
            b"G92 X3 Y1",
            b"T1\nM221 S80\nG92 E0\nG90\nM82\nG1 X9 Y9",
        ]
    ),
    st.sampled_from([b"G2 X10 Y5 I5 J2.5 E1", b"G3 X1 Y1 R40", b"G17", b"G2 I4 J0", b"G3 I-3 J1 P2"]),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(LINES, max_size=12))
def test_it_reads_as_the_other_reader_does(lines: list[bytes]):
    data = b"\n".join([b"G21", b"G90", b"M82", b"G92 E0", b"G1 X0 Y0 Z0 F1500", b"G1 X77", *lines])
    moves = read_moves(data, MACHINE, pass_unknown=True)
    segments = cut(moves, MACHINE, Firmware())
    if (moves.kind[6:] == 7).sum() != sum(line.startswith(b"G92 X") for line in lines):
        return  # an arc that the other one refuses
    one, blocks, halts = state(), [], 0.0
    for number, line in enumerate(data.splitlines(), 1):
        order = one.read(line)
        if isinstance(order, Motion):
            blocks += list(blocks_of(order, one, number))
        elif isinstance(order, Halt):
            halts += order.seconds
    moving = segments[segments.kind != 2]
    assert [block.line for block in blocks] == moving.line.tolist()
    for name, column in (("length", "length"), ("e", "e"), ("speed", "speed"), ("accel", "accel"),
                         ("corner", "corner_speed"), ("end", "p1"), ("area", None)):  # fmt: skip
        found = np.array([getattr(block, name) for block in blocks]).reshape(len(blocks), -1)
        wanted = getattr(moving, column).reshape(len(blocks), -1) if column else np.full_like(found, MACHINE.area)
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-9, err_msg=name)
    assert halts == pytest.approx(segments.pause.sum())


def test_what_is_unknown_elsewhere_is_marlins_default():
    one = state()
    motion = one.read(b"G1 X5 E2")
    assert isinstance(motion, Motion)
    assert (motion.start, motion.ends, motion.e, motion.feed) == ((0, 0, 0), [(5, 0, 0)], 2.0, 25.0)
    one.read(b"M83")
    one.read(b"G90")
    assert one.read(b"G1 E5").e == 3.0, "G90 makes E absolute again"  # type: ignore[union-attr]


def test_homing_sets_the_axes_that_are_named():
    one = play(b"G1 X5 Y6 Z7")
    assert one.read(b"G28 X0 Z") == Halt(0.0)
    assert one.at == (0, 6, 0)
    assert one.rest
    assert one.broken
    one.read(b"G28")
    assert one.at == (0, 0, 0)


def test_a_dwell_prefers_seconds():
    assert play().read(b"G4 P500") == Halt(0.5)
    assert play().read(b"G4 P500 S2") == Halt(2.0)
    assert play().read(b"G4") == Halt(0.0)


@pytest.mark.parametrize("text", [b"M400", b"M84", b"M18 X", b"G28"])
def test_waiting_for_rest(text: bytes):
    assert play().read(text) == Halt(0.0)


def test_tools():
    one = play(b"M221 S50 T1")
    assert one.read(b"T0") is None
    assert one.rest
    assert one.read(b"T1") == Halt(MACHINE.switch_dwell)
    assert one.tool == 1
    assert one.read(b"G1 E1").e == 0.5  # type: ignore[union-attr]
    assert one.read(b"T?") is None
    assert one.read(b"T0.5") is None


def test_firmware_retraction():
    one = play(b"M207 S2 F600", b"M208 S0.5 F300")
    back = one.read(b"G10")
    assert isinstance(back, Motion)
    assert (back.e, back.feed, back.e_end) == (-2.0, 10.0, 0.0)
    assert one.read(b"G10") is None, "a second one does nothing"
    assert one.read(b"G10 P1 S200") is None, "a tool's temperature"
    on = one.read(b"G11")
    assert isinstance(on, Motion)
    assert (on.e, on.feed) == (2.5, 5.0)
    plain = play().read(b"G10")
    assert isinstance(plain, Motion)
    assert plain.e * MACHINE.area == pytest.approx(-2.4)


def test_settings_that_the_other_reader_leaves_out_are_obeyed():
    one = play(b"M203 X10 Y10 Z1 E0.5", b"M201 Z20 E30", b"M204 R40", b"M205 E0.25", b"M900 K0.3", b"M900 K30")
    fast, up, push = (next(blocks_of(one.read(text), one, 1)) for text in (b"G1 X9 F6000", b"G1 Z9", b"G1 E9"))  # type: ignore[arg-type]
    assert fast.speed == 10
    assert (up.speed, up.accel) == (1, 20)
    assert (push.speed, push.accel) == (min(0.5, MACHINE.max_flow / MACHINE.area), 30)
    assert push.e_corner == 0.25
    one.read(b"M203 Y3")
    assert next(blocks_of(one.read(b"G1 Y50"), one, 1)).speed == 3  # type: ignore[arg-type]
    assert push.advance == 0.3, "a K that no linear advance has is refused"


def test_speed_and_flow_factors():
    one = play(b"M220 B S50", b"M221 S200", b"G1 F600")
    motion = one.read(b"G1 X1 E1")
    assert isinstance(motion, Motion)
    assert (motion.feed, motion.e, motion.e_end) == (5.0, 2.0, 1.0)
    one.read(b"M220 R")
    assert one.read(b"G1 X2").feed == 10.0  # type: ignore[union-attr]


def test_volumetric_e():
    one = play(b"M200 D15.8")
    motion = one.read(b"G1 X10 E5")
    assert isinstance(motion, Motion)
    block = next(blocks_of(motion, one, 1))
    assert block.e * block.area == 5.0
    one.read(b"M200 S0")
    assert one.area == MACHINE.area


@pytest.mark.parametrize("plane", [b"G17", b"G18", b"G19"])
@pytest.mark.parametrize("way", [b"G2", b"G3"])
def test_arcs_in_every_plane_as_the_other_reader_cuts_them(plane: bytes, way: bytes):
    words = {b"G17": b"X6 Y6 Z1 I3 J3", b"G18": b"X6 Z6 Y1 I3 K3", b"G19": b"Y6 Z6 X1 J3 K3"}[plane]
    data = b"G21\nG90\nM83\nG92 X0 Y0 Z0 E0\n%s\n%s %s E1 F600\n" % (plane, way, words)
    segments = cut(read_moves(data, MACHINE), MACHINE, Firmware())
    one = play(*data.splitlines()[:-1])
    ends = [block.end for block in blocks_of(one.read(data.splitlines()[-1]), one, 1)]  # type: ignore[arg-type]
    np.testing.assert_allclose(ends, segments.p1, atol=1e-9)


def test_arcs_that_are_none():
    assert play().read(b"G2 X5") is None
    assert play().read(b"G2 R5") is None
    assert play().read(b"G2 X5 R0") is None
    assert len(play().read(b"G2 X5 R1").ends) == math.ceil(math.pi * 2.5 / 0.5)  # type: ignore[union-attr]
