"""Perspective: exact where points are exact, least squares where not, and refused where the points leave it open."""

from __future__ import annotations

import numpy as np
import pytest

from gcodectl.errors import InputError, UsageError
from gcodectl.thermal.perspective import Perspective, fit_perspective
from gcodectl.thermal.road import Road

TRUE = Perspective(np.array([[0.6, -0.1, 80.0], [0.02, -0.35, 300.0], [0.0, 0.0004, 1.0]]))
SQUARE = np.array([[0.0, 0.0], [900.0, 0.0], [900.0, 200.0], [0.0, 200.0]])


def test_four_points_are_enough():
    found, rms = fit_perspective(SQUARE, TRUE.pixels(SQUARE))
    others = np.array([[300.0, 50.0], [700.0, 150.0]])
    np.testing.assert_allclose(found.pixels(others), TRUE.pixels(others), atol=1e-4)
    np.testing.assert_allclose(found.plane(TRUE.pixels(others)), others, atol=1e-3)
    assert rms < 1e-4


def test_the_papers_formula_is_affine_only_and_this_is_not():
    points = np.vstack([SQUARE, 0.5 * (SQUARE + np.roll(SQUARE, 1, axis=0))])
    seen = TRUE.pixels(points)
    R, S = np.column_stack([points, np.ones(8)]).T, np.column_stack([seen, np.ones(8)]).T
    paper = Perspective(S @ R.T @ np.linalg.inv(R @ R.T))
    np.testing.assert_allclose(paper.matrix[2], [0, 0, 1], atol=1e-9)
    found, _ = fit_perspective(points, seen)
    assert np.abs(found.pixels(points) - seen).max() < 1e-4 < 1.0 < np.abs(paper.pixels(points) - seen).max()


def test_more_points_take_the_noise_out():
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0], [900, 200], (200, 2))
    worst = {}
    for count in (6, 200):
        marked = TRUE.pixels(points[:count]) + rng.normal(0, 0.5, (count, 2))
        found, rms = fit_perspective(points[:count], marked)
        worst[count] = np.abs(found.pixels(SQUARE) - TRUE.pixels(SQUARE)).max()
        assert 0.1 < rms < 1.0
    assert worst[200] < 0.6 < worst[6]


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (SQUARE[:3], "four matching points or more.*not 3"),
        (np.column_stack([np.arange(5.0), 2 * np.arange(5.0)]), "three of every four on a line"),
        (np.repeat(SQUARE[:1], 4, axis=0), "three of every four on a line"),
        (np.where(SQUARE == 900, np.nan, SQUARE), "is no number"),
    ],
)
def test_points_that_leave_it_open_are_refused(points, message):
    with pytest.raises(InputError, match=message):
        fit_perspective(points, TRUE.pixels(SQUARE)[: len(points)] if len(points) < 5 else points)


def test_seen_from_straight_above():
    image = np.zeros((400, 700), dtype=np.float32)
    corner = np.round(TRUE.pixels(np.array([[450.0, 100.0]]))[0]).astype(int)
    image[corner[1] - 1 : corner[1] + 2, corner[0] - 1 : corner[0] + 2] = 1.0
    flat = TRUE.warped(image, np.array([0.0, 0.0]), np.array([900.0, 200.0]), 0.5)
    assert flat.shape == (100, 450)
    assert np.abs(np.argwhere(flat > 0.5).mean(axis=0) - [50, 225]).max() < 1.5


def test_a_road_is_cut_into_locations():
    road = Road.along(np.array([[0, 0], [100, 0], [100, 0], [100, 50]]), 10.0)
    assert len(road) == 15
    np.testing.assert_allclose(road.s[[0, -1]], [5, 145])
    np.testing.assert_allclose(road.xy[[0, 12]], [[5, 0], [100, 25]])
    np.testing.assert_allclose(road.across[[0, 12]], [[0, 1], [-1, 0]])
    for corners in (np.zeros((1, 2)), np.zeros((4, 2)), np.array([[0, 0], [np.nan, 1]])):
        with pytest.raises(UsageError, match="a path"):
            Road.along(corners, 10.0)
