"""The bench for people: medians by column, by plant, targets, the cells that are worse than pressure advance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from flow_bench.cell import COLUMNS
from flow_bench.targets import Cell, best_rival, summary, value, worse_than_pa

WIDE = 150
"""Columns of text where nobody's terminal says how many there are."""
FEW = 3
"""Cells up to which every column of each is shown."""


def show(cells: Sequence[Cell], setting: dict[str, Any], rows: Sequence[dict[str, Any]]) -> None:
    """Print the tables."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=WIDE)
    if len(cells) <= FEW:
        for cell in cells:
            console.print(_one(cell))
    else:
        console.print(_columns(cells, setting))
        console.print(_plants(cells))
    for row in rows:
        found = "-" if row["value"] is None else f"{row['value']:.4g}"
        spread = " [{:.3g}, {:.3g}]".format(*row["interval"]) if row.get("interval") else ""
        aim = f", aim {row['aim']} {'met' if row['aim_met'] else 'missed'}" if "aim" in row else ""
        console.print(
            f"{'met   ' if row['met'] else 'MISSED'} {row['name']}: {found}{spread} (target {row['target']}{aim})"
        )
    worse = worse_than_pa([cell for cell in cells if "ours" in cell["columns"]])
    if worse:
        console.print(f"ours worse than pa in: {'; '.join(worse)}")
    for cell in cells:
        for name, column in cell["columns"].items():
            if "error" in column:
                console.print(f"FAILED {name} on {cell['plant']}, {cell['part']}: {column['error']}")


def show_bounds(bounds: Sequence[dict[str, Any]]) -> None:
    """Print what the best plunger signal would reach."""
    for one in bounds:
        print(
            f"bound on {one['plant']}, {one['part']}, motion {one['motion']} ({one['time_s']:.1f} s): "
            f"rmse {one['rmse']:.4f}, off_path {one['off_path']:.4f}; begun from rmse {one['begun_rmse']:.4f}"
        )


def _columns(cells: Sequence[Cell], setting: dict[str, Any]) -> Table:
    table = Table(title=f"{len(cells)} cells, {setting['seeds']} seeds, plunger <= {setting['cap']:g} x nominal flow")
    for heading in ("", "rmse", "95 %", "worst", "off_path", "time / none", "drifted rmse", "won"):
        table.add_column(heading, justify="left" if not heading else "right")
    for row in summary(cells):
        spread = "{:.3f}-{:.3f}".format(*row["rmse_interval"]) if "rmse_interval" in row else ""
        table.add_row(
            row["column"], f"{row['rmse']:.4f}", spread, f"{row['rmse_worst']:.3f}", f"{row['off_path']:.4f}",
            f"{row['time_ratio']:.3f}", f"{row['drift_rmse']:.4f}", f"{row['won']:.0%}",
        )  # fmt: skip
    return table


def _plants(cells: Sequence[Cell]) -> Table:
    table = Table(title="median rmse by plant")
    names = [name for name in COLUMNS if any(name in cell["columns"] for cell in cells)]
    for heading in ("plant", "parts", *names, "ours / best rival", "ours / whole"):
        table.add_column(heading, justify="left" if heading == "plant" else "right")
    for plant in dict.fromkeys(cell["plant"] for cell in cells):
        mine = [cell for cell in cells if cell["plant"] == plant]
        medians = [f"{np.median([value(cell, name) for cell in mine]):.3f}" for name in names]
        rival = np.median([value(cell, "ours") / best_rival(cell) for cell in mine])
        over = np.median([value(cell, "ours") / value(cell, "whole") for cell in mine])
        table.add_row(plant, str(len(mine)), *medians, f"{rival:.2f}", f"{over:.2f}")
    return table


def _one(cell: Cell) -> Table:
    table = Table(title=f"{cell['part']} on {cell['plant']}, plunger <= {cell['max_flow']:.1f} mm^3/s")
    for heading in ("", "rmse", "off_path", "time_s", "bias", "worst", "drifted rmse", "tuned to"):
        table.add_column(heading, justify="left" if heading in ("", "tuned to") else "right")
    for name, column in cell["columns"].items():
        if "error" in column:
            table.add_row(name, "failed")
            continue
        tuned = ", ".join(f"{key} {number:.3g}" for key, number in column.get("settings", {}).items())
        table.add_row(
            name, f"{column['rmse']:.4f}", f"{column['off_path']:.4f}", f"{column['time_s']:.1f}",
            f"{column['bias']:+.4f}", f"{column['worst']:+.2f}", f"{column['drift_rmse']:.4f}", tuned,
        )  # fmt: skip
    return table
