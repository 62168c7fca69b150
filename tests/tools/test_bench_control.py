"""The thermal bench's control cells, on the smallest of everything."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from thermal_bench.closed_loop import WARM_UP, objective, printed, seen
from thermal_bench.control import control_targets
from thermal_bench.plans import hexagon_cells, hexagon_folder, size_cell

from gcodectl.thermal.problem import Weights
from plant_models.cooling import cooling_part


def test_the_published_grid() -> None:
    cell = size_cell(2, 1)
    assert cell["partitions"] == 7
    assert cell["dp_nodes"] == 8 * 61 * 26
    assert cell["difference"] <= 1e-9
    assert cell["astar_nodes"] < cell["dp_nodes"]
    assert cell["plan_cost"] <= cell["exact_cost"]
    assert 0.0 <= cell["gap_to_bound"] <= 0.01
    names = {row["name"]: row for row in control_targets([cell])}
    assert names["control, published grid / 1: A* less DP"]["met"]
    assert not any("hexagon" in name for name in names)


def test_a_planned_layer_of_the_wall_beats_the_fixed_time_inside_the_band() -> None:
    fixed = printed(cooling_part("wall", 1), WARM_UP + 1, None)
    planned = printed(cooling_part("wall", 1), WARM_UP + 1, Weights())
    for one, other in zip(fixed[:WARM_UP], planned[:WARM_UP], strict=True):
        np.testing.assert_array_equal(one.beneath, other.beneath)
    last, band = planned[-1], cooling_part("wall", 1).band
    assert objective(last, band.best) < 0.2 * objective(fixed[-1], band.best)
    assert last.wait < 0.75 * fixed[-1].wait
    assert ((last.beneath > band.low) & (last.beneath < band.high)).all()


def test_what_later_roads_touch_is_seen_from_the_readings() -> None:
    part = cooling_part("chassis", 0)
    cooling, delay = seen(part, part.at_speed(126.0), np.full(len(part.s), np.nan))
    true = part.truth()
    again = true.t0 > part.deposited + 1e-9
    found = ~np.isnan(delay)
    assert again.sum() > 20
    assert found[again].all()
    assert found[~again].sum() < 0.02 * len(part.s)
    assert np.abs(part.deposited[-1] + delay - true.t0)[again].max() < 2.5
    assert np.median(np.abs(cooling.b1 / true.b1 - 1.0)) < 0.05


@pytest.mark.skipif(hexagon_folder() is None, reason="no measured data beside the checkout")
def test_the_hexagon_meets_its_targets() -> None:
    folder = hexagon_folder()
    assert folder is not None
    cells = hexagon_cells(folder)
    assert all(cell["fixed"] == pytest.approx(1546.7, abs=0.05) for cell in cells)
    rows = control_targets(cells)
    assert [row["met"] for row in rows if row["name"].endswith("objective")] == [True, True]
