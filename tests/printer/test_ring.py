"""The ring: what it fixes is what the whole-file planner finds for the same blocks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_models.gantry import E_ONLY, PATH
from plant_models.planner import corner_kernel, junction_kernel, lookahead_kernel
from plant_models.printer.ring import Block, Ring, phases_of

STEP = st.tuples(
    st.floats(-3.1, 3.1), st.sampled_from([0.01, 0.1, 1.0, 9.0]), st.sampled_from([0.0, 0.002, 0.02]),
    st.sampled_from([5.0, 50.0, 300.0]), st.sampled_from([100.0, 900.0]), st.sampled_from(["path"] * 6 + ["e", "rest"]),
)  # fmt: skip


def make(angle: float, length: float, ratio: float, speed: float, accel: float, what: str) -> Block:
    way = (math.cos(angle), math.sin(angle), 0.0) if what != "e" else (0.0, 0.0, 0.0)
    end = (way[0] * length, way[1] * length, 0.0)
    block = Block(E_ONLY if what == "e" else PATH, (0.0, 0.0, 0.0), end, way, length, ratio * length, speed, accel)
    block.corner, block.e_corner, block.rest = 5.0, 1.0, what == "rest"
    return block


def junctions(blocks: list[Block], classic: bool) -> np.ndarray:
    columns = [np.array([getattr(block, name) for block in blocks]) for name in ("length", "speed", "accel", "corner")]
    return junction_kernel.py_func(
        np.array([block.kind for block in blocks], dtype=np.int8), np.array([block.way for block in blocks]),
        np.array([block.ratio for block in blocks]), *columns, np.array([block.rest for block in blocks]),
        np.array([block.e_corner for block in blocks]), classic,
    )  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(st.lists(STEP, min_size=1, max_size=30), st.booleans())
def test_all_blocks_at_once_are_planned_as_the_whole_file(steps: list[tuple], classic: bool):
    blocks = [make(*step) for step in steps]
    ring = Ring(len(blocks) + 3, classic)
    for block in blocks:
        ring.add(block)
    found = [ring.begin()[1:] for _ in blocks]
    limit = junctions(blocks, classic)
    lengths, accels = np.array([b.length for b in blocks]), np.array([b.accel for b in blocks])
    v2 = lookahead_kernel(limit, lengths, accels)
    np.testing.assert_allclose(found, np.stack([v2[:-1], v2[1:]], axis=1), rtol=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.lists(STEP, min_size=1, max_size=30), st.integers(4, 9))
def test_every_plan_can_stop_at_the_end_of_what_is_known(steps: list[tuple], places: int):
    ring, entry = Ring(places, False), 0.0
    for block in (make(*step) for step in steps):
        if ring.free(running=True) == 0:
            first, at, leave = ring.begin()
            assert at == entry
            assert abs(leave - at) <= 2 * first.accel * first.length * (1 + 1e-9) + 1e-12
            entry = leave
        ring.add(block)
        back = 0.0
        for other in reversed(ring.waiting):
            back = min(other.limit, back + 2 * other.accel * other.length)
            assert other.back == back
        assert entry <= ring.waiting[0].back + 1e-9 or len(ring.waiting) == 1
    while ring.waiting:
        _, at, entry_after = ring.begin()
        assert at == entry
        entry = entry_after
    assert entry == 0.0
    assert ring.seconds == 0.0


@settings(max_examples=60, deadline=None)
@given(STEP, st.floats(0, 1), st.floats(0, 1))
def test_phases_cover_the_block(step: tuple, enter: float, leave: float):
    block = make(*step)
    most = min(block.speed**2, 2 * block.accel * block.length)
    phases = phases_of(block, enter * most, leave * most)
    assert all(duration > 0 for duration, *_ in phases)
    assert sum((v + 0.5 * a * duration) * duration for duration, _, v, a in phases) == pytest.approx(block.length)
    assert max(max(v, v + a * duration) for duration, _, v, a in phases) <= block.speed * (1 + 1e-9)
    _, _, v, a = phases[-1]
    assert v + a * phases[-1][0] == pytest.approx(math.sqrt(leave * most), abs=1e-6)


def test_a_ring_of_sixteen_places_holds_fifteen():
    ring = Ring(16, False)
    for _ in range(15):
        assert ring.free(running=False) > 0
        ring.add(make(0.0, 1.0, 0.0, 10.0, 100.0, "path"))
    assert ring.free(running=False) == 0
    ring.begin()
    assert ring.free(running=True) == 0
    assert ring.free(running=False) == 1
    ring.clear()
    assert ring.free(running=False) == 15


@pytest.mark.parametrize("classic", [False, True])
def test_the_corner_is_the_same_without_the_compiler(classic: bool):
    rng = np.random.default_rng(3)
    for _ in range(50):
        a, b = rng.normal(size=(2, 3))
        a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
        rest = (*a.tolist(), *b.tolist(), 0.002, 0.003, 40.0, 80.0, 30.0, 5.0, 1.0, classic)
        assert corner_kernel(*rest) == pytest.approx(corner_kernel.py_func(*rest), rel=1e-12)


def test_straight_on_is_taken_at_speed_and_a_turn_back_at_rest():
    same, back = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
    rest = (0.0, 0.0, 1e6, 1e6, 30.0, 5.0, 1.0, False)
    assert corner_kernel.py_func(*same, *same, *rest) == 900.0
    assert corner_kernel.py_func(*same, *back, *rest) == 0.0
    assert corner_kernel.py_func(*same, 0.0, 1.0, 0.0, *rest) == pytest.approx(25.0)
