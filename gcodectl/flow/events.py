"""Events: when the tasks' signals are due, how much of each, and how far from where they were learned.

    Start    at the road's begin    a full charge after a barrier, else what the Stop before it took out (put_back)
    Stop     at its end             full
    Corner   at the dip's middle    in proportion to the flow that the dip leaves out
    a lasting change of flow        a Start of the rise, a Stop of the fall, without margins

Margins, the seconds by which flow reaches beyond a road, need room: a Stop and the Start after it share their gap.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.bank import LEARNED_KINDS, SignalBank
from gcodectl.records import TaskKind, Tasks


def moments(tasks: Tasks) -> Floats:
    """When each task is, s: a road's begin (Start), its end (Stop), the middle of the dip (Corner)."""
    middle = 0.5 * (tasks.t0 + tasks.t1)
    return np.where(tasks.kind == TaskKind.START, tasks.t0, np.where(tasks.kind == TaskKind.STOP, tasks.t1, middle))


def unused_margin(tasks: Tasks, bank: SignalBank) -> Floats:
    """Seconds by which a task's signal is moved back to its road, because the No-Flow has no room for its margin.

    The margins of a Stop and of the Start after it share the gap between them; positive is later.
    """
    tool = np.clip(tasks.tool, 0, len(bank.steady) - 1)
    ends = np.isin(tasks.kind, (TaskKind.START, TaskKind.STOP))
    wanted = bank.margin[tool].sum(axis=1)
    share = np.where(ends & (wanted > tasks.gap), 1.0 - tasks.gap / np.where(wanted > 0, wanted, 1.0), 0.0)
    own = bank.margin[tool, np.where(ends, tasks.kind, 0)]
    return np.where(tasks.kind == TaskKind.START, share * own, -share * own)


def flow_events(tasks: Tasks, start: Floats) -> tuple[Tasks, Floats, Floats]:
    """Tasks with a signal, and changes of flow as Starts and Stops of the difference; their passage; their moment."""
    step = np.where(np.isin(tasks.kind, (TaskKind.STEADY, TaskKind.CORNER)), tasks.flow_after - tasks.flow, 0.0)
    changed = np.flatnonzero(np.abs(step) > 1e-9 * tasks.flow)  # not what rounding makes of one flow
    kind = np.where(step[changed] > 0, TaskKind.START, TaskKind.STOP).astype(np.int8)
    changes = tasks[changed].replace(kind=kind, flow=np.abs(step[changed]), gap=np.zeros(len(changed)))
    own = np.flatnonzero(np.isin(tasks.kind, LEARNED_KINDS))
    order = np.argsort(np.concatenate([own, changed]), kind="stable")
    events = Tasks.concat([tasks[own], changes])[order]
    when = np.concatenate([moments(tasks[own]), changes.t1])[order]
    return events, np.concatenate([start[own], start[changed]])[order], when


def due_share(some: Tasks, begin: Floats, bank: SignalBank, passage: Floats) -> Floats:
    """How much of each signal is due: a Corner by its dip, a Start by what the Stop before it took out.

    The first Start of a passage charges a barrel at rest, as in training. `passage[0]` is the last Start's passage.
    """
    tool = np.clip(some.tool, 0, len(bank.steady) - 1)
    learned_dip = bank.dip[tool]
    share = np.where(some.kind == TaskKind.CORNER, some.dip / np.where(learned_dip > 0, learned_dip, np.inf), 1.0)
    starts = np.flatnonzero(some.kind == TaskKind.START)
    follows = begin[starts] == np.concatenate([passage, begin[starts]])[: len(starts)]
    passage[:] = begin[starts][-1:] if len(starts) else passage
    share[starts] = np.where(follows, bank.put_back[tool[starts]], 1.0)
    return share
