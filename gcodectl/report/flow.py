"""Flow against time: what the road wants, what the plunger does, what comes out; tasks and their leads marked."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.records import TaskKind

COLOURS = {
    TaskKind.STOP: "#d1495b",
    TaskKind.START: "#3a7d44",
    TaskKind.CORNER: "#edae49",
    TaskKind.STEADY: "#dfe7ee",
    TaskKind.NO_FLOW: "#ffffff",
}
MOST_POINTS = 40_000


@dataclasses.dataclass(frozen=True)
class TaskSpan:
    """A task on the time axis."""

    kind: TaskKind
    t0: float
    t1: float
    """s"""
    anchor: float
    """What its lead counts from, s: the road's begin or end, the corner's middle."""
    lead: float = 0.0
    """Its signal begins so many seconds before the anchor."""


def plot_flow(
    path: Path,
    t: Floats,
    *,
    wanted: Floats,
    command: Floats,
    flow: Floats,
    speed: Floats | None = None,
    tasks: Sequence[TaskSpan] = (),
    window: tuple[float, float] | None = None,
    title: str = "",
) -> None:
    """Draw q_ref, u and q (mm^3/s, shape (n,), from times t in s) and the speed (mm/s) to a PNG.

    `window` is the piece of time that is shown, s; all of it where None. Raises UsageError for an empty window.
    """
    begin, end = window or (float(t[0]), float(t[-1]))
    inside = np.flatnonzero((t >= begin) & (t <= end))
    if not len(inside):
        raise UsageError(f"there is nothing between {begin:g} s and {end:g} s; the print lasts {t[-1]:g} s")
    shown = inside[:: max(1, len(inside) // MOST_POINTS)]
    figure = Figure(figsize=(13, 6 if speed is not None else 4.5), layout="constrained")
    rows = figure.subplots(
        2 if speed is not None else 1, 1, sharex=True, squeeze=False, height_ratios=[4, 1][: 1 + (speed is not None)]
    )
    axes = rows[0, 0]
    axes.plot(t[shown], command[shown], color="#8d99ae", linewidth=0.9, zorder=2)
    axes.plot(t[shown], wanted[shown], color="#222222", linewidth=1.1, linestyle=(0, (4, 2)), zorder=3)
    axes.plot(t[shown], flow[shown], color="#1f6fb2", linewidth=1.4, zorder=4)
    axes.axhline(0, color="#999999", linewidth=0.6)
    axes.set_ylabel("mm³/s")
    axes.set_ylim(*_limits(wanted[inside], command[inside], flow[inside]))
    kinds = _mark(axes, [task for task in tasks if task.t1 >= begin and min(task.t0, task.anchor - task.lead) <= end])
    if speed is not None:
        rows[1, 0].plot(t[shown], speed[shown], color="#555555", linewidth=0.9)
        rows[1, 0].set_ylabel("speed, mm/s")
        rows[1, 0].set_ylim(bottom=0)
    rows[-1, 0].set_xlabel("time, s")
    rows[-1, 0].set_xlim(begin, end)
    handles: list[Line2D | Patch] = [
        Line2D([], [], color="#222222", linestyle=(0, (4, 2)), label="wanted (bead times speed)"),
        Line2D([], [], color="#8d99ae", label="plunger"),
        Line2D([], [], color="#1f6fb2", label="out of the nozzle"),
    ]
    handles += [Patch(facecolor=COLOURS[kind], edgecolor="#bbbbbb", label=kind.label) for kind in kinds]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.14), ncols=len(handles), frameon=False)
    if title:
        figure.suptitle(title)
    figure.savefig(path, dpi=110)


def _limits(wanted: Floats, command: Floats, flow: Floats) -> tuple[float, float]:
    """Return the range to show: all of the flow, and as much of the plunger as 3 times that allows."""
    low, high = min(0.0, float(flow.min())), max(float(wanted.max()), float(flow.max()), 1e-9)
    span = high - low
    low = max(min(low, float(command.min())), low - 2 * span)
    high = min(max(high, float(command.max())), high + 2 * span)
    return low - 0.05 * (high - low), high + 0.05 * (high - low)


def _mark(axes, tasks: Sequence[TaskSpan]) -> list[TaskKind]:  # type: ignore[no-untyped-def]
    """Shade the tasks, draw an arrow over each lead, and return the kinds that are there, in the paper's order."""
    top = axes.get_ylim()[1]
    for task in tasks:
        if task.t1 > task.t0:
            axes.axvspan(task.t0, task.t1, color=COLOURS[task.kind], alpha=0.35, linewidth=0, zorder=0)
        if task.kind in (TaskKind.START, TaskKind.STOP, TaskKind.CORNER):
            axes.axvline(task.anchor, color=COLOURS[task.kind], linewidth=0.8, zorder=1)
        if task.lead > 0:
            height = top * (0.95 - 0.06 * (TaskKind.STOP, TaskKind.START, TaskKind.CORNER).index(task.kind))
            axes.annotate(
                "",
                xy=(task.anchor, height),
                xytext=(task.anchor - task.lead, height),
                arrowprops={"arrowstyle": "->", "color": COLOURS[task.kind], "shrinkA": 0, "shrinkB": 0},
            )
    present = {task.kind for task in tasks}
    return [
        kind
        for kind in (TaskKind.START, TaskKind.STEADY, TaskKind.CORNER, TaskKind.STOP, TaskKind.NO_FLOW)
        if kind in present
    ]
