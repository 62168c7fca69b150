"""The bench's arithmetic on cells that are made up: targets, shares won, fronts, intervals, drift."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from flow_bench.cell import drift_draws, interval
from flow_bench.fronts import equal_time, tried_front
from flow_bench.targets import best_rival, summary, targets, won, worse_than_pa

from plant_models.score import Score


def score(time_s: float, rmse: float) -> Score:
    return Score(rmse, 0.0, time_s, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 0)


def cell(structure: str, ours: float | None, drifted: float = 0.2, **rmse: float) -> dict[str, Any]:
    base = {"none": 0.4, "coasting": 0.4, "pa": 0.2, "expert": 0.1, "basis": 0.3, "whole": 0.04, **rmse}
    columns: dict[str, Any] = {
        name: {"rmse": one, "off_path": 0.1, "time_s": 100.0, "drift_rmse": one + 0.1} for name, one in base.items()
    }
    columns["expert"]["time_s"] = 160.0
    columns["ours"] = {"rmse": ours, "off_path": 0.005, "time_s": 104.0, "drift_rmse": drifted}
    return {
        "plant": "p", "part": f"{structure} {ours}", "structure": structure, "columns": columns,
        "expert_at_equal_time": {"time_s": 104.0, "rmse": 0.15, "off_path": 0.0},
    }  # fmt: skip


def by_name(rows: list[dict[str, Any]], word: str) -> dict[str, Any]:
    (row,) = [one for one in rows if word in one["name"]]
    return row


def test_targets_say_what_was_reached() -> None:
    cells = [cell("yield", 0.02), cell("yield", 0.04), cell("yield", 0.06), cell("linear", 0.1)]
    rows = targets(cells, 10)
    rival = by_name(rows, "over the best rival, median")
    assert rival["value"] == pytest.approx(0.4)
    assert rival["met"]
    assert not rival["aim_met"]
    assert rival["interval"][0] <= 0.4 <= rival["interval"][1]
    assert by_name(rows, "time of ours over none, median")["value"] == pytest.approx(1.04)
    assert by_name(rows, "less expert's")["value"] == pytest.approx(-0.05)
    assert by_name(rows, "worse than pa")["met"]
    assert by_name(rows, "over whole")["value"] == pytest.approx(1.25)
    assert by_name(rows, "below expert's front")["value"] == 1.0
    assert by_name(rows, "below expert's front")["met"]
    assert by_name(rows, "off_path")["met"]
    assert by_name(rows, "most")["met"]


def test_what_drifted_plants_keep_of_the_gain() -> None:
    rows = targets([cell("yield", 0.05, drifted=0.18)], 10)
    kept = by_name(rows, "keep")
    assert kept["value"] == pytest.approx((0.2 - 0.18) / (0.1 - 0.05))
    assert not kept["met"]
    assert not by_name(targets([cell("yield", 0.3)], 10), "keep")["met"]


def test_a_cell_that_failed_is_lost_and_not_left_out() -> None:
    failed = cell("yield", None)
    failed["columns"]["ours"] |= {"off_path": None, "time_s": None, "drift_rmse": None, "error": "refused"}
    rows = targets([failed], 11)
    assert not any(row["met"] for row in rows)
    assert worse_than_pa([failed]) == ["p, yield None"]
    assert won([failed], "ours") == 0.0
    (row,) = [row for row in summary([failed]) if row["column"] == "ours"]
    assert row["failed"] == 1
    assert row["rmse"] == np.inf
    assert targets([], 0) == []


def test_winning_is_having_the_least_error_of_all_but_whole() -> None:
    cells = [cell("yield", 0.05), cell("yield", 0.15)]
    assert won(cells, "ours") == 0.5
    assert won(cells, "expert") == 0.5
    assert best_rival(cells[0]) == 0.1
    assert worse_than_pa([*cells, cell("melt", 0.25)]) == ["p, melt 0.25"]


def test_a_front_has_what_nothing_beats_in_both() -> None:
    front = tried_front([score(100, 0.3), score(100, 0.2), score(150, 0.25), score(160, 0.1)])
    assert [(one["time_s"], one["rmse"]) for one in front] == [(100, 0.2), (160, 0.1)]
    assert equal_time(front, 159.0) == front[1]
    assert equal_time(front, 120.0) == front[0]
    assert equal_time(front, 90.0) is None


def test_drift_draws_are_the_corners_in_an_order_of_the_seed() -> None:
    draws = drift_draws(8, 3)
    assert sorted(draws[:4]) == sorted(draws[4:]) == [(0.85, 0.85), (0.85, 1.15), (1.15, 0.85), (1.15, 1.15)]
    assert draws == drift_draws(8, 3)
    assert len(drift_draws(3, 0)) == 3


def test_an_interval_is_students() -> None:
    low, high = interval([1.0, 2.0, 3.0])
    assert (low + high) / 2 == pytest.approx(2.0)
    assert high - 2.0 == pytest.approx(4.3027 / 3**0.5, rel=1e-4)
