import math

import numpy as np
import pytest
from following import lag
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import BEAD, SYRINGE, Pen, chunked, pens, plain_python, same
from test_profile import ends

from gcodectl.columns import Floats
from gcodectl.motion.edges import Ceiling, edges
from gcodectl.motion.follow import Follow
from gcodectl.motion.limits import Limit, motion_limits
from gcodectl.motion.lookahead import plan
from gcodectl.motion.profile import profile
from gcodectl.motion.zones import SPARE, STEPS, rounded_kernel
from gcodectl.records import Flag, Moves, Profile, SpeedPlan

START, STOP = int(Limit.START), int(Limit.STOP)
KEPT = ("kind", "line", "tool", "layer", "feed", "area", "flags")


def cut(moves: Moves, follow: Follow, size: int = 10_000) -> tuple[Moves, Ceiling]:
    pieces = list(edges(chunked(moves, size), SYRINGE, follow))
    return Moves.concat([piece[0] for piece in pieces]), Ceiling.concat([piece[1] for piece in pieces])


def planned(moves: Moves, follow: Follow | None, size: int = 10_000) -> tuple[Moves, SpeedPlan, Profile]:
    pieces = list(profile(plan(chunked(moves, size), SYRINGE, follow), SYRINGE))
    return (
        Moves.concat([piece[0] for piece in pieces]),
        SpeedPlan.concat([piece[1] for piece in pieces]),
        Profile.concat([piece[2] for piece in pieces]),
    )


def time_of(pen: Pen, follow: Follow | None) -> float:
    return float(planned(pen.moves(), follow)[2].duration.sum())


def a_road(length: float = 20.0, rows: int = 1, **more: float) -> Pen:
    pen = Pen().dwell(1.0)
    for k in range(rows):
        pen.road(length * (k + 1) / rows, 0, **more)
    return pen.dwell(1.0)


@pytest.mark.parametrize(("slower", "slowed"), [(0.9, False), (1.2, False), (1.5, True)])
def test_an_extruder_that_is_about_as_quick_as_the_gantry_slows_nothing(slower: float, slowed: bool) -> None:
    seconds = np.full((1, 2), slower * 10 / SYRINGE.accel)
    moves, ceiling = cut(a_road().moves(), Follow(np.array([[1.0, 100.0]]), seconds, seconds, 1.0, 1.0))
    assert (len(moves) > 3) == slowed
    assert np.isfinite(ceiling.accel).any() == slowed


def test_the_ramps_of_a_road_take_the_time_that_the_extruder_is_given() -> None:
    follow = lag(0.5)
    flow = BEAD * 10
    moves, speeds, p = planned(a_road().moves(), follow)
    assert speeds.ruled_by.tolist() == [0, START, 0, STOP, 0]
    up, down = speeds.accel[1], speeds.accel[3]
    assert up == pytest.approx(10 / (0.5 * math.log(25 / (25 - flow))), rel=0.06)
    assert down == pytest.approx(10 / (0.5 * math.log((25 + flow) / 25)), rel=0.06)
    assert speeds.accel[2] == SYRINGE.accel
    assert moves.length[1] == pytest.approx(5 * (10 / up + up / SYRINGE.jerk))
    took = [p.duration[p.row == row].sum() for row in range(5)]
    assert took[1] == pytest.approx(10 / up + up / SYRINGE.jerk, rel=1e-6)
    assert took[3] == pytest.approx(10 / down + down / SYRINGE.jerk, rel=1e-6)
    assert p.v[p.row == 2] == pytest.approx(10.0, abs=1e-3)


@pytest.mark.parametrize("rows", [1, 400])
def test_where_a_travel_runs_into_a_road_the_flow_need_not_jump(rows: int) -> None:
    pen = Pen().go(20, 0)
    for k in range(rows):
        pen.road(20 + 20 * (k + 1) / rows, 0)
    moves, speeds, p = planned(pen.go(60, 0).moves(), lag(0.5))
    at_end = np.flatnonzero(speeds.ruled_by > 0)
    first, last = at_end[0], at_end[-1]
    assert speeds.entry[first] == pytest.approx(10 / 3, rel=0.05)
    assert speeds.exit[last] == pytest.approx(10 / 3, rel=0.05)
    assert speeds.limited_by[first] == speeds.limited_by[last] == Limit.FLOW
    assert moves.flags[first] & int(Flag.PART)
    took = p.duration[np.isin(p.row, speeds.row[speeds.ruled_by == START])].sum()
    # a third of the speed over a ninth of the path, the rest of the ramp as from rest
    assert took == pytest.approx((1 / 6 + 2 / 3) * 10 / speeds.accel[first], rel=0.1)
    assert p.v[p.row == first].max() < 3.5


def test_a_road_of_many_short_moves_ramps_as_one() -> None:
    one, many = planned(a_road().moves(), lag(0.5)), planned(a_road(rows=400).moves(), lag(0.5))
    assert many[2].duration.sum() == pytest.approx(one[2].duration.sum(), abs=0.02)
    assert len(set(many[1].run[many[1].ruled_by == START].tolist())) == 1
    assert abs(many[1].distance[many[1].ruled_by == STOP].sum() - one[1].distance[3]) < 0.1


def test_nothing_is_slowed_that_the_extruder_follows_anyhow_or_that_quality_gives_no_time() -> None:
    moves = a_road().moves()
    for follow in (lag(0.0), lag(1.0, tau=0.01), lag(1.0, tau=1e-9), None):
        rows, ceiling = cut(moves, follow) if follow else (moves, Ceiling.none(len(moves)))
        same(rows, moves)
        assert np.isinf(ceiling.accel).all()
        assert np.isinf(ceiling.speed).all()
        for one, other in zip(planned(moves, follow), planned(moves, None), strict=True):
            same(one, other)


def test_what_may_not_be_rewritten_is_left_as_it_is() -> None:
    moves = a_road().moves()
    moves = moves.replace(flags=np.where(moves.e > 0, np.int16(0), moves.flags))
    rows, ceiling = cut(moves, lag(1.0))
    same(rows, moves)
    assert not ceiling.ruled_by.any()


def test_a_road_too_short_for_its_ramps_peaks_lower_but_no_less_than_it_must() -> None:
    # tau 3 s at share 1: ramps of about 0.67 s and 0.55 s, 3.3 mm and 2.7 mm
    for length, peak in ((4.0, 8.1), (2.6, 6.5)):
        _, speeds, p = planned(a_road(length).moves(), lag(1.0, tau=3.0))
        laid = np.isin(p.row, speeds.row[speeds.ruled_by > 0])
        assert p.v[laid].max() == pytest.approx(peak, rel=0.06)
        assert p.duration[laid].sum() == pytest.approx(2 * length / peak, rel=0.08)
    for length in (0.2, 0.8):  # a dot: passed at an even speed, in SPARE seconds and what its ramps take
        longer = time_of(a_road(length), lag(1.0, tau=3.0)) - time_of(a_road(length), None)
        assert SPARE - 2 * length / 10 < longer < 2 * SPARE


def test_a_road_loses_no_more_than_half_of_its_ramps() -> None:
    for length in (0.5, 1.0, 3.0, 6.0, 20.0):
        follow = lag(1.0, tau=2.0, peak=0.01)
        most = 0.5 * 2.0 * (math.log(25 / 20) + math.log(30 / 25))
        assert 0.0 < time_of(a_road(length), follow) - time_of(a_road(length), None) < 1.1 * most


def test_corners_keep_the_acceleration_of_the_machine() -> None:
    pen = Pen(at=(5.0, 0.0, 0.0)).dwell(1.0).road(20, 0).road(20, 15).road(5, 15).dwell(1.0)
    moves, speeds, _ = planned(pen.moves(), lag(1.0))
    assert speeds.ruled_by[speeds.ruled_by > 0].tolist() == [START, STOP]
    corner = int(np.flatnonzero(moves.p1[:, 1] == 15)[0])
    assert speeds.accel[corner] == SYRINGE.accel
    assert speeds.exit[corner] == speeds.entry[corner + 1] == pytest.approx(5.0)  # as the machine takes it


def test_the_parts_of_a_line_are_one_line() -> None:
    moves = a_road().moves()
    moves = moves.replace(e_end=np.cumsum(moves.e))
    rows, _ = cut(moves, lag(0.5))
    assert [rows.raw(k) for k in range(len(rows))] == [b"row 0\n", b"row 1\n", b"", b"", b"row 2\n"]
    assert rows.line.tolist() == [1, 2, 2, 2, 3]
    assert rows.row.tolist() == [0, 1, 2, 3, 4]
    assert ((rows.flags & int(Flag.PART)) != 0).tolist() == [False, True, True, True, False]
    assert rows.e_end == pytest.approx(np.cumsum(rows.e))
    assert rows.e_end[3] == moves.e_end[1]


def chain(moves: Moves, rows: Moves) -> None:
    """The rows are the moves, some of them cut: each part begins where the one before it ended, and all add up."""
    part = (rows.flags & int(Flag.PART)) != 0
    first = ~part | (rows.start < rows.end)
    source = np.cumsum(first) - 1
    assert source[-1] == len(moves) - 1
    assert np.array_equal(rows.row, np.arange(len(rows)) + rows.row[0])
    for name in KEPT:
        of_rows = getattr(rows, name) & ~int(Flag.PART | Flag.GOES_ON) if name == "flags" else getattr(rows, name)
        assert np.array_equal(of_rows, getattr(moves, name)[source]), name
    for name in ("length", "e", "sweep"):
        summed = np.bincount(source, weights=np.nan_to_num(getattr(rows, name)), minlength=len(moves))
        assert np.allclose(summed, np.nan_to_num(getattr(moves, name)), rtol=1e-12), name
    last = np.append(first[1:], True)
    assert np.array_equal((rows.flags & int(Flag.GOES_ON)) != 0, ~last)
    assert np.array_equal(rows.p0[first], moves.p0, equal_nan=True)
    assert np.array_equal(rows.p1[last], moves.p1, equal_nan=True)
    assert np.allclose(rows.p0[1:][~first[1:]], rows.p1[:-1][~first[1:]], rtol=0, atol=1e-9)
    several = np.bincount(source)[source] > 1  # a dot is a part of its own, however short
    assert (rows.length[part & several] >= 0.02 * (1 - 1e-6)).all()


FOLLOWS = st.sampled_from([lag(0.5), lag(1.0, tau=3.0), lag(0.3, tau=0.3), lag(1.0, peak=0.1)])


@given(pens(most=40), FOLLOWS)
def test_rows_are_cut_and_nothing_else(pen: Pen, follow: Follow) -> None:
    moves = pen.moves()
    rows, ceiling = cut(moves, follow)
    chain(moves, rows)
    assert ((ceiling.ruled_by > 0) == np.isfinite(ceiling.accel)).all()
    ruled = ceiling.ruled_by > 0
    assert rows.deposits[ruled].all()


@settings(max_examples=60)
@given(pens(most=60), st.sampled_from([1, 2, 7, 37]), FOLLOWS)
def test_any_chunking_gives_the_same_rows_and_the_same_plan(pen: Pen, size: int, follow: Follow) -> None:
    moves = pen.moves()
    for whole, pieces in zip(cut(moves, follow), cut(moves, follow, size), strict=True):
        same(whole, pieces)
    for whole, pieces in zip(planned(moves, follow), planned(moves, follow, size), strict=True):
        same(whole, pieces)


@given(pens(most=40), FOLLOWS)
def test_never_more_than_asked_and_the_motion_is_continuous(pen: Pen, follow: Follow) -> None:
    moves, speeds, p = planned(pen.moves(), follow)
    asked = motion_limits(moves, SYRINGE)
    moving = speeds.distance > 0
    ruled = speeds.ruled_by > 0
    assert (speeds.accel[moving & ~ruled] == asked.accel[moving & ~ruled]).all()
    assert (speeds.accel[ruled] < asked.accel[ruled]).all()
    assert (speeds.cruise <= asked.cruise).all()
    if not len(p):
        return
    s1, v1, a1 = ends(p)
    assert np.abs(v1[:-1] - p.v[1:]).max(initial=0.0) < 1e-5 + 1e-6 * p.v.max()
    cap = speeds.accel[p.row - moves.row[0]] * (1 + 1e-6) + 1e-6
    assert (np.abs(p.a) <= cap).all()
    assert (np.abs(a1) <= cap).all()
    last = np.append(np.diff(p.row) > 0, True)
    assert np.abs(s1[last] - speeds.distance[p.row[last] - moves.row[0]]).max() < 1e-6
    assert p.duration.sum() >= planned(pen.moves(), None)[2].duration.sum() * (1 - 1e-6)


def test_a_long_road_leaves_before_it_ends() -> None:
    pen = Pen()
    for k in range(4000):
        pen.road(0.05 * (k + 1), 0)
    given_in, out, held = 0, 0, [0]

    def watched() -> Floats:  # type: ignore[misc]
        nonlocal given_in
        for chunk in chunked(pen.moves(), 50):
            given_in += len(chunk)
            yield chunk

    for moves, _ in edges(watched(), SYRINGE, lag(1.0, tau=2.0)):  # type: ignore[arg-type]
        out += len(moves)
        held.append(given_in - out)
    assert out == 4000
    assert max(held) < 200


def test_arcs_are_cut_on_their_circle_and_taken_as_fast_as_their_acceleration_allows() -> None:
    pen = Pen(at=(10.0, 0.0, 0.0)).arc((0, 0), math.pi, feed=10, bead=BEAD)
    moves, speeds, _ = planned(pen.moves(), lag(1.0))
    assert len(moves) == 3
    assert np.hypot(moves.p1[:, 0], moves.p1[:, 1]) == pytest.approx([10.0] * 3)
    assert moves.sweep.sum() == pytest.approx(math.pi)
    # however slowly the extruder lets it speed up, a firmware takes the curve by its own acceleration
    small = Pen(at=(0.5, 0.0, 0.0)).arc((0, 0), 4 * math.pi, feed=40, bead=0.1)
    _, speeds, _ = planned(small.moves(), lag(1.0, tau=2.0))
    assert (speeds.accel < SYRINGE.accel).any()
    assert Limit.CURVE in speeds.limited_by
    assert speeds.cruise.max() == pytest.approx(math.sqrt(SYRINGE.accel * 0.5))


def test_steps_of_acceleration_are_close_and_few() -> None:
    values = np.geomspace(0.13, 4000, 3000)
    steps = np.array([rounded_kernel(value) for value in values])
    assert np.abs(np.log(steps / values)).max() < 0.075
    assert len(np.unique(np.round(steps, 9))) < 24 * 4.6
    for kernel in (rounded_kernel, rounded_kernel.py_func):
        assert [kernel(one) for one in (0.0, np.inf, np.nan, 10.0, 99.9)] == [np.inf, np.inf, np.inf, 10.0, 100.0]
    assert len(STEPS) == 25


@settings(max_examples=3)
@given(pens(most=25))
def test_the_same_with_the_jit_off(pen: Pen) -> None:
    moves, follow = pen.moves(), lag(0.7)
    expected, above = cut(moves, follow)
    with plain_python("gcodectl.motion", "gcodectl.path"), np.errstate(all="ignore"):
        rows, ceiling = cut(moves, follow)
    assert np.allclose(ceiling.accel, above.accel)
    assert np.allclose(rows.p1, expected.p1, equal_nan=True, atol=1e-9)
    assert np.array_equal(rows.flags, expected.flags)


def test_nothing_in_nothing_out() -> None:
    assert list(edges(iter([]), SYRINGE, lag(1.0))) == []
    assert list(edges(iter([Moves.empty()]), SYRINGE, lag(1.0))) == []
