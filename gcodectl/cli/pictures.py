"""The pictures of a simulated print: flow against time, and the part from above."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gcodectl.columns import Floats
    from gcodectl.records import Signal
    from gcodectl.report.flow import TaskSpan
    from plant_models.firmware import Execution
    from plant_models.printing import Bench

SHOWN = 60.0
"""Seconds of flow.png where nothing else is asked for."""


def write_pictures(
    folder: Path,
    bench: Bench,
    execution: Execution,
    u: Signal,
    q: Signal,
    *,
    window: tuple[float, float] | None = None,
    tasks: Sequence[TaskSpan] = (),
) -> list[Path]:
    """Write flow.png and part.png into `folder`, which is made where it is missing; returns their paths."""
    from gcodectl.report.flow import plot_flow
    from gcodectl.report.part import plot_part
    from plant_models.bead import pieces
    from plant_models.match import match
    from plant_models.score import bin_errors

    folder.mkdir(parents=True, exist_ok=True)
    errors, _, _ = bin_errors(bench.roads, execution, q)
    low, high = match(bench.roads, execution.segments)
    t = np.asarray(q.t0 + q.dt * (np.arange(q.values.shape[1]) + 0.5), dtype=np.float64)
    index, _ = execution.at(t)
    segment = execution.phases.segment[index]
    speed = np.where(t < execution.duration, execution.speed(t), 0.0)
    road = np.isfinite(low[segment]) & (t < execution.duration)
    bead = _bead(bench, (low[segment] + high[segment]) / 2)
    if window is None:
        begin = float(t[road][0]) - 2.0 if road.any() else 0.0
        window = max(begin, 0.0), min(max(begin, 0.0) + SHOWN, float(t[-1]))
    plot_flow(
        folder / "flow.png",
        t,
        wanted=np.where(road, bead * speed, 0.0),
        command=np.clip(u.values, -bench.machine.max_flow, bench.machine.max_flow).sum(axis=0),
        flow=q.values.sum(axis=0),
        speed=speed,
        tasks=tasks,
        window=window,
    )
    p0, p1, of_bin, layer = pieces(bench.roads)
    plot_part(folder / "part.png", p0, p1, errors[of_bin], layer, width=bench.machine.nozzle)
    return [folder / "flow.png", folder / "part.png"]


def _bead(bench: Bench, place: Floats) -> Floats:
    """Return the bead's cross-section, mm^2, that the target asks for at places S (mm) along its roads; 0 for NaN."""
    roads = bench.roads
    laid = np.flatnonzero(roads.road >= 0)
    at = laid[np.clip(np.searchsorted(roads.begin[laid], np.nan_to_num(place), side="right") - 1, 0, len(laid) - 1)]
    return np.where(np.isfinite(place), roads.path.volume[at] / roads.path.length[at], 0.0)
