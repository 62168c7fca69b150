"""Slowing a layer: never too hot where that can be, nothing slower than it must be; the kernel as plain Python."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import linprog

from gcodectl.columns import Floats
from gcodectl.thermal import slowing
from gcodectl.thermal.slowing import Layer, slow_kernel, slow_layer
from gcodectl.thermal.surface import Band, seconds_to, temperature

BAND = Band()
AMBIENT, DEPOSITION, BEST, HOTTEST = BAND.ambient, BAND.deposition, BAND.best, 148.0


def layer(seed: int, age: float = 60.0, most: float = 3.0) -> Layer:
    """Six partitions of eight locations; what lies beneath was laid `age` s ago, in the same order."""
    rng = np.random.default_rng(seed)
    part = np.repeat(np.arange(6), 8)
    part_dep, part_fix = rng.uniform(2.0, 6.0, 6), rng.choice([0.0, 1.0], 6)
    dep = (np.tile(np.arange(8), 6) + 0.5) / 8.0 * part_dep[part]
    fix = part_fix[part] * (np.tile(np.arange(8), 6) > 3)
    before = np.concatenate([[0.0], np.cumsum(part_dep + part_fix)[:-1]])
    return Layer(
        part=part, dep=dep, fix=fix, part_dep=part_dep, part_fix=part_fix, most=rng.uniform(1.0, most, 6),
        b0=np.full(48, 1.007), b1=rng.uniform(-0.0104, -0.0098, 48), since=before[part] + dep + fix - age, cools=0.0,
    )  # fmt: skip


def met(one: Layer, wait: float, stretch: Floats) -> tuple[Floats, float]:
    """Temperatures beneath, and when the layer ends."""
    lasts = stretch * one.part_dep + one.part_fix
    begin = wait + np.cumsum(lasts) - lasts
    times = begin[one.part] + stretch[one.part] * one.dep + one.fix
    return temperature(times - one.since, one.b0, one.b1, AMBIENT, DEPOSITION), wait + float(lasts.sum())


def slowed(
    one: Layer, most_wait: float = np.inf, time: float = 1.0, alpha: float = 0.0
) -> tuple[Floats, float, float, Floats]:
    plan = slow_layer(one, BAND, HOTTEST, time, alpha, most_wait)
    return *met(one, plan.wait, plan.stretch), plan.wait, plan.stretch


@pytest.mark.parametrize("seed", range(5))
def test_nothing_is_too_hot_and_all_is_near_the_best(seed: int) -> None:
    one = layer(seed)
    temperatures, _, wait, stretch = slowed(one)
    assert temperatures.max() <= HOTTEST + 1e-6
    assert abs(temperatures.mean() - BEST) < 5.0
    assert wait > 0.0
    assert (stretch >= 1.0).all()
    assert (stretch <= one.most + 1e-12).all()


@pytest.mark.parametrize("seed", range(8))
def test_a_layer_ends_as_soon_as_a_linear_programme_says_it_can(seed: int) -> None:
    one = layer(seed, age=110.0)
    ready = one.since + seconds_to(140.0, one.b0, one.b1, AMBIENT, DEPOSITION)
    n, parts = 6, np.stack([one.part_dep, one.part_fix, one.most])
    places = np.stack([ready, one.dep, one.fix, one.part.astype(np.float64)])
    need, stretch = np.empty(n + 1), np.ones(n)
    wait, end = slow_kernel(places, parts, np.inf, 0.0, need, stretch)
    lasts = stretch * one.part_dep + one.part_fix
    times = wait + (np.cumsum(lasts) - lasts)[one.part] + stretch[one.part] * one.dep + one.fix
    assert (times >= ready - 1e-9).all()
    # wait and stretches, least wait first, then the earliest end
    rows = np.zeros((48, n + 1))
    rows[:, 0] = -1.0
    for i, j in enumerate(one.part):
        rows[i, 1 : j + 1], rows[i, j + 1] = -one.part_dep[:j], -one.dep[i]
    fixed = (np.cumsum(one.part_fix) - one.part_fix)[one.part] + one.fix
    bounds = [(0.0, None), *((1.0, most) for most in one.most)]
    least = linprog([1.0] + [0.0] * n, A_ub=rows, b_ub=fixed - ready, bounds=bounds)
    assert wait == pytest.approx(least.fun, abs=1e-6)
    bounds[0] = (wait, wait + 1e-9)
    best = linprog([1.0, *one.part_dep], A_ub=rows, b_ub=fixed - ready, bounds=bounds)
    assert end == pytest.approx(best.fun + one.part_fix.sum(), abs=1e-5)


def test_without_a_wait_all_is_as_slow_as_it_may_be_and_what_stays_hot_stays() -> None:
    one = layer(1, age=30.0)
    temperatures, _, wait, stretch = slowed(one, most_wait=0.0)
    assert wait == 0.0
    assert temperatures.max() > HOTTEST
    assert stretch[:-1] == pytest.approx(one.most[:-1])


def test_time_that_is_dear_brings_it_nearer_to_the_hottest() -> None:
    one = layer(2)
    cheap, dear = slowed(one, time=0.01), slowed(one, time=300.0)
    assert dear[1] < cheap[1]
    assert cheap[0].max() < dear[0].max() <= HOTTEST + 1e-6


def with_a_corner(one: Layer, rate: float = -0.0083) -> Layer:
    """The layer with a location that cools far more slowly."""
    b1 = one.b1.copy()
    b1[20] = rate
    return dataclasses.replace(one, b1=b1)


def test_one_hot_corner_among_many_good_is_not_waited_for() -> None:
    one = with_a_corner(layer(2, age=230.0))
    everywhere, _, waits, _ = slowed(one)
    assert waits > 30.0, "with no share to spare, all wait for it"
    assert (everywhere < BAND.low).sum() == 0
    temperatures, _, wait, _ = slowed(one, alpha=0.05)
    assert wait < 0.4 * waits
    assert (temperatures > HOTTEST).sum() == 1
    assert abs(np.median(temperatures) - BEST) < abs(np.median(everywhere) - BEST)
    assert slow_layer(one, BAND, HOTTEST, 1.0, 0.05).hot == 1


def test_a_corner_is_not_waited_for_until_all_others_are_too_cold() -> None:
    cold = with_a_corner(dataclasses.replace(layer(2, age=330.0), b0=np.full(48, 0.9)), -0.0075)
    sliced, _ = met(cold, 0.0, np.ones(6))
    assert (sliced > HOTTEST).any()
    assert (sliced < BAND.low).mean() > 0.5
    _, _, wait, stretch = slowed(dataclasses.replace(cold, cools=np.inf), alpha=0.05)
    assert (wait, stretch.tolist()) == (0.0, [1.0] * 6)


def test_what_is_hot_all_over_is_mended_but_for_alpha() -> None:
    for time in (1.0, 300.0):
        temperatures = slowed(layer(3), alpha=0.05, time=time)[0]
        assert (temperatures > HOTTEST + 0.01).sum() <= (2 if time > 1.0 else 0)


def test_its_own_roads_are_given_the_time_to_cool() -> None:
    one = layer(3, age=500.0, most=30.0)
    quick = slowed(one)[1]
    lasting = dataclasses.replace(one, cools=2.0 * quick)
    assert slowed(lasting)[1] == pytest.approx(2.0 * quick, abs=1e-3)
    assert slowed(dataclasses.replace(one, cools=np.inf))[3] == pytest.approx(one.most)


def test_plain_python_slows_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    one = layer(4)
    wanted = slowed(one)
    for name in ("need_kernel", "forward_kernel", "slow_kernel"):
        kernel = getattr(slowing, name)
        monkeypatch.setattr(slowing, name, getattr(kernel, "py_func", kernel))
    found = slowed(one)
    assert found[2] == pytest.approx(wanted[2], rel=1e-12)
    assert found[3] == pytest.approx(wanted[3], rel=1e-12)
