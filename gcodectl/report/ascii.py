"""A signal as a picture of characters, for a terminal."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from gcodectl.columns import Floats

WIDTH, HEIGHT = 64, 11


def draw(values: Floats, dt: float, t0: float, width: int = WIDTH, height: int = HEIGHT) -> list[str]:
    """Return the lines of a plot of values[n], mm^3/s, over t0 + n dt, s; `:` marks t = 0, `-` the zero line."""
    edges = np.linspace(0, len(values), width + 1).astype(int)
    columns = [values[first : max(last, first + 1)] for first, last in pairwise(edges)]
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    step = (high - low) / (height - 1) or 1.0

    def row(value: float) -> int:
        return round((high - value) / step)

    grid = [["-" if line == row(0.0) else " "] * width for line in range(height)]
    task = int(-t0 / (len(values) * dt) * width)
    if 0 <= task < width:
        for cells in grid:
            cells[task] = ":"
    for place, column in enumerate(columns):
        for line in range(row(float(column.max())), row(float(column.min())) + 1):
            grid[line][place] = "*"
    lines = [f"{high - line * step:9.2f} |{''.join(cells)}" for line, cells in enumerate(grid)]
    end = t0 + len(values) * dt
    return [*lines, f"{'':9} +{'-' * width}", f"{'':10}{t0:<{width // 2}.2f}{end:>{width // 2 + 1}.2f} s"]
