import math

import numpy as np
import pytest
from gcode_reading import moves_of
from hypothesis import given
from hypothesis import strategies as st

from gcodectl.errors import InputError
from gcodectl.gcode import arcs
from gcodectl.gcode.arcs import FINE, NO_CENTER, RADII_DIFFER, TOO_FAR
from gcodectl.path import point_at, tangent_at, tangents
from gcodectl.records import Flag, Kind

HEAD = "G90\nM83\nG1 X0 Y0 Z0 F600\n"


def arc(line: str, before: str = "", dialect: str = "marlin"):  # type: ignore[no-untyped-def]
    moves = moves_of(f"{HEAD}{before}{line}\n", dialect)
    return moves, len(moves) - 1


def test_a_quarter_by_offsets() -> None:
    moves, k = arc("G3 X10 Y10 I0 J10 E2 F1200", "G1 X0\n")
    assert moves.kind[k] == Kind.ARC
    assert moves.flags[k] & Flag.KNOWN
    assert moves.center[k].tolist() == [0, 10]
    assert moves.sweep[k] == pytest.approx(math.pi / 2)
    assert moves.length[k] == pytest.approx(5 * math.pi)
    assert point_at(moves, k, 0.5) == pytest.approx([10 * math.sqrt(0.5), 10 - 10 * math.sqrt(0.5), 0])
    assert tangent_at(moves, k, 0) == pytest.approx([1, 0, 0])
    assert tangent_at(moves, k, 1.0) == pytest.approx([0, 1, 0])
    assert point_at(moves, k, 0).tolist() == [0, 0, 0]
    assert point_at(moves, k, 99).tolist() == [10, 10, 0]


@pytest.mark.parametrize(
    ("line", "center", "sweep"),
    [
        ("G3 X10 Y10 R10", [0, 10], 90),
        ("G2 X10 Y10 R10", [10, 0], -90),
        ("G3 X10 Y10 R-10", [10, 0], 270),
        ("G2 X10 Y10 R-10", [0, 10], -270),
        ("G2 X20 Y0 R10", [10, 0], -180),
        ("G2 X20 Y0 R9.99", [10, 0], -180),
        ("G2 I5", [5, 0], -360),
        ("G3 X0 Y0 J-5", [0, -5], 360),
        ("G3 X0 Y0 J-5 P2", [0, -5], 1080),
        ("G90.1 G3 X10 Y10 I0 J10", [0, 10], 90),
        ("G91 G3 X10 Y10 J10", [0, 10], 90),
        ("G18 G3 X10 Z10 K0 I10", [0, 10], 90),
        ("G18 G2 X10 Z10 K10", [10, 0], -90),
        ("G19 G3 Y10 Z10 J0 K10", [0, 10], 90),
    ],
)
def test_forms_of_an_arc(line: str, center: list[float], sweep: float) -> None:
    moves, k = arc(line)
    assert moves.center[k] == pytest.approx(center, abs=1e-9)
    assert math.degrees(moves.sweep[k]) == pytest.approx(sweep, abs=1e-6)
    end = point_at(moves, k, 1 - 1e-12)
    assert end == pytest.approx(moves.p1[k], abs=0.02)


def test_klipper_turns_the_other_way_in_g18() -> None:
    ours, k = arc("G18 G3 X10 Z10 I10 P3", dialect="reprapfirmware")
    theirs, _ = arc("G18 G2 X10 Z10 I10", dialect="klipper")
    assert ours.sweep[k] == theirs.sweep[k] == pytest.approx(math.pi / 2)


def test_a_helix_climbs_evenly() -> None:
    moves, k = arc("G2 X20 Y0 Z6 I10 E1")
    flat = 10 * math.pi
    assert moves.length[k] == pytest.approx(math.hypot(flat, 6))
    assert point_at(moves, k, 0.5) == pytest.approx([10, 10, 3])
    start, end = tangents(moves)
    assert start[k] == pytest.approx(np.array([0, flat, 6]) / moves.length[k])
    assert end[k] == pytest.approx(np.array([0, -flat, 6]) / moves.length[k])
    assert start[0].tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("G2 X10 Y0", "no centre"),
        ("G2 X10 Y0 I0 J0", "no centre"),
        ("G2 X0 Y0 R5", "no centre"),
        ("G2 X10 Y0 R0", "no centre"),
        ("G2 X10 Y0 I4", "not at the same distance"),
        ("G2 X30 Y0 R10", "farther"),
    ],
)
def test_impossible_arcs_are_refused(line: str, reason: str) -> None:
    with pytest.raises(InputError, match=f"line 4.*{reason}") as caught:
        arc(line)
    assert caught.value.line == 4
    assert moves_of(f"{HEAD}{line}\nM105\n", pass_unknown=True).kind.tolist()[3:] == [Kind.BARRIER, Kind.NOTHING]


def test_an_arc_from_nowhere_has_no_geometry() -> None:
    moves = moves_of("G90\nM83\nG2 X10 Y0 I5 Z3 F600\nG2 X20 Y0 I5\n")
    assert math.isnan(moves.length[2])
    assert not moves.flags[2] & Flag.KNOWN
    assert moves.p1[2].tolist() == [10, 0, 3]
    assert moves.flags[3] & Flag.KNOWN
    assert moves.length[3] == pytest.approx(5 * math.pi)


@given(st.floats(0.1, 1e3), st.floats(-6, 6), st.floats(0.02, 6.2), st.booleans(), st.floats(-5, 5))
def test_sweep_and_length_of_arcs_with_and_without_the_jit(
    radius: float, angle: float, turn: float, ccw: bool, rise: float
) -> None:
    a0, b0 = radius * math.cos(angle), radius * math.sin(angle)
    end = angle + (turn if ccw else -turn)
    a1, b1 = radius * math.cos(end), radius * math.sin(end)
    for kernel in (arcs.arc_kernel, arcs.arc_kernel.py_func):  # type: ignore[attr-defined]
        sweep, length, problem = kernel(a0, b0, a1, b1, 0.0, 0.0, rise, ccw, 0.0)
        assert problem == FINE
        assert sweep == pytest.approx(turn if ccw else -turn, rel=1e-6, abs=1e-9)
        assert length == pytest.approx(math.hypot(radius * turn, rise), rel=1e-6)


def test_problem_numbers_with_the_jit_off() -> None:
    center = arcs.radius_center_kernel.py_func  # type: ignore[attr-defined]
    assert center(0, 0, 30, 0, 10, True)[2] == TOO_FAR
    assert center(0, 0, 0, 0, 10, True)[2] == NO_CENTER
    assert center(0, 0, 20, 0, 10, True) == pytest.approx((10, 0, FINE))
    arc_ = arcs.arc_kernel.py_func  # type: ignore[attr-defined]
    assert arc_(0, 0, 1, 0, 0, 0, 0, True, 0)[2] == NO_CENTER
    assert arc_(5, 0, 6, 0, 0, 0, 0, True, 0)[2] == RADII_DIFFER
