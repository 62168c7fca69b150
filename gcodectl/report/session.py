"""Picture of a session: the flow of its first and its best trial, and the error trial by trial."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gcodectl.columns import Floats
from gcodectl.report.learning import BLACK, BLUE, ORANGE, RED, save, sheet, styled


@styled
def plot_session(
    t: Floats, wanted: Floats, numbers: Sequence[int], q: Sequence[Floats], rms: Floats, best: int, path: Path,
    title: str, note: str,
) -> None:  # fmt: skip
    """Draw the trials `numbers`: their flow q[trial][n] and the one wanted (mm^3/s, n samples at t, s), their rms.

    `best` is the best one's place among them.
    """
    figure, (flow, error) = sheet(1, 2, (11, 3.8))
    flow.plot(t, wanted, color=BLACK, lw=2.4, alpha=0.3, label="wanted")
    flow.plot(t, q[0], color=ORANGE, lw=1.0, label=f"trial {numbers[0]}")
    if best:
        flow.plot(t, q[best], color=BLUE, lw=1.0, label=f"trial {numbers[best]}, the best")
    flow.set(xlabel="time, s", ylabel="flow, mm$^3$/s")
    error.plot(numbers, rms, marker="o", color=BLUE)
    error.plot([numbers[best]], [rms[best]], marker="o", ms=9, mfc="none", color=RED)
    error.set(xlabel="trial", ylabel="rms of the error, mm$^3$/s", ylim=(0, None), xticks=list(numbers))
    figure.suptitle(title, fontsize=10)
    figure.legend(*flow.get_legend_handles_labels(), loc="outside upper left", ncols=3)
    save(figure, path, note)
