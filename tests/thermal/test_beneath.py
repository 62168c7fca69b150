"""What lies beneath a location: the grid against a search through everything, and its kernels as plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from gcodectl.columns import Floats
from gcodectl.thermal import beneath
from gcodectl.thermal.beneath import FLAT, HELD, MEMORY, Ground, S, T, X, Y, Z

BEAD = 4.0


def places(*rows: tuple[float, float, float, float]) -> Floats:
    """Locations at x, y, z, laid at path s, at the time s / 10."""
    out = np.zeros((len(rows), HELD))
    for k, (x, y, z, s) in enumerate(rows):
        out[k, [X, Y, Z, S, T]] = x, y, z, s, s / 10.0
    return out


def searched(laid: Floats, one: Floats) -> float:
    """The path of what lies beneath by the rules, each cell's last location first; NaN for nothing."""
    last: dict[tuple[int, int], Floats] = {}
    for row in laid:
        last[int(np.floor(row[X] / (BEAD / 2))), int(np.floor(row[Y] / (BEAD / 2)))] = row
    some = []
    for row in last.values():
        drop, away = one[Z] - row[Z], float(np.hypot(one[X] - row[X], one[Y] - row[Y]))
        if FLAT * BEAD < drop <= BEAD and one[S] - row[S] > MEMORY * BEAD and away <= BEAD:
            some.append((away, row))
    near = [row for away, row in some if away <= BEAD / 2]
    if near:
        return float(max(near, key=lambda row: row[S])[S])
    return float(min(some, key=lambda pair: pair[0])[1][S]) if some else np.nan


@pytest.mark.parametrize("seed", range(4))
def test_the_grid_finds_what_a_search_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    laid = places(*[(*rng.uniform(-30, 30, 2), float(rng.choice([0.0, 1.5, 3.0])), float(k)) for k in range(400)])
    asked = places(*[(*rng.uniform(-33, 33, 2), 4.0, 1000.0) for _ in range(300)])
    ground = Ground(BEAD)
    for part in np.array_split(laid, 7):
        ground.lay(part)
    wanted = np.array([searched(laid, one) for one in asked])
    assert 10 < np.isnan(wanted).sum() < 280
    assert np.array_equal(ground.find(asked)[:, S], wanted, equal_nan=True)


def test_beside_bridges_and_the_path_itself_do_not_count() -> None:
    ground = Ground(BEAD)
    ground.lay(places((0, 0, 1.0, 100.0), (40, 0, 1.0, 200.0)))
    asked = places((0, 0, 1.2, 900), (0, 0, 5.5, 900), (0, 0, 2.0, 110), (0, 0, 2.0, 900), (0, 5, 2.0, 900))
    assert ground.find(asked)[:, S].tolist() == pytest.approx([np.nan, np.nan, np.nan, 100.0, np.nan], nan_ok=True)


def test_the_last_pass_within_the_nozzle_counts_before_a_nearer_one() -> None:
    ground = Ground(BEAD)
    ground.lay(places((0.1, 0.1, 1.0, 100.0), (-1.5, 0.1, 1.0, 300.0), (3.0, 0.1, 1.0, 500.0)))
    assert ground.find(places((0.2, 0.1, 2.0, 900.0)))[0, S] == 300.0


def test_memory_is_bounded_by_forgetting_what_was_laid_longest_ago(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(beneath, "MOST", 500)
    ground = Ground(BEAD)
    for k in range(40):
        ground.lay(places(*[(10.0 * i, 10.0 * k, 1.0, 1000.0 * k + i) for i in range(100)]))
    assert len(ground._keys) <= 8192
    asked = places(*[(10.0 * i, 10.0 * k, 2.0, 1e6) for k in (0, 38, 39) for i in range(100)])
    found = np.isfinite(ground.find(asked)[:, S]).reshape(3, 100).mean(axis=1)
    assert found.tolist() == [0.0, 1.0, 1.0]


def test_locations_are_laid_until_one_lies_over_another() -> None:
    ground = Ground(BEAD)
    ring = [(50 * np.cos(a), 50 * np.sin(a), 1.5 * a / 6.2832, 50 * a) for a in np.arange(0.0, 9.0, 0.04)]
    over = ground.over(places(*ring), 0, len(ring))
    assert over * 0.04 == pytest.approx(2 * np.pi, abs=0.15)
    ground.clear()
    assert ground.over(places(*ring), over, len(ring)) == len(ring)


def test_plain_python_finds_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(9)
    laid = places(*[(*rng.uniform(-12, 12, 2), 1.0, float(k)) for k in range(60)])
    asked = places(*[(*rng.uniform(-12, 12, 2), 2.5, 500.0) for _ in range(40)])
    ground = Ground(BEAD)
    ground.lay(laid)
    wanted = ground.find(asked)
    for name in [name for name in vars(beneath) if name.endswith("_kernel")]:
        monkeypatch.setattr(beneath, name, getattr(vars(beneath)[name], "py_func", vars(beneath)[name]))
    plain = Ground(BEAD)
    plain.lay(laid)
    assert np.array_equal(plain.find(asked), wanted, equal_nan=True)
    assert plain.over(asked, 0, len(asked)) == int(np.flatnonzero(np.isfinite(wanted[:, S]))[0])
