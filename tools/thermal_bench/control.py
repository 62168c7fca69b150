"""The control's cells: how fast plans are made, how good they are, and what comes of them on the simulated part.

    published grid, hexagon   `plans.py`
    wall, chassis             `closed_loop.py`: speeds planned layer by layer from what was seen of the layers before
    drifting                  the wall of chapter 3, 13 layers, its layer time planned for two positions (a corner, the
                              middle of a long edge); beside it a controller that is told the true parameters

Plans weigh a second at the start as the published ones do (1 against a square of every location), and, as `hurried`,
as much as 1 degC^2 of the mean square; both are judged by the published objective.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gcodectl.thermal.control import ALPHA
from gcodectl.thermal.problem import Weights
from plant_models.cooling import cooling_part
from thermal_bench.closed_loop import WARM_UP, Laid, drifting, objective, printed
from thermal_bench.interval import interval
from thermal_bench.plans import hexagon_cells, hexagon_folder, size_cell

Cell = dict[str, Any]
PLANNED = 6
SAVED = {"wall": 0.30, "chassis": 0.25}
"""The published shares of time saved."""


def control_cells(seeds: Sequence[int]) -> list[Cell]:
    """Return all cells; the hexagon's only where the measured data are."""
    folder = hexagon_folder()
    size_cell(seeds[0], 1)  # kernels are compiled here
    cells = [size_cell(seed, fine) for fine in (1, 4) for seed in seeds]
    cells += hexagon_cells(folder) if folder else []
    cells += [_loop(part, seed) for part in SAVED for seed in seeds]
    return cells + [drifting(seed) for seed in seeds]


def _loop(name: str, seed: int) -> Cell:
    part = cooling_part(name, seed)
    band, layer_time = part.band, part.setting.layer_time
    layers = WARM_UP + PLANNED

    def told(laid: Sequence[Laid], prefix: str) -> Cell:
        beneath = np.stack([one.beneath for one in laid])
        return {
            f"{prefix}objective": float(np.mean([objective(one, band.best) for one in laid])),
            f"{prefix}wait": float(np.mean([one.wait for one in laid])),
            f"{prefix}cold": float(np.mean(beneath < band.low)), f"{prefix}hot": float(np.mean(beneath > band.high)),
            f"{prefix}widened": max(one.widened for one in laid),
            f"{prefix}plan_cpu_s": float(np.median([one.cpu for one in laid])),
        }  # fmt: skip

    cell: Cell = {"part": name, "seed": seed, "layer_time": layer_time, "locations": len(part.s)}
    cell |= told(printed(part, layers, None)[WARM_UP:], "fixed_")
    for prefix, start in (("", 1.0), ("hurried_", float(len(part.s)))):
        cell |= told(printed(cooling_part(name, seed), layers, Weights(start=start))[WARM_UP:], prefix)
    for prefix in ("", "hurried_"):
        cell[f"{prefix}saved"] = 1.0 - cell[f"{prefix}wait"] / layer_time
        cell[f"{prefix}gain"] = 1.0 - cell[f"{prefix}objective"] / cell["fixed_objective"]
        cell[f"{prefix}outside"] = max(cell[f"{prefix}cold"], cell[f"{prefix}hot"])
    return cell


def control_targets(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """Return the targets' rows: medians over the seeds, their 95 % intervals, and the worst."""

    def some(part: str, **wanted: Any) -> list[Cell]:
        return [
            cell for cell in cells if cell["part"] == part and all(cell[key] == wanted[key] for key in wanted)
        ]  # fmt: skip

    rows = []
    for fine, limit in ((1, 0.5), (4, 20.0)):
        grid = some("published grid", finer=fine)
        rows.append(_row(f"published grid / {fine}: A*", grid, "astar_cpu_s", "s", limit))
        rows.append(_row(f"published grid / {fine}: DP", grid, "dp_cpu_s", "s", limit))
        rows.append(_row(f"published grid / {fine}: A* less DP", grid, "difference", "", 1e-9, worst=True))
    grid = some("published grid", finer=1)
    rows.append(_row("gap to the instantaneous speeds by partition", grid, "gap_to_instant", "", 0.01))
    rows.append(_row("gap to the certified bound of any motion", grid, "gap_to_bound", "", 0.01))
    for rule, limit in (("rule", 680.0), ("acceleration", 337.0)):
        rows.append(_row(f"hexagon, {rule}: objective", some("hexagon", rule=rule), "objective", "", limit))
        rows.append(_row(f"hexagon, {rule}: time", some("hexagon", rule=rule), "cpu_s", "s", 5.0))
    for part, saved in SAVED.items():
        for prefix, name in (("", part), ("hurried_", f"{part}, hurried")):
            rows.append(_row(f"{name}: objective less than fixed", some(part), f"{prefix}gain", "", 0.8, least=True))
            rows.append(_row(f"{name}: build time saved", some(part), f"{prefix}saved", "", saved, least=True))
            rows.append(_row(f"{name}: outside the band on a side", some(part), f"{prefix}outside", "", ALPHA))
    drift = some("drifting")
    rows.append(_row("drifting: layer time saved, last three layers", drift, "saved_last", "", 0.23, least=True))
    rows.append(_row("drifting: the same of one who knows", drift, "known_saved_last", "", 0.23, least=True))
    rows.append(_row("drifting, hurried: the same", drift, "hurried_saved_last", "", 0.23, least=True))
    rows.append(_row("drifting, hurried: outside the band on a side", drift, "hurried_outside", "", ALPHA))
    rows.append(_row("drifting: objective over one who knows", drift, "over_known", "", 0.05))
    return [row for row in rows if row]


def _row(
    name: str, cells: Sequence[Cell], column: str, unit: str, target: float, *, least: bool = False, worst: bool = False
) -> dict[str, Any]:
    values = np.array([cell[column] for cell in cells], dtype=np.float64)
    if not len(values):
        return {}
    far = float(values.min() if least else values.max())
    value = far if worst else float(np.median(values))
    return {
        "name": f"control, {name}", "value": value, "unit": unit, "target": f"{'>=' if least else '<='} {target:g}",
        "met": bool(value >= target if least else value <= target), "interval": interval(values), "worst": far,
    }  # fmt: skip
