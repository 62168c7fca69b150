"""The pictures: that they are written, and what cannot be drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from gcodectl.errors import UsageError
from gcodectl.records import TaskKind
from gcodectl.report.flow import TaskSpan, plot_flow
from gcodectl.report.part import plot_part

T = np.arange(0, 10, 0.01)
ON = np.where((T > 2) & (T < 8), 5.0, 0.0)


def test_the_flow_plot_shows_tasks(tmp_path: Path):
    path = tmp_path / "flow.png"
    tasks = [
        TaskSpan(TaskKind.NO_FLOW, 0, 2, 0),
        TaskSpan(TaskKind.START, 2, 2.1, 2, 0.8),
        TaskSpan(TaskKind.STEADY, 2.1, 8, 2.1),
    ]
    plot_flow(path, T, wanted=ON, command=9 * ON, flow=0.9 * ON, speed=2 * ON, tasks=tasks, title="a road")
    with_tasks = imread(path)
    plot_flow(path, T, wanted=ON, command=9 * ON, flow=0.9 * ON, speed=2 * ON, title="a road")
    without = imread(path)
    assert with_tasks.shape == without.shape
    assert (with_tasks != without).mean() > 0.05
    green = (with_tasks[..., 1] > with_tasks[..., 0] + 0.15) & (with_tasks[..., 1] > with_tasks[..., 2] + 0.15)
    assert green.sum() > 20


def test_an_empty_window_is_refused(tmp_path: Path):
    with pytest.raises(UsageError, match="nothing between"):
        plot_flow(tmp_path / "flow.png", T, wanted=ON, command=ON, flow=ON, window=(50, 60))


@pytest.mark.parametrize("layers", [1, 13])
def test_the_part_is_blue_where_too_little_was_laid(tmp_path: Path, layers: int):
    path = tmp_path / "part.png"
    p0 = np.tile([[0.0, 0, 0], [0, 1, 0]], (layers, 1))
    p1 = p0 + np.array([9.0, 0, 0])
    layer = np.repeat(np.arange(layers), 2)
    plot_part(path, p0, p1, np.full(2 * layers, -0.4), layer)
    blue = imread(path)
    plot_part(path, p0, p1, np.full(2 * layers, 0.4), layer, title="too much")
    red = imread(path)
    assert (blue[..., 2] > blue[..., 0] + 0.2).sum() > 2 * (red[..., 2] > red[..., 0] + 0.2).sum()
    assert (red[..., 0] > red[..., 2] + 0.2).sum() > 2 * (blue[..., 0] > blue[..., 2] + 0.2).sum()


def test_a_part_without_roads_is_refused(tmp_path: Path):
    none = np.zeros((0, 3))
    with pytest.raises(UsageError, match="no road"):
        plot_part(tmp_path / "part.png", none, none, np.zeros(0), np.zeros(0, dtype=np.int64))
