"""The part from above, layer by layer, coloured by the error of its bead."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from gcodectl.columns import Floats, Ints
from gcodectl.errors import UsageError

SPAN = 0.5
"""Errors beyond plus or minus 50 % have the same colour."""
MOST_LAYERS = 12


def plot_part(
    path: Path,
    p0: Floats,
    p1: Floats,
    error: Floats,
    layer: Ints,
    *,
    title: str = "",
    width: float = 0.84,
    most: int = MOST_LAYERS,
    names: Mapping[int, str] | None = None,
    columns: int = 4,
) -> None:
    """Draw pieces of road from p0 to p1 (mm, shape (n, 3)) coloured by error (-1 empty, 0 right) to a PNG.

    At most `most` layers are shown, evenly chosen, the first and the last among them; `width` is the bead's, mm.
    `names` are the panels' titles by layer, in place of the layer's number.
    """
    if not len(error):
        raise UsageError("there is no road to draw")
    layers = np.unique(layer)
    if len(layers) > most:
        layers = layers[np.round(np.linspace(0, len(layers) - 1, most)).astype(int)]
    columns = min(columns, len(layers))
    lines = -(-len(layers) // columns)
    low, high = np.minimum(p0, p1)[:, :2].min(axis=0), np.maximum(p0, p1)[:, :2].max(axis=0)
    low, high = low - width, high + width
    wide, tall = np.maximum(high - low, 1e-3)
    side = 9.0 if len(layers) == 1 else 3.6
    figure = Figure(
        figsize=(side * columns + 1.2, min(4.0, max(0.3, tall / wide)) * side * lines + 0.9), layout="constrained"
    )
    grid = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    points_a_mm = 72 * side * 0.85 / wide
    drawn = None
    for axes, number in zip(grid.flat, layers, strict=False):
        chosen = layer == number
        drawn = LineCollection(
            np.stack([p0[chosen, :2], p1[chosen, :2]], axis=1).tolist(),
            array=error[chosen] * 100,
            cmap="RdBu_r",
            clim=(-100 * SPAN, 100 * SPAN),
            linewidths=max(0.6, 0.9 * width * points_a_mm),
            capstyle="butt",
        )
        axes.add_collection(drawn)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", facecolor="#d9d9d9")
        axes.set_title((names or {}).get(int(number), f"layer {number}"), fontsize=9)
        axes.tick_params(labelsize=7)
    for axes in list(grid.flat)[len(layers) :]:
        axes.set_visible(False)
    assert drawn is not None, "there is at least one layer"
    bar = figure.colorbar(drawn, ax=grid.ravel().tolist(), extend="both", shrink=0.8)
    bar.set_label("bead error, % (blue: too little, red: too much)")
    if title:
        figure.suptitle(title)
    figure.savefig(path, dpi=110)
