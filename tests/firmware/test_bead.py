"""Roads, bins, the ordered walk, and what falls where."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paths import AREA, BEAD, MACHINE, make, road, subdivide

from gcodectl.records import Kind, Signal
from plant_models.bead import bin_width, deposit, deposit_kernel, find_roads
from plant_models.firmware import execute
from plant_models.match import fit_kernel, match, place_kernel, visited, walk_kernel

SQUARE = [(0, 0), (20, 0), (20, 20), (0, 20), (0, 1)]


def test_bins_never_cross_roads_and_short_roads_are_one_bin():
    rows = [*road([(0, 0), (10.4, 0)]), *road([(0, 5), (1.4, 5)]), *road([(0, 9), (1.6, 9)])]
    roads = find_roads(execute([make(rows)], MACHINE).segments, 1.0)
    assert roads.bin_road.tolist() == [0] * 10 + [1] + [2] * 2
    np.testing.assert_allclose(np.diff(roads.edges), [1.04] * 10 + [1.4] + [0.8] * 2)
    np.testing.assert_allclose(roads.target, np.diff(roads.edges) * BEAD)
    np.testing.assert_allclose(roads.middle[10], [0.7, 5, 0])
    assert roads.length == pytest.approx(13.4)
    assert bin_width(0.84) == 1.0
    assert bin_width(0.4) == 0.4


@pytest.mark.parametrize(
    ("between", "count"),
    [
        ([], 1),
        ([{"kind": Kind.DWELL, "dwell": 1.0}], 1),
        ([{"kind": Kind.NOTHING}], 1),
        ([{"e": -0.01}], 2),
        ([{"kind": Kind.RETRACT}], 2),
        ([{"kind": Kind.BARRIER}], 2),
        ([{"kind": Kind.TOOL, "tool": 0}], 2),
        ([{"to": (10, 1)}, {"to": (10, 0)}], 2),
        ([{"kind": Kind.NOTHING, "to": (12, 0)}], 2),
    ],
)
def test_what_ends_a_road(between: list[dict[str, object]], count: int):
    rows = [*road([(0, 0), (10, 0)]), *between, {"to": (20, 0), "e": 0.02, "feed": 10}]
    roads = find_roads(execute([make(rows)], MACHINE).segments, 1.0)
    assert roads.bin_road[-1] + 1 == count


def test_a_file_matches_itself_exactly():
    x = execute([make([*road(SQUARE), *road([(5, 5), (9, 5), (5, 5)])])], MACHINE)
    roads = find_roads(x.segments, 1.0)
    low, high = match(roads, x.segments)
    on = roads.road >= 0
    np.testing.assert_allclose(low[on], roads.begin[on])
    np.testing.assert_allclose(high[on], roads.begin[on] + roads.path.length[on])
    assert np.isnan(low[~on]).all()
    assert visited(roads, low, high) == pytest.approx(1)


def test_a_line_run_forth_and_back_is_two_stretches():
    original = make(road([(0, 0), (4, 0), (0, 0), (4, 0.03)]))
    file = execute([subdivide(original, [1, 40, 7, 13])], MACHINE)
    roads = find_roads(execute([original], MACHINE).segments, 1.0)
    low, high = match(roads, file.segments)
    laid = np.isfinite(low)
    np.testing.assert_allclose(low[laid][1:], high[laid][:-1], atol=1e-6)
    assert high[laid][-1] == pytest.approx(roads.length)


def test_pieces_put_in_and_left_out_do_not_lose_the_way():
    original = make([*road(SQUARE), *road([(3, 3), (9, 3)]), *road([(3, 5), (9, 5)])])
    roads = find_roads(execute([original], MACHINE).segments, 1.0)
    changed = make(
        [*road(SQUARE), {"to": (0, 1, 1)}, {"to": (3, 5, 1)}, {"to": (3, 5, 0)}, {"to": (3, 3)}, {"e": 0.1},
         *road([(3, 3), (4, 3), (9, 3)])[1:], {"e": -0.1}, {"to": (9, 4)}, {"to": (3, 5)}, *road([(3, 5), (9, 5)])[1:]]
    )  # fmt: skip
    low, high = match(roads, execute([changed], MACHINE).segments)
    assert visited(roads, low, high) == pytest.approx(1)


def test_one_move_may_cover_several_of_a_road():
    original = make(road([(0, 0), (4, 0), (8, 0.02), (12, 0)]))
    roads = find_roads(execute([original], MACHINE).segments, 1.0)
    low, high = match(roads, execute([make(road([(0, 0), (12, 0)]))], MACHINE).segments)
    assert (low[0], high[0]) == pytest.approx((0, roads.length))


def test_another_part_is_not_visited():
    roads = find_roads(execute([make(road(SQUARE))], MACHINE).segments, 1.0)
    low, high = match(roads, execute([make(road([(x + 1, y + 1) for x, y in SQUARE]))], MACHINE).segments)
    assert visited(roads, low, high) == 0


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-5, 20), min_size=1, max_size=40), st.sampled_from([0.01, 0.13, 0.5]))
def test_every_drop_is_counted_once(values: list[float], dt: float):
    x = execute([make([*road(SQUARE), {"e": -0.02, "feed": 2}, *road([(5, 5), (9, 5)])])], MACHINE)
    roads = find_roads(x.segments, 1.0)
    flow = np.resize(values, (1, x.samples(dt, 3.0)))
    laid, off = deposit(roads, x, *match(roads, x.segments), Signal(0.0, dt, flow))
    assert laid.sum() + off == pytest.approx(np.maximum(flow, 0).sum() * dt, rel=1e-9, abs=1e-9)
    assert (laid >= 0).all()


def test_a_steady_flow_lays_by_the_time_spent():
    x = execute([make(road([(0, 0), (10, 0)]))], MACHINE)
    roads = find_roads(x.segments, 1.0)
    flow = Signal(0.0, 0.001, np.full((1, x.samples(0.001, 1.0)), 2.0))
    laid, off = deposit(roads, x, *match(roads, x.segments), flow)
    np.testing.assert_allclose(laid[1:-1], 2.0 * 1.0 / 10, rtol=1e-6)
    assert laid[0] == pytest.approx(2.0 * (0.1 + 10 / 500 / 2), rel=1e-3)
    assert laid.sum() == pytest.approx(2.0 * x.duration, rel=1e-6)
    assert off == pytest.approx(2.0, rel=2e-3)


def test_an_idle_tool_oozes_off_path():
    rows = [*road([(0, 0), (20, 0)]), {"kind": Kind.TOOL, "tool": 1}, {"to": (0, 0), "e": 20 * BEAD / AREA, "tool": 1}]
    x = execute([make(rows)], MACHINE)
    roads = find_roads(x.segments, 1.0)
    flow = np.zeros((2, x.samples(0.01)))
    flow[0] = 1.0
    laid, off = deposit(roads, x, *match(roads, x.segments), Signal(0.0, 0.01, flow, (0, 1)))
    assert laid[20:].sum() == 0
    assert off == pytest.approx(x.duration - laid.sum(), rel=1e-2)


def test_kernels_give_the_same_as_plain_python():
    x = execute([make([*road(SQUARE), *road([(5, 5), (9, 5), (5, 5.02)])])], MACHINE)
    roads = find_roads(x.segments, 1.0)
    y = execute([subdivide(make([*road(SQUARE), *road([(5, 5), (9, 5), (5, 5.02)])]), [3, 5])], MACHINE)
    path, run = roads.path, y.segments
    two = np.empty(len(run)), np.empty(len(run))
    arguments = (path.p0, path.p1, roads.road, roads.begin, run.p0, run.p1)
    plain = {"place_kernel": place_kernel.py_func, "fit_kernel": fit_kernel.py_func}
    namespace = walk_kernel.py_func.__globals__
    saved = {name: namespace[name] for name in plain}
    try:
        namespace.update(plain)
        lost = walk_kernel.py_func(*arguments, *two)
    finally:
        namespace.update(saved)
    one = match(roads, run)
    assert lost == 0
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a, b)
    flow, p = np.random.default_rng(0).uniform(-1, 5, (1, y.samples(0.05))), y.phases
    sums = []
    for kernel in (deposit_kernel, deposit_kernel.py_func):
        laid = np.zeros(len(roads.target))
        off = kernel(
            p.segment, p.t, p.duration, p.s, p.v, p.a, run.length, *one, y.channel, flow, 0.05, roads.edges, laid
        )  # fmt: skip
        sums.append(np.append(laid, off))
    np.testing.assert_array_equal(*sums)
