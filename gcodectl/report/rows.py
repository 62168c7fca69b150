"""The rows of a comparison as bars: error, what fell beside the roads, and the time that each took."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

COLUMNS = (
    ("rmse", "bead error (rmse), %", 100.0),
    ("off_path", "off path, % of volume", 100.0),
    ("time_s", "time, s", 1.0),
)


def plot_rows(path: Path, rows: Sequence[Mapping[str, object]], *, name: str = "baseline", title: str = "") -> None:
    """Draw `rmse`, `off_path` and `time_s` of every row, labelled by its `name` column, to a PNG."""
    figure = Figure(figsize=(12, 0.5 * len(rows) + 1.4), layout="constrained")
    grid = figure.subplots(1, len(COLUMNS), sharey=True, squeeze=False)[0]
    places = np.arange(len(rows))
    for axes, (column, label, factor) in zip(grid, COLUMNS, strict=True):
        values = [float(str(row[column])) * factor for row in rows]
        colours = ["#1f6fb2" if row[name] == "ours" else "#b8c4d0" for row in rows]
        bars = axes.barh(places, values, color=colours)
        axes.bar_label(bars, fmt="%.4g", padding=3, fontsize=8)
        axes.set_xlim(0, max(*values, 1e-9) * 1.2)
        axes.set_xlabel(label)
        axes.spines[["top", "right"]].set_visible(False)
    grid[0].set_yticks(places, [str(row[name]) for row in rows])
    grid[0].invert_yaxis()
    if title:
        figure.suptitle(title)
    figure.savefig(path, dpi=110)
