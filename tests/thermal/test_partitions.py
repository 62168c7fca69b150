import itertools

import numpy as np
import pytest
from layers import BAND, HEAD, PERIMETER, wall

from gcodectl.errors import UsageError
from gcodectl.thermal.partitions import partition, segment_kernel
from gcodectl.thermal.surface import Surface


def segmented(level: list[float], wall: list[int], counts: int) -> tuple[np.ndarray, np.ndarray]:
    values = np.array(level)
    n = len(values)
    first, squares = np.zeros((counts, counts), dtype=np.int64), np.empty(counts)
    segment_kernel.py_func(
        np.concatenate(([0.0], np.cumsum(values))), np.concatenate(([0.0], np.cumsum(values**2))), np.array(wall),
        np.empty((2, n + 1)), np.empty((counts, n + 1), dtype=np.int64), squares, first,
    )  # fmt: skip
    return squares, first


def test_no_other_cuts_give_less() -> None:
    level = [float(x) for x in np.random.default_rng(0).normal(size=10)]
    squares, first = segmented(level, [0] * 10, 4)
    for count in range(1, 5):
        options = [(0, *cut) for cut in itertools.combinations(range(1, 10), count - 1)]
        costs = [sum(np.var(part) * len(part) for part in np.split(np.array(level), cut[1:])) for cut in options]
        assert squares[count - 1] == pytest.approx(min(costs))
        assert tuple(first[count - 1, :count]) == options[int(np.argmin(costs))]


def test_no_partition_reaches_across_a_break() -> None:
    squares, first = segmented([1.0, 1.0, 1.0, 1.0, 9.0, 9.0], [0, 0, 1, 1, 1, 1], 3)
    assert np.isinf(squares[0])
    assert list(first[1, :2]) == [0, 2]
    assert list(first[2, :3]) == [0, 2, 4]


def test_corners_of_the_wall_are_partitions_of_their_own() -> None:
    parts = partition(wall(1.0), HEAD, BAND, most=9)
    assert 5 <= len(parts) <= 9
    assert parts.begin[0] == 0.0
    assert parts.length.sum() == pytest.approx(PERIMETER, abs=1.0)
    for corner in (36.0, 80.0):
        inside = np.searchsorted(parts.begin, corner / 88.0 * PERIMETER, side="right") - 1
        assert parts.length[inside] < 50.0


def test_a_stretch_heated_again_is_parted() -> None:
    surface = wall()
    t0 = np.array(surface.t0)
    t0[20:25] += 60.0
    parts = partition(surface.replace(t0=t0), HEAD, BAND, most=1)
    assert list(parts.first) == [0, 20, 25]


def test_alike_locations_are_one_partition_and_nothing_is_refused() -> None:
    count = 12
    same = Surface(
        s=np.arange(count, dtype=float), b0=np.full(count, 0.8), b1=np.full(count, -0.01), t0=np.zeros(count),
        temp0=np.full(count, 240.0),
    )  # fmt: skip
    assert len(partition(same, HEAD, BAND)) == 1
    with pytest.raises(UsageError, match="a surface with locations"):
        partition(same[:0], HEAD, BAND)
