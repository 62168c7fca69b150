import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moves import PLANES, Pen

from gcodectl import path
from gcodectl.path import point_at, tangent_at, tangents

shares = st.floats(0.0, 1.0)


def test_a_line_runs_straight() -> None:
    moves = Pen(at=(1, 2, 3)).go(5, 2, 6).moves()
    assert point_at(moves, 0, 0.25) == pytest.approx([2, 2, 3.75])
    assert point_at(moves, 0, -1.0).tolist() == [1, 2, 3]
    assert point_at(moves, 0, 2.0).tolist() == [5, 2, 6]
    assert tangent_at(moves, 0, 0.5) == pytest.approx([0.8, 0, 0.6])


def test_a_move_without_path_has_no_direction() -> None:
    start, end = tangents(Pen().push(1).dwell(1).lost(3, 3).moves())
    assert not start[:2].any()
    assert not end[:2].any()
    assert np.isnan(point_at(Pen().lost(3, 3).moves(), 0, 0.5)).any()


@given(
    st.floats(0.1, 500), st.floats(0.01, 7.0), st.booleans(), st.floats(-5, 5), st.integers(0, 2),
    st.sampled_from([0.0, 0.019, -0.019]), shares,
)  # fmt: skip
def test_points_of_an_arc_turn_rise_and_grow_evenly(
    radius: float, turn: float, ccw: bool, rise: float, plane: int, growth: float, share: float
) -> None:
    at = np.zeros(3)
    at[PLANES[plane][0]] = radius
    sweep = turn if ccw else -turn
    moves = Pen(at=tuple(at)).arc((0.0, 0.0), sweep, rise, plane, growth=growth).moves()
    x, y = PLANES[plane]
    point = point_at(moves, 0, share)
    wanted = radius + share * growth
    assert point[x] == pytest.approx(wanted * math.cos(share * sweep), abs=1e-9 * radius)
    assert point[y] == pytest.approx(wanted * math.sin(share * sweep), abs=1e-9 * radius)
    assert point[3 - x - y] == pytest.approx(share * rise, abs=1e-12)
    step = 1e-6
    inner = min(max(share, step), 1 - step)
    ahead, behind = point_at(moves, 0, inner + step * 0.999), point_at(moves, 0, inner - step * 0.999)
    along = (ahead - behind) / np.linalg.norm(ahead - behind)
    assert tangent_at(moves, 0, inner) == pytest.approx(along, abs=1e-4)
    start, end = tangents(moves)
    assert start[0] == pytest.approx(tangent_at(moves, 0, 0.0))
    assert end[0] == pytest.approx(tangent_at(moves, 0, 1.0))


def test_an_arc_whose_radii_differ_does_not_jump_at_its_end() -> None:
    moves = Pen(at=(5, 0, 0)).arc((0, 0), math.pi, growth=0.02).moves()
    assert math.dist(point_at(moves, 0, 1 - 1e-9), moves.p1[0]) < 1e-6


@pytest.mark.parametrize("plane", [0, 1, 2])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_same_with_the_jit_off(plane: int, share: float) -> None:
    moves = Pen(at=(5, 1, 2)).arc((1, -2), 1.2, 3.0, plane, growth=0.01).go(1, 1).moves()
    for row in (0, 1):
        numbers = (moves.p0[row], moves.p1[row], moves.center[row], float(moves.sweep[row]), plane, row == 0, share)
        for kernel in (path.point_kernel, path.tangent_kernel):
            fast, plain = np.empty(3), np.empty(3)
            kernel(*numbers, fast)
            kernel.py_func(*numbers, plain)
            assert fast == pytest.approx(plain, rel=1e-12, abs=1e-12)
    ends = np.empty((2, 2, 3))
    arrays = (moves.kind == path.ARC, moves.p0, moves.p1, moves.center, moves.sweep, moves.plane)
    path.tangents_kernel.py_func(*arrays, *ends)
    assert np.allclose(ends, tangents(moves))
    assert path.growth_kernel.py_func(0.0, 0.0, 1.0, 0.0) == 0.0
