"""Tasks of the target on the time axis of the file that was printed: found by place, as the file may be cut otherwise.

A Start is where the file comes to its road's begin, a Stop where it comes to the road's end, a Corner where it comes to
the corner; each lasts as long as it was planned to. What lies between them is Steady-State or No-Flow.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from gcodectl.columns import Floats
from gcodectl.records import Moves, TaskKind, Tasks

if TYPE_CHECKING:
    from gcodectl.config import Machine
    from gcodectl.report.flow import TaskSpan
    from plant_models.bead import Roads
    from plant_models.firmware import Execution

EDGE = 1e-6
"""mm inside of a road's end, so that the end is not taken for the next road's begin."""


def find_spans(
    moves: Moves, machine: Machine, roads: Roads, execution: Execution, leads: Mapping[TaskKind, float]
) -> list[TaskSpan]:
    """Return the tasks of the target's `moves` when `execution` comes to them, with the leads (s) of their signals."""
    from gcodectl.pipeline import Options, find_tasks

    found = [tasks for *_, tasks, _ in find_tasks(iter([moves]), Options(machine)) if len(tasks)]
    return place_spans(Tasks.concat(found), roads, execution, leads) if found else []


def place_spans(tasks: Tasks, roads: Roads, execution: Execution, leads: Mapping[TaskKind, float]) -> list[TaskSpan]:
    """Put `tasks` on the execution's time axis, in time order; Steady-State fills what is left of a road."""
    from gcodectl.report.flow import TaskSpan

    times = _Passing(roads, execution)
    spans: list[TaskSpan] = []
    laid = np.flatnonzero(roads.road >= 0)
    for i in range(len(tasks)):
        kind = TaskKind(int(tasks.kind[i]))
        inside = laid[(roads.path.row[laid] >= tasks.first[i]) & (roads.path.row[laid] <= tasks.last[i])]
        if kind in (TaskKind.NO_FLOW, TaskKind.STEADY) or not len(inside):
            continue
        long = float(tasks.t1[i] - tasks.t0[i])
        lead = leads.get(kind, 0.0)
        if kind == TaskKind.START:
            t = times.at(roads.begin[inside[0]] + EDGE)
            spans.append(TaskSpan(kind, t, t + long, t, lead))
        elif kind == TaskKind.STOP:
            t = times.at(roads.begin[inside[-1]] + roads.path.length[inside[-1]] - EDGE)
            spans.append(TaskSpan(kind, t - long, t, t, lead))
        else:
            gap = np.hypot(roads.path.p1[inside, 0] - tasks.x[i], roads.path.p1[inside, 1] - tasks.y[i])
            corner = inside[int(np.argmin(gap))]
            t = times.at(roads.begin[corner] + roads.path.length[corner] - EDGE)
            spans.append(TaskSpan(kind, t - long / 2, t + long / 2, t, lead))
    spans.sort(key=lambda span: span.t0)
    return _filled(spans, execution.duration)


def _filled(spans: list[TaskSpan], end: float) -> list[TaskSpan]:
    """Put Steady-State and No-Flow between the other tasks."""
    from gcodectl.report.flow import TaskSpan

    out: list[TaskSpan] = []
    now, flowing = 0.0, False
    for span in spans:
        if span.t0 > now:
            out.append(TaskSpan(TaskKind.STEADY if flowing else TaskKind.NO_FLOW, now, span.t0, now))
        out.append(span)
        now, flowing = max(now, span.t1), span.kind != TaskKind.STOP
    if end > now:
        out.append(TaskSpan(TaskKind.NO_FLOW, now, end, now))
    return out


class _Passing:
    """When an execution comes to a place S on the target's roads."""

    def __init__(self, roads: Roads, execution: Execution) -> None:
        from plant_models.match import match

        low, high = match(roads, execution.segments)
        begins = execution.begins()
        ends = np.append(begins[1:], execution.duration)
        on = np.flatnonzero(np.isfinite(low))
        on = on[np.argsort(low[on], kind="stable")]
        self.place: Floats = np.stack([low[on], high[on]], axis=1).ravel()
        self.time: Floats = np.stack([begins[on], ends[on]], axis=1).ravel()

    def at(self, place: float) -> float:
        """Return the time, s."""
        return float(np.interp(place, self.place, self.time)) if len(self.place) else 0.0
