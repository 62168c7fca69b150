"""Pictures of heat: the surface over location and time, a plan along the path, layers and what they cost by policy."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gcodectl.columns import Floats
from gcodectl.thermal.partitions import Partitions
from gcodectl.thermal.road import Road
from gcodectl.thermal.speed import SpeedsPlan
from gcodectl.thermal.surface import Band
from gcodectl.thermal.track import Tracked

COLOURS = ("#8d99ae", "#1f6fb2", "#3a7d44", "#d1495b", "#edae49")
SHADE = "#3a7d44"
SLICES = (0.1, 0.35, 0.6, 0.85)
"""Places along the path whose curves are drawn."""
DPI = 110
ROOM = 1.08
"""What an axis shows, times its highest value: a head at its fastest is not to be taken for the frame."""


def plot_tracked(path: Path, layer: Tracked, road: Road, band: Band) -> None:
    """Draw a layer's temperatures over location and time, as read and as estimated, and curves of some places."""
    figure = Figure(figsize=(14, 8.5), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=[1.25, 1])
    model = layer.surface.at(np.broadcast_to(layer.times, (len(road), len(layer.times))), band.ambient)
    begun = layer.times[None, :] >= layer.surface.t0[:, None]
    shown = (("as read (emissivity put right)", layer.raw), ("estimated", np.where(begun, model, np.nan)))
    top = float(np.nanmax(layer.raw))
    for column, (title, values) in enumerate(shown):
        axes = figure.add_subplot(grid[0, column])
        mesh = axes.pcolormesh(road.s, layer.times, values.T, cmap="inferno", vmin=2 * band.low - band.high, vmax=top)
        axes.set(title=title, xlabel="location along the path, mm", ylabel="time, s")
        figure.colorbar(mesh, ax=axes, label="°C")
    axes = figure.add_subplot(grid[1, 0])
    for place, colour in zip(SLICES, COLOURS[1:], strict=True):
        k = int(place * (len(road) - 1))
        axes.plot(layer.times, layer.raw[k], ".", color=colour, markersize=2, alpha=0.5)
        known = begun[k]
        axes.plot(layer.times[known], model[k][known], color=colour, label=f"{road.s[k]:.0f} mm")
    _band(axes, band)
    axes.set(xlabel="time, s", ylabel="°C", title="read (dots) and estimated (lines)")
    axes.legend(frameon=False, ncols=4, fontsize="small")
    axes = figure.add_subplot(grid[1, 1])
    last = layer.times[-1]
    axes.plot(road.s, layer.raw[:, -1], ".", color=COLOURS[0], markersize=3, label=f"read at {last:.0f} s")
    axes.plot(road.s, model[:, -1], color=COLOURS[1], label="estimated")
    _band(axes, band)
    axes.set(xlabel="location along the path, mm", ylabel="°C", title="the last frame")
    axes.legend(frameon=False, fontsize="small")
    figure.savefig(path, dpi=DPI)


def plot_plan(
    path: Path, s: Floats, plan: SpeedsPlan, partitions: Partitions, band: Band, others: Mapping[str, Floats]
) -> None:
    """Draw the temperatures that a plan meets along the path, beside those of `others` by name, and its speeds."""
    figure = Figure(figsize=(12, 7), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    for (name, temperatures), colour in zip(others.items(), (COLOURS[0], COLOURS[4], COLOURS[3]), strict=False):
        upper.plot(s, temperatures, color=colour, linewidth=1.0, label=name)
    upper.plot(s, plan.temperatures, color=COLOURS[1], linewidth=1.6, label=f"plan: begins at {plan.start:.1f} s")
    _band(upper, band)
    upper.set(ylabel="surface when the road comes, °C")
    upper.legend(frameon=False, ncols=3, loc="upper right")
    moving = np.diff(plan.times) > 0
    lower.plot((s[1:] + s[:-1])[moving] / 2, (np.diff(s)[moving] / np.diff(plan.times)[moving]), color=COLOURS[1])
    ends = partitions.begin + partitions.length
    lower.hlines(plan.speeds, partitions.begin, ends, color="#222222", linewidth=1.0, linestyle=(0, (4, 2)))
    for axes in (upper, lower):
        for begin in partitions.begin[1:]:
            axes.axvline(begin, color="#bbbbbb", linewidth=0.6, zorder=0)
    lower.set(xlabel="location along the path, mm", ylabel="speed, mm/s")
    lower.set_ylim(0.0, ROOM * float(plan.speeds.max()))
    figure.savefig(path, dpi=DPI)


def plot_layers(path: Path, policies: Mapping[str, Mapping[str, Any]], s: Floats, band: Band, title: str = "") -> None:
    """Draw layer times and objectives by policy, and what the last layer met along the path.

    Of each policy: `times` and `costs` (one a layer), `temperatures` and `speeds` (one a location, the last layer).
    """
    figure = Figure(figsize=(14, 8.5), layout="constrained")
    (times, costs), (met, speeds) = figure.subplots(2, 2)
    for (name, one), colour in zip(policies.items(), COLOURS, strict=False):
        number = np.arange(1, len(one["times"]) + 1)
        times.plot(number, one["times"], "o-", color=colour, markersize=3, label=name)
        met.plot(s, one["temperatures"], color=colour, linewidth=1.2, label=name)
        speeds.plot(s, one["speeds"], color=colour, linewidth=1.2, label=name)
    names = list(policies)
    totals = [float(np.mean(policies[name]["costs"])) for name in names]
    bars = costs.bar(names, totals, color=COLOURS[: len(names)])
    costs.bar_label(bars, fmt="%.0f")
    _band(met, band)
    times.set(title="layer times", xlabel="layer", ylabel="s, from start to start")
    times.set_ylim(bottom=0)
    times.xaxis.get_major_locator().set_params(integer=True)
    costs.set(title="objective, mean of the layers", ylabel="sum of (T - T_best)² + start, °C², s")
    met.set(title="the last layer: surface when the road comes", xlabel="location along the path, mm", ylabel="°C")
    speeds.set(title="the last layer: speeds", xlabel="location along the path, mm", ylabel="mm/s")
    speeds.set_ylim(0.0, ROOM * max(float(one["speeds"].max()) for one in policies.values()))
    times.legend(frameon=False)
    if title:
        figure.suptitle(title)
    figure.savefig(path, dpi=DPI)


def _band(axes: Any, band: Band) -> None:
    axes.axhspan(band.low, band.high, color=SHADE, alpha=0.1, linewidth=0, zorder=0)
    axes.axhline(band.best, color=SHADE, linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
