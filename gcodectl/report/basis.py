"""Pictures of basis signals in sequence: the composed signal with its demarcation lines, and where the tasks are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.library import BasisSet
from gcodectl.path import point_at
from gcodectl.records import Command, Composed, Kind, Moves, Profile, SpeedPlan, TaskKind, Tasks
from gcodectl.report.learning import BLACK, BLUE, GREY, TASK_COLOURS, WHITE, save, sheet, styled

MARKERS = {TaskKind.START: "^", TaskKind.CORNER: "D", TaskKind.STOP: "s"}


def join(chunks: Sequence[Composed]) -> Composed:
    """Return all chunks of a stream as one; where commands overlap the later one counts."""
    commands = [chunk.command for chunk in chunks if len(chunk.command.u)]
    first, dt = commands[0].t0, commands[0].dt
    u, reference = (np.zeros(round((commands[-1].t1 - first) / dt)) for _ in range(2))
    for one in commands:
        part = slice(round((one.t0 - first) / dt), round((one.t1 - first) / dt))
        u[part], reference[part] = one.u, one.reference
    return Composed(
        Moves.concat([chunk.moves for chunk in chunks]),
        SpeedPlan.concat([chunk.speeds for chunk in chunks]),
        Profile.concat([chunk.profile for chunk in chunks]),
        Tasks.concat([chunk.tasks for chunk in chunks]),
        Command(first, dt, u, reference),
    )


def spans(tasks: Tasks, one: BasisSet) -> list[tuple[TaskKind, float, float, float]]:
    """Return kind, begin, end and moment (s; NaN for none) of each signal in a sequence, one after another.

    A Start, Corner or Stop spans its signal, cut short where the next one begins; the rest is Steady-State or No-Flow.
    """
    found: list[tuple[TaskKind, float, float, float]] = []
    last = 0.0
    for row in range(len(tasks)):
        kind = TaskKind(int(tasks.kind[row]))
        t0, t1 = float(tasks.t0[row]), float(tasks.t1[row])
        moment = {TaskKind.START: t0, TaskKind.STOP: t1, TaskKind.CORNER: (t0 + t1) / 2}.get(kind, np.nan)
        if kind in MARKERS:
            signal = one.signals[kind]
            begin = max(0.0, moment - signal.lead)
            if found and begin < last:
                previous = found[-1]
                found[-1] = (previous[0], previous[1], begin, previous[3])
            elif begin > last:
                found.append((TaskKind.NO_FLOW if kind is TaskKind.START else TaskKind.STEADY, last, begin, np.nan))
            last = moment - signal.lead + len(signal.values) * one.dt
            found.append((kind, begin, last, moment))
    end = float(tasks.t1[-1]) if len(tasks) else 0.0
    return [*found, (TaskKind.NO_FLOW, last, end, np.nan)] if end > last else found


@styled
def plot_sequence(
    command: Command, flow: Floats, untaught: Floats, tasks: Tasks, one: BasisSet, path: Path, note: str
) -> None:
    """The signal for a part with its demarcation lines (the paper's Fig. 10), and the flow it gives.

    `flow` and `untaught` are q, mm^3/s, with the signal and with the reference alone, on the command's grid.
    """
    figure, (signal, answer) = sheet(2, 1, (11, 5.6))
    t = command.t0 + (np.arange(len(command.u)) + 0.5) * command.dt
    signal.plot(t, command.u, color=BLACK, lw=0.8, alpha=0.4)
    top = 1.25 * float(command.u.max())
    for kind, begin, end, moment in spans(tasks, one):
        inside = (t >= begin) & (t <= end)
        signal.plot(t[inside], command.u[inside], color=TASK_COLOURS[kind], lw=1.5)
        for when in (begin, end):
            signal.axvline(when, color=GREY, lw=0.7, ls="--")
        if np.isfinite(moment):
            signal.axvline(moment, color=BLACK, lw=0.9)
            answer.axvline(moment, color=BLACK, lw=0.9)
        short = {TaskKind.STEADY: "Steady-\nState", TaskKind.NO_FLOW: "No-\nFlow"}.get(kind, kind.label)
        middle, colour = (begin + end) / 2, TASK_COLOURS[kind]
        signal.text(middle, top, short, ha="center", va="top", fontsize=8, color=colour, bbox=WHITE)
    signal.set(ylabel="u, mm³/s", ylim=(None, top * 1.02), xlim=(0, t[-1]))
    wanted = command.reference / one.steady
    answer.plot(t, wanted, color=BLACK, lw=2.2, alpha=0.35, label="wanted")
    answer.plot(t, untaught, color=TASK_COLOURS[TaskKind.STEADY], lw=1.2, label="extruder taken to obey at once")
    answer.plot(t, flow, color=BLUE, lw=1.4, label="with the basis signals")
    answer.set(ylabel="flow, mm³/s", xlim=(0, t[-1]))
    answer.set_xlabel("time, s (solid: the task; dashed: where its signal begins and ends)")
    figure.legend(*answer.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    save(figure, path, note)


@styled
def plot_tasks(moves: Moves, tasks: Tasks, path: Path, note: str, *, title: str = "") -> None:
    """The part from above, with every task where it is (the paper's Fig. 12)."""
    figure, (ax,) = sheet(1, 1, (8.6, 6.4))
    labelled: set[TaskKind] = set()
    for row in range(len(moves)):
        if moves.kind[row] not in (Kind.LINE, Kind.ARC) or not moves.length[row] > 0:
            continue
        kind = TaskKind.STEADY if moves.e[row] > 0 else TaskKind.NO_FLOW
        shares = np.linspace(0, 1, 73 if moves.kind[row] == Kind.ARC else 2)
        shape = np.stack([point_at(moves, row, float(share)) for share in shares])
        if not np.isfinite(shape).all():
            continue
        ax.plot(
            shape[:, 0], shape[:, 1], color=TASK_COLOURS[kind], lw=2.4 if kind is TaskKind.STEADY else 0.8,
            ls="-" if kind is TaskKind.STEADY else ":", label=None if kind in labelled else kind.label, zorder=1,
        )  # fmt: skip
        labelled.add(kind)
    for kind, marker in MARKERS.items():
        mine = tasks[tasks.kind == kind]
        ax.plot(
            mine.x, mine.y, marker, color=TASK_COLOURS[kind], ms=7, fillstyle="none", mew=1.6,
            label=f"{kind.label} ({len(mine)})",
        )  # fmt: skip
    ax.set(xlabel="X, mm", ylabel="Y, mm", aspect="equal", title=title)
    figure.legend(loc="outside right center")
    save(figure, path, note)
