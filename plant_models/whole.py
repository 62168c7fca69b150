"""Learning control on the whole part, trial after trial: what a library of basis signals gives up.

    wanted   ____|~~~~~~~|____     the flow that the roads ask for, from the firmware's own timing
    widened  __|~~~~~~~~~~~|__     held `margin` seconds before and after each road

A flow that cannot jump is late at one end of a road or early at the other; the margin decides, and is tuned. The
learned signal replaces the slicer's retractions. The learning law is the caller's: this package knows no controller.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np
from scipy.ndimage import maximum_filter1d

from gcodectl.columns import Floats
from gcodectl.records import Signal
from plant_models.baselines import Outcome, cost, slow
from plant_models.gantry import Segments
from plant_models.match import match
from plant_models.printing import Bench, reference
from plant_models.score import score

Update: TypeAlias = Callable[[Floats, Floats], Floats]
"""The next signal of one plunger, within its limits, from the last one and its error; (n,), mm^3/s."""
MARGINS = (0.0, 0.1, 0.2)
"""s"""
PATIENCE = 8
"""Trials without a better print before learning stops."""


def whole(
    bench: Bench,
    original: Segments,
    laws: Mapping[int, Update],
    trials: int = 31,
    margins: tuple[float, ...] = MARGINS,
) -> Outcome:
    """Learn each tool's signal over the whole part with `laws[tool]`, for every margin; returns the best print."""
    path = slow(original, np.inf, np.inf, retracts=False)
    execution, wanted = reference(bench, path)
    places = match(bench.roads, path)
    best: Outcome | None = None
    for margin in margins:
        goal = widened(wanted, margin, bench.dt)
        u = np.stack([laws[tool](row, np.zeros_like(row)) for tool, row in zip(execution.tools, goal, strict=True)])
        least, since = np.inf, 0
        for trial in range(trials):
            command = Signal(0.0, bench.dt, u, execution.tools)
            q = bench.flow(command)
            settings = {"trial": float(trial), "margin": margin}
            outcome = Outcome("whole", score(bench.roads, execution, q, places), settings, execution, command)
            since = 0 if cost(outcome.score) < least else since + 1
            least = min(least, cost(outcome.score))
            if best is None or cost(outcome.score) < cost(best.score):
                best = outcome
            if since >= PATIENCE:
                break
            error = goal - q.values
            u = np.stack([laws[tool](u[i], error[i]) for i, tool in enumerate(execution.tools)])
    assert best is not None, "there is at least one margin and one trial"
    return best


def widened(wanted: Floats, margin: float, dt: float) -> Floats:
    """Hold each road's flow `margin` seconds before and after it; wanted[channel, n], mm^3/s, samples of dt."""
    reach = round(margin / dt)
    if reach < 1:
        return wanted
    return np.where(wanted > 0, wanted, maximum_filter1d(wanted, 2 * reach + 1, axis=1, mode="constant"))
