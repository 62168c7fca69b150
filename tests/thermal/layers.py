"""Layers to plan on: walls whose corners cool slower, and problems of any kind for hypothesis."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from gcodectl.columns import Floats
from gcodectl.thermal.graph import Lattice
from gcodectl.thermal.partitions import Partitions, partition, partitions_at
from gcodectl.thermal.problem import Problem, Weights, pose
from gcodectl.thermal.surface import Band, Head, Surface

BAND = Band()
HEAD = Head(15.0, 40.0, 15.0)
PERIMETER = 248.5
"""px: 88 in at 40 px/s = 850 in/min."""
CORNERS = PERIMETER * np.array([0.0, 36.0, 44.0, 80.0, 88.0]) / 88.0


def wall(step: float = 5.0, rest: float = 103.0, laid_at: float = 25.2) -> Surface:
    """The thin wall's layer, in px and s; laid at one speed from time 0 on."""
    s = np.arange(0.0, PERIMETER, step)
    near = np.exp(-((np.abs(s[:, None] - CORNERS).min(axis=1) / 12.0) ** 2))
    b1 = -(0.0105 - 0.0012 * near)
    b0 = -b1 * (rest + 3.0 * near - BAND.ambient)
    return Surface(s=s, b0=b0, b1=b1, t0=s / laid_at, temp0=np.full(len(s), BAND.deposition))


def posed(
    surface: Surface, partitions: Partitions, head: Head = HEAD, band: Band = BAND, weights: Weights | None = None,
    entry: float | None = None, change: float = math.inf, margin: Floats | float = 0.0,
) -> Problem:  # fmt: skip
    """A problem as `plan_speeds` poses it."""
    return pose(surface, partitions, head, band, weights or Weights(), entry, change, margin)


def paper_size(fine: int = 1) -> tuple[Problem, Lattice]:
    """The published size: 165 to 195 s by 0.5, 15 to 40 px/s by 1, 7 partitions; or a grid finer in each direction."""
    surface = wall(5.0 / fine)
    parts = partition(surface, HEAD, BAND, most=7, gain=0.0)
    border = np.zeros(len(parts) + 1, dtype=np.int64)
    grid = Lattice(165.0, 0.5 / fine, border, 60 * fine + 1, 15.0, 1.0 / fine, border, 25 * fine + 1)
    return posed(surface, parts), grid


@st.composite
def small_problems(draw: st.DrawFn) -> tuple[Problem, Lattice]:
    """Few nodes, and anything that a problem can have: reheated stretches, pauses, means, an entry speed, rules."""
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    count = draw(st.integers(1, 4))
    sizes = rng.integers(1, 4, count)
    m = int(sizes.sum())
    s = np.cumsum(rng.uniform(0.5, 6.0, m))
    b1 = -rng.uniform(0.005, 0.02, m)
    t0 = np.sort(rng.uniform(0.0, 20.0, m)) + np.where(rng.random(m) < 0.2, 30.0, 0.0)
    rest = rng.uniform(60.0, 140.0, m)
    surface = Surface(s=s, b0=-b1 * (rest - 24.0), b1=b1, t0=t0, temp0=rng.uniform(100.0, 250.0, m))
    parts = partitions_at(surface, np.cumsum(sizes) - sizes, HEAD, float(s[-1]) + 3.0)
    parts = parts.replace(pause=np.where(rng.random(count) < 0.2, rng.uniform(0.0, 3.0, count), 0.0))
    weights = Weights(draw(st.sampled_from([0.0, 1.0])), draw(st.sampled_from([0.0, 2.0])), draw(st.booleans()))
    head = Head(2.0, 10.0, draw(st.sampled_from([0.5, 3.0, 20.0, math.inf])))
    parts = parts.replace(slowest=np.full(count, 2.0), fastest=rng.uniform(5.0, 10.0, count))
    band = Band(low=20.0 + 5.0, best=110.0, high=draw(st.sampled_from([140.0, 240.0])), ambient=24.0)
    entry, change = draw(st.sampled_from([None, 4.0])), draw(st.sampled_from([math.inf, 0.3]))
    border = np.zeros(count + 1, dtype=np.int64)
    grid = Lattice(draw(st.floats(0.0, 60.0)), 0.7, border, 40, 2.0, 1.0, border, 8)
    return pose(surface, parts, head, band, weights, entry, change, 0.0), grid
