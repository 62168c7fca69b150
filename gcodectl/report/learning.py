"""Pictures of learning: responses, errors, signals, their segments; as in the paper's Figs. 3 to 6."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ParamSpec, cast

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gcodectl.columns import Floats
from gcodectl.flow.library import BasisSet
from gcodectl.records import TaskKind

BLACK, ORANGE, SKY, GREEN, BLUE, RED, GREY = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#888888"
)  # fmt: skip
"""Okabe and Ito's colours, which the colour-blind can tell apart."""
WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
"""Behind labels that lie on lines."""
Parameters = ParamSpec("Parameters")
TASK_COLOURS = {
    TaskKind.STOP: RED,
    TaskKind.START: GREEN,
    TaskKind.CORNER: BLUE,
    TaskKind.STEADY: ORANGE,
    TaskKind.NO_FLOW: GREY,
}
STYLE = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
}


@dataclasses.dataclass(frozen=True)
class Run:
    """One learning run as a picture needs it, n samples a trial."""

    title: str
    t: Floats
    """s, shape (n,)."""
    wanted: Floats
    """q_ref, mm^3/s, shape (n,)."""
    q: Floats
    """Measured flow, mm^3/s, shape (trials, n)."""
    rms: Floats
    """RMS error, mm^3/s, shape (trials,)."""
    u: Floats
    """The best trial's signal, mm^3/s, shape (n,)."""
    moments: tuple[float, float, float]
    """When the road starts, when the middle of its corner is, and when it stops, s."""

    @property
    def best(self) -> int:
        """Number of the trial with the smallest error."""
        return int(np.argmin(self.rms))


@dataclasses.dataclass(frozen=True)
class Curve:
    """A convergence check: |Q(1 - LP)| and |(1 - Q) / (1 - Q(1 - LP))| over frequency, Hz."""

    label: str
    frequency: Floats
    shrink: Floats
    remains: Floats


def styled(plot: Callable[Parameters, None]) -> Callable[Parameters, None]:
    """Run `plot` in the house style."""

    @functools.wraps(plot)
    def inside(*args: Parameters.args, **kwargs: Parameters.kwargs) -> None:
        with mpl.rc_context(rc=cast(Any, STYLE)):
            plot(*args, **kwargs)

    return inside


def sheet(rows: int, columns: int, size: tuple[float, float], *, sharey: bool = False) -> tuple[Figure, list[Axes]]:
    """Return a figure (inches) with a grid of axes, without a window; call it from a `styled` function."""
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharey=sharey)
    return figure, [one for row in axes for one in row]


def save(figure: Figure, path: Path, note: str) -> None:
    """Write a figure as PNG with `note` (plant, seed) below it; the same figure gives the same bytes."""
    figure.supxlabel(note, fontsize=7.5, color=GREY, x=0.99, ha="right")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, metadata={"Software": None})


@styled
def plot_responses(runs: Sequence[Run], iterations: Sequence[int], path: Path, note: str) -> None:
    """Flow over time at some iterations, against the reference, a panel a run (the paper's Fig. 3)."""
    figure, axes = sheet(1, len(runs), (11, 3.6), sharey=True)
    for ax, run in zip(axes, runs, strict=True):
        flow = float(run.wanted.max())
        ax.plot(run.t, run.wanted / flow, color=BLACK, lw=2.2, alpha=0.35, label="reference")
        for number, colour in zip(iterations, (ORANGE, SKY, RED), strict=True):
            ax.plot(run.t, run.q[number] / flow, color=colour, lw=1.3, label=f"iteration {number}")
        ax.set(title=run.title, xlabel="time, s", xlim=(run.moments[0] - 2, run.moments[2] + 4))
    axes[0].set_ylabel("flow / nominal flow")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    save(figure, path, note)


@styled
def plot_errors(runs: Sequence[Run], failing: Sequence[Run], path: Path, note: str) -> None:
    """RMS error by iteration (the paper's Fig. 4), with a causal Q beside it, dashed."""
    figure, (ax,) = sheet(1, 1, (7, 3.8))
    for several, style in ((runs, "-"), (failing, "--")):
        for run, colour in zip(several, (BLUE, RED), strict=True):
            ax.plot(run.rms / run.rms[0], style, marker="o", ms=3, lw=1.2, color=colour, label=run.title)
    ax.axhline(0.20, color=GREY, lw=1, ls=":")
    ax.annotate("the paper's 20 %", (0.3, 0.205), fontsize=8, color=GREY, va="bottom")
    ax.set(xlabel="iteration", ylabel="RMS error / that of iteration 0", ylim=(0, 1.05), xlim=(0, None))
    ax.legend(loc="upper right")
    save(figure, path, note)


@styled
def plot_signals(runs: Sequence[Run], path: Path, note: str) -> None:
    """The learned signals of several runs over one another (the paper's Fig. 5)."""
    figure, (ax,) = sheet(1, 1, (9, 3.8))
    for run, colour in zip(runs, (BLUE, RED), strict=True):
        ax.plot(run.t, run.u, color=colour, lw=1.1, label=f"{run.title}, iteration {run.best}")
    start, _, stop = runs[0].moments
    ax.set(xlabel="time, s", ylabel="u, mm³/s", xlim=(start - 2.5, stop + 2.5))
    ax.legend(loc="lower left")
    save(figure, path, note)


@styled
def plot_segments(run: Run, pieces: Sequence[tuple[TaskKind, int, int]], steady: float, path: Path, note: str) -> None:
    """A learned signal cut into its basis signals: kind, first and last sample of each (the paper's Fig. 6)."""
    figure, (ax,) = sheet(1, 1, (10, 4.0))
    t, u = run.t, run.u
    top = 1.2 * float(u.max())
    begin, end = run.moments[0] - 2.5, run.moments[2] + 2.5
    for kind, first, last in pieces:
        low, high = t[first], t[min(last, len(t) - 1)]
        ax.plot(t[first : last + 1], u[first : last + 1], color=TASK_COLOURS[kind], lw=1.4)
        ax.axvline(low, color=GREY, lw=0.7, ls="--")
        middle = (max(low, begin) + min(high, end)) / 2
        ax.text(middle, top, kind.label, ha="center", va="top", fontsize=8, color=TASK_COLOURS[kind], bbox=WHITE)
    ax.axhline(steady, color=ORANGE, lw=0.8, ls=":")
    for when in run.moments:
        ax.axvline(when, color=BLACK, lw=0.8, zorder=1)
    ax.set(xlabel="time, s (solid: the task; dashed: where its signal begins and ends)", ylabel="u, mm³/s")
    ax.set(xlim=(begin, end), ylim=(1.15 * float(u.min()), 1.05 * top))
    save(figure, path, note)


@styled
def plot_convergence(curves: Sequence[Curve], path: Path, note: str) -> None:
    """|Q(1 - LP)| over frequency, and what remains of the reference, for several laws and plants."""
    figure, (shrink, remains) = sheet(1, 2, (10.5, 3.6))
    styles = ((BLUE, "-"), (RED, "-"), (GREEN, "--"), (ORANGE, "-"))
    for one, (colour, dashes) in zip(curves, styles, strict=False):
        shrink.semilogx(one.frequency[1:], one.shrink[1:], dashes, color=colour, lw=1.4, label=one.label)
        worst = max(int(one.shrink.argmax()), 1)
        shrink.plot([one.frequency[worst]], [one.shrink[worst]], "o", ms=4, color=colour)
        remains.semilogx(one.frequency[1:], one.remains[1:], dashes, color=colour, lw=1.4)
    shrink.axhline(1.0, color=BLACK, lw=1, ls=":")
    shrink.set(xlabel="frequency, Hz", ylabel="|Q(1 − LP)|", title="left of the error by one more trial")
    remains.set(xlabel="frequency, Hz", ylabel="|(1 − Q) / (1 − Q(1 − LP))|", title="left of the reference in the end")
    shrink.set(ylim=(0, 1.2), xlim=(0.02, 20))
    remains.set(ylim=(0, 1.7), xlim=(0.02, 20))
    shrink.legend(loc="lower left", fontsize=8)
    save(figure, path, note)


@styled
def plot_set(one: BasisSet, path: Path) -> None:
    """The three basis signals of finite length, over time from their task."""
    figure, axes = sheet(1, 3, (11, 3.4), sharey=True)
    for ax, kind in zip(axes, (TaskKind.START, TaskKind.CORNER, TaskKind.STOP), strict=True):
        signal = one.signals[kind]
        t = [k * one.dt - signal.lead for k in range(len(signal.values))]
        ax.plot(t, signal.values, color=TASK_COLOURS[kind], lw=1.4)
        ax.axvline(0, color=BLACK, lw=0.8)
        ax.axhline(one.steady * one.flow, color=ORANGE, lw=0.8, ls=":")
        ax.set(title=f"{kind.label}: lead {signal.lead:.2f} s", xlabel="time from the task, s")
    axes[0].set_ylabel("u, mm³/s")
    made = f"{one.training.get('plant', '?')}, seed {one.training.get('seed', '?')}"
    save(figure, path, f"{one.key} at {one.flow:g} mm³/s, learned on {made}; dotted: Steady-State")
