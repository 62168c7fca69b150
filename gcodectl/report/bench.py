"""The flow bench as one picture: the matrix, every column's cells, and error against time where it was traded.

ours / best rival, plant x part     rmse of all cells, a line a column (sorted)
front  front  front ...             expert by acceleration, ours by quality
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

RIVALS = ("pa", "expert", "coasting", "basis")
COLOURS = {
    "none": "#c9c9c9", "coasting": "#b59f6b", "pa": "#e08a3c", "expert": "#c2452d", "basis": "#8f7bb8",
    "ours": "#1f6fb2", "whole": "#2e8b57",
}  # fmt: skip
DARK = 0.75
"""Ratios this far from 1 lie on a dark colour."""
WIDEST = 4
"""Fronts drawn; there may be more in the JSON."""


def plot_bench(path: Path, cells: Sequence[Mapping[str, Any]], fronts: Sequence[Mapping[str, Any]]) -> None:
    """Draw the cells of `tools/bench_flow` and its fronts to a PNG; one cell as bars beside its front."""
    few = fronts[:WIDEST]
    if len(cells) == 1:
        figure = Figure(figsize=(13, 5), layout="constrained")
        _bars(figure.add_subplot(1, 2, 1), cells[0])
        for front in few[:1]:
            _front(figure.add_subplot(1, 2, 2), front)
        figure.savefig(path, dpi=100)
        return
    figure = Figure(figsize=(15, 11), layout="constrained")
    halves = figure.add_gridspec(2, 1, height_ratios=(1.7, 1))
    above = halves[0].subgridspec(1, 2, width_ratios=(1.7, 1))
    _matrix(figure.add_subplot(above[0]), cells)
    _sorted(figure.add_subplot(above[1]), cells)
    below = halves[1].subgridspec(1, max(len(few), 1))
    for number, front in enumerate(few):
        _front(figure.add_subplot(below[number]), front)
    figure.savefig(path, dpi=100)


def _rmse(cell: Mapping[str, Any], column: str) -> float:
    found = cell["columns"].get(column, {}).get("rmse")
    return float("nan") if found is None else float(found)


def _bars(axes: Axes, cell: Mapping[str, Any]) -> None:
    names = [name for name in COLOURS if np.isfinite(_rmse(cell, name))]
    for row, name in enumerate(reversed(names)):
        found = cell["columns"][name]
        axes.barh(row + 0.2, found["rmse"], 0.38, color=COLOURS[name])
        axes.barh(row - 0.2, found["off_path"], 0.38, color=COLOURS[name], alpha=0.4)
        text = f"  {found['rmse']:.3f} / {found['off_path']:.3f} in {found['time_s']:.0f} s"
        axes.text(max(found["rmse"], found["off_path"]), row, text, va="center", fontsize=9)
    axes.set_yticks(range(len(names)), list(reversed(names)))
    axes.set_xlim(right=1.35 * max(_rmse(cell, name) for name in names))
    axes.set_xlabel("rmse (full), off_path (light)")
    axes.set_title(f"{cell['part']} on {Path(str(cell['plant'])).name}", fontsize=10)


def _matrix(axes: Axes, cells: Sequence[Mapping[str, Any]]) -> None:
    plants = list(dict.fromkeys(str(cell["plant"]) for cell in cells))
    parts = list(dict.fromkeys(str(cell["part"]) for cell in cells))
    grid = np.full((len(plants), len(parts)), np.nan)
    for cell in cells:
        rival = min((_rmse(cell, name) for name in RIVALS if np.isfinite(_rmse(cell, name))), default=np.nan)
        grid[plants.index(cell["plant"]), parts.index(cell["part"])] = _rmse(cell, "ours") / rival
    axes.imshow(grid, cmap="RdBu_r", norm=TwoSlopeNorm(1.0, 0.0, 2.0), aspect="auto")
    for i, j in zip(*np.nonzero(np.isfinite(grid)), strict=True):
        dark = abs(grid[i, j] - 1.0) > DARK
        axes.text(j, i, f"{grid[i, j]:.2f}", ha="center", va="center", fontsize=7, color="white" if dark else "black")
    axes.set_xticks(range(len(parts)), parts, rotation=60, ha="right", fontsize=8)
    axes.set_yticks(range(len(plants)), [Path(name).name for name in plants], fontsize=8)
    axes.set_title("rmse of ours over the best of pa, expert, coasting, basis (blue: ours is better)", fontsize=10)


def _sorted(axes: Axes, cells: Sequence[Mapping[str, Any]]) -> None:
    for name, colour in COLOURS.items():
        values = np.sort([_rmse(cell, name) for cell in cells])
        values = values[np.isfinite(values)]
        if len(values):
            share = (np.arange(len(values)) + 0.5) / len(values)
            axes.plot(share, values, ".-", color=colour, label=name, lw=2.5 if name == "ours" else 1, ms=3)
    axes.set_yscale("log")
    axes.set_xlabel("share of cells")
    axes.set_ylabel("rmse below")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3, which="both")


def _front(axes: Axes, front: Mapping[str, Any]) -> None:
    for name in ("expert", "ours"):
        times = [one["time_s"] / front["none_time_s"] for one in front[name]]
        axes.plot(times, [one["rmse"] for one in front[name]], "o-", color=COLOURS[name], label=name)
    axes.set_title(f"{front['part']} on {Path(front['plant']).name}", fontsize=10)
    axes.set_xlabel("time / none")
    axes.set_ylabel("rmse")
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
