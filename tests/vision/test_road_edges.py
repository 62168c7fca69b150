"""Edges: a blurred road's width is its own, thin or wide, with a highlight, a shadow, or darker flanks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from gcodectl.vision.edges import find_blur, find_edges

X = np.linspace(-2.0, 2.0, 161)
SIGMA = 0.08


def road(width, middle=0.0, level=1.0, sigma=SIGMA):
    low, high = middle - width / 2, middle + width / 2
    return level * (ndtr((X - low) / sigma) - ndtr((X - high) / sigma))


def noisy(profile, seed=0, deviation=0.02):
    return profile + deviation * np.random.default_rng(seed).standard_normal((200, len(X)))


@pytest.mark.parametrize("width", [0.08, 0.15, 0.3, 0.5, 0.84, 2.0])
def test_a_width_is_found_without_bias(width):
    found = find_edges(noisy(road(width, 0.03)), X, SIGMA, 0.84, rim=0.0)
    assert found.there.all()
    assert found.width.mean() == pytest.approx(width, abs=0.006)
    assert found.width.std() < 0.03


def test_nothing_is_found_in_noise():
    found = find_edges(noisy(np.zeros(len(X))), X, SIGMA, 0.84)
    assert not found.there.any()
    assert np.all(found.width == 0.0)


@pytest.mark.parametrize("light", [3.0, -2.0])
def test_a_highlight_changes_nothing(light):
    shining = road(0.84) + light * road(0.1, 0.15)
    found = find_edges(noisy(shining), X, SIGMA, 0.84, rim=0.0)
    assert found.width.mean() == pytest.approx(0.84, abs=0.02)


def test_a_shadow_beside_it_is_not_road():
    shadow = 0.3 * np.exp(-((X - 0.42) ** 2) / (2 * 0.3**2)) * ndtr((X - 0.42) / SIGMA)
    found = find_edges(noisy(road(0.84) + shadow), X, SIGMA, 0.84, rim=0.0)
    assert found.width.mean() == pytest.approx(0.84, abs=0.02)


def test_a_road_far_from_the_line_is_another():
    found = find_edges(noisy(road(0.84, 1.4)), X, SIGMA, 0.84)
    assert not found.there.any()


@pytest.mark.parametrize("sigma", [0.04, 0.08, 0.16])
def test_the_blur_is_found(sigma):
    assert find_blur(noisy(road(0.84, sigma=sigma)), X, 0.84, 25.0) == pytest.approx(sigma, rel=0.12)
