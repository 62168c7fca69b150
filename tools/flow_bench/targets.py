"""The targets of the bench, each with its value; medians over cells, intervals over seeds.

`rivals` are what firmware and the paper can do: pa, expert, coasting, basis. A cell is won where ours has the least
rmse of all but whole, which learned on the very part. Kept gain: how much of (best rival - ours) is left on the drifted
plants, where the rivals print what they were tuned to at nominal; the same libraries and the same draws for both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from flow_bench.cell import COLUMNS, interval

Cell = dict[str, Any]
RIVALS = ("pa", "expert", "coasting", "basis")


def value(cell: Cell, column: str, name: str = "rmse") -> float:
    """Return a number of a column, infinite where that way failed or was not measured."""
    found = cell["columns"].get(column, {}).get(name)
    return float("inf") if found is None else float(found)


def best_rival(cell: Cell, name: str = "rmse") -> float:
    """Return the least rmse among the rivals."""
    return min(value(cell, rival, name) for rival in RIVALS)


def targets(cells: Sequence[Cell], max_trials: int) -> list[dict[str, Any]]:
    """Return the rows of the targets; none where ours was not measured."""
    ours = [cell for cell in cells if "ours" in cell["columns"]]
    hard = [cell for cell in ours if cell["structure"] != "linear"]
    linear = [cell for cell in ours if cell["structure"] == "linear"]
    rows: list[dict[str, Any]] = []
    if hard:
        rows += [
            _below("nonlinear: rmse of ours over the best rival, median", hard, _over_rival, 0.5, aim=0.25),
            _below("nonlinear: time of ours over none, median", hard, _time, 1.10, aim=1.05),
            _below("nonlinear: time of ours over none, worst", hard, _time, 1.10, reduce=np.max),
            _below("nonlinear: rmse of ours, median", hard, lambda cell: value(cell, "ours"), 0.03, kind="aim"),
            _below(
                "nonlinear: share of cells where ours lies below expert's front",
                hard, lambda cell: -float(_below_front(cell)), -1.0, reduce=np.mean,
            ),
        ]  # fmt: skip
    if linear:
        rows.append(_below("linear: rmse of ours less expert's at equal time, median", linear, _behind_expert, 0.01))
    if ours:
        worse = worse_than_pa(ours)
        rows += [
            _row("cells where ours is worse than pa", len(worse), "cells", "<= 0", not worse),
            _below("rmse of ours over whole, median", ours, _over_whole, 1.5, aim=1.1),
            _below("off_path of ours, median", ours, lambda cell: value(cell, "ours", "off_path"), 0.01),
            _kept(ours),
            _row(
                "trials of the training routine a library cost, most", max_trials, "trials", "<= 10", max_trials <= 10
            ),
        ]
    return rows


def worse_than_pa(cells: Sequence[Cell]) -> list[str]:
    """Return `plant, part` of the cells where ours has the greater rmse than pressure advance."""
    return [f"{cell['plant']}, {cell['part']}" for cell in cells if value(cell, "ours") > value(cell, "pa")]


def won(cells: Sequence[Cell], column: str) -> float:
    """Return the share of cells where a column has the least rmse of all but whole."""
    rest = [one for one in (*RIVALS, "none", "ours") if one != column]
    return float(np.mean([value(cell, column) < min(value(cell, one) for one in rest) for cell in cells]))


def _over_rival(cell: Cell) -> float:
    return value(cell, "ours") / max(best_rival(cell), 1e-9)


def _over_whole(cell: Cell) -> float:
    return value(cell, "ours") / max(value(cell, "whole"), 1e-9)


def _time(cell: Cell) -> float:
    return value(cell, "ours", "time_s") / value(cell, "none", "time_s")


def _behind_expert(cell: Cell) -> float:
    there = cell.get("expert_at_equal_time")
    return value(cell, "ours") - (float("inf") if there is None else there["rmse"])


def _below_front(cell: Cell) -> bool:
    there = cell.get("expert_at_equal_time")
    return there is None or value(cell, "ours") < there["rmse"]


def _kept(cells: Sequence[Cell]) -> dict[str, Any]:
    kept = []
    for cell in cells:
        gain = best_rival(cell) - value(cell, "ours")
        if np.isfinite(gain) and gain > 0:
            drifted = best_rival(cell, "drift_rmse") - value(cell, "ours", "drift_rmse")
            kept.append(drifted / gain)
    name = "share of the gain over the best rival that drifted plants keep, median"
    middle = float(np.median(kept)) if kept else None
    return _row(name, middle, "1", ">= 0.5", middle is not None and middle >= 0.5, cells=len(kept))


def _below(
    name: str,
    cells: Sequence[Cell],
    of: Callable[[Cell], float],
    most: float,
    *,
    aim: float | None = None,
    reduce: Callable[[Any], Any] = np.median,
    kind: str = "target",
) -> dict[str, Any]:
    """Return the row for `reduce` of a number of every cell that should be at most `most`."""
    values = np.array([of(cell) for cell in cells])
    found = float(reduce(values))
    sign = -1.0 if most < 0 else 1.0
    shown = f">= {-most:g}" if most < 0 else f"<= {most:g}"
    extra: dict[str, Any] = {"kind": kind}
    if aim is not None:
        extra |= {"aim": f"<= {aim:g}", "aim_met": found <= aim}
    if reduce is np.median:
        extra["interval"] = _bootstrap(values)
    return _row(name, sign * found if np.isfinite(found) else None, "1", shown, found <= most, **extra)


def _bootstrap(values: Any) -> list[float] | None:
    """Return the 95 % interval of the median over cells drawn again, with a fixed seed."""
    if len(values) < 2 or not np.isfinite(values).all():
        return None
    drawn = np.random.default_rng(0).choice(values, (1000, len(values)))
    low, high = np.quantile(np.median(drawn, axis=1), [0.025, 0.975])
    return [float(low), float(high)]


def _row(name: str, found: float | None, unit: str, target: str, met: bool, **extra: Any) -> dict[str, Any]:
    return {"name": name, "value": found, "unit": unit, "target": target, "met": bool(met), **extra}


def summary(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """Return medians, worst and share of cells won of every column, intervals over the seeds' medians where learned."""
    rows = []
    for column in COLUMNS:
        there = [cell for cell in cells if column in cell["columns"]]
        if not there:
            continue
        row: dict[str, Any] = {"column": column, "cells": len(there), "won": won(there, column)}
        for name in ("rmse", "off_path", "time_s", "drift_rmse"):
            values = [value(cell, column, name) for cell in there]
            row[name], row[f"{name}_worst"] = float(np.median(values)), float(np.max(values))
        over = [value(cell, column, "time_s") / value(cell, "none", "time_s") for cell in there]
        row["time_ratio"] = float(np.median(over))
        seeds = [cell["columns"][column].get("rmse_seeds") for cell in there]
        if all(seeds):
            row["rmse_interval"] = interval(np.median(np.array(seeds), axis=0).tolist())
        row["failed"] = sum("error" in cell["columns"][column] for cell in there)
        rows.append(row)
    return rows
