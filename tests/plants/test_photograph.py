"""The simulated photograph: the bead covers as many pixels as it is wide, and every part of the scene does its part."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gcodectl.errors import UsageError
from gcodectl.vision.sheet import Sheet
from plant_models.photo_canvas import covered
from plant_models.photo_scene import GROUNDS, MATERIALS, Scene, draw_scene
from plant_models.photograph import Strip, photograph

SHEET = Sheet((-10.0, -10.0), (50.0, 20.0))
SIZE = (900, 600)
S = np.arange(0.0, 40.5, 0.5)
LINE = Strip(np.array([[0.0, 5.0], [40.0, 5.0]]), S, np.full(len(S), 1.5), np.array([[-5.0, 0.0], [-5.0, 10.0]]), 1.5)
PLAIN = Scene(1, "silicone", "dark glass", noise=0.0, blur=0.3)


def middle_column(scene: Scene, strip: Strip = LINE) -> np.ndarray:
    """Light down the column in the picture's middle."""
    codes = photograph(strip, SHEET, scene, size=SIZE)[:, SIZE[0] // 2].mean(axis=1) / 255.0
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def window(column: np.ndarray) -> np.ndarray:
    return column[SIZE[1] // 2 - 60 : SIZE[1] // 2 + 60]


def wide(column: np.ndarray) -> float:
    """Width in pixels, from the light that the road adds to the ground."""
    part = window(column)
    ground = np.median(part)
    return float((part - ground).sum() / (part.max() - ground))


def test_shares_of_pixels_are_exact():
    square = np.array([[10.3, 5.2], [50.7, 5.2], [50.7, 20.9], [10.3, 20.9]])
    shares = covered(100, 40, [square])
    assert shares.sum() == pytest.approx(40.4 * 15.7, rel=1e-3)
    assert shares[12, 10] == pytest.approx(0.2, abs=0.01)  # 10.3 to 10.5
    beside = square + np.array([40.4, 0.0])
    assert covered(100, 40, [square, beside])[12].sum() == pytest.approx(80.8, rel=1e-3)


def test_a_bead_covers_its_width():
    per_mm = SIZE[0] * 0.94 / np.ptp(np.stack(SHEET.paper)[:, 0])
    assert wide(middle_column(PLAIN)) == pytest.approx(1.5 * per_mm, rel=0.03)
    twice = dataclasses.replace(LINE, width=2 * LINE.width)
    assert wide(middle_column(PLAIN, twice)) == pytest.approx(3.0 * per_mm, rel=0.03)


def test_what_is_not_laid_is_not_seen():
    nothing = dataclasses.replace(LINE, width=np.where(S > 15, 0.0, 1.5))
    assert np.ptp(window(middle_column(PLAIN, nothing))) < 0.01


def test_a_scene_is_the_same_for_a_seed_and_differs_by_seed():
    assert draw_scene(3) == draw_scene(3)
    assert draw_scene(3) != draw_scene(4)
    one = photograph(LINE, SHEET, draw_scene(3), size=SIZE)
    np.testing.assert_array_equal(one, photograph(LINE, SHEET, draw_scene(3), size=SIZE))
    assert (one.shape, one.dtype) == ((600, 900, 3), np.uint8)


@pytest.mark.parametrize("lighter", [True, False])
def test_a_material_is_drawn_lighter_or_darker_than_the_ground(lighter):
    for seed in range(20):
        scene = draw_scene(seed, lighter=lighter)
        assert (sum(MATERIALS[scene.material]) > sum(GROUNDS[scene.ground])) == lighter


@pytest.mark.parametrize(
    "change",
    [
        {"vignetting": 0.4}, {"gradient": (0.2, 0.0)}, {"texture": 0.05}, {"shadow": 0.5}, {"flank": 0.3},
        {"gloss": 0.5}, {"blur": 2.0}, {"noise": 0.05}, {"jpeg": 50}, {"radial": (0.1, 0.0)}, {"tilt": (4.0, 0.0)},
        {"roll": 3.0}, {"shift": (1.0, 0.0, 0.0)}, {"exposure": 0.5}, {"focal": 0.5, "tilt": (4.0, 0.0)},
    ],
)  # fmt: skip
def test_every_part_of_a_scene_changes_the_photograph(change):
    plain = photograph(LINE, SHEET, PLAIN, size=SIZE).astype(int)
    changed = photograph(LINE, SHEET, dataclasses.replace(PLAIN, **change), size=SIZE).astype(int)
    assert np.mean(np.abs(changed - plain) > 1) > 1e-3


def test_the_light_falls_off_towards_the_corners():
    dim = photograph(LINE, SHEET, dataclasses.replace(PLAIN, ground="paper", vignetting=0.4), size=SIZE).mean(axis=2)
    assert dim[20:40, 20:40].mean() < 0.9 * dim[200:220, 440:460].mean()


def test_a_high_bead_is_seen_wider_from_aside():
    tilted = dataclasses.replace(PLAIN, tilt=(20.0, 0.0))
    flat, high = (middle_column(tilted, dataclasses.replace(LINE, height=h)) for h in (0.0, 1.5))
    assert wide(high) > wide(flat) + 0.5


def test_a_part_of_the_bed_fills_the_picture():
    near = photograph(LINE, SHEET, PLAIN, size=SIZE, looking_at=np.array([[10.0, 0.0], [30.0, 10.0]]))
    whole = photograph(LINE, SHEET, PLAIN, size=SIZE)
    bright = [int((image[150:450, 450].mean(axis=1) > 150).sum()) for image in (whole, near)]
    assert bright[1] > 2 * bright[0] > 0


@pytest.mark.parametrize(
    "wrong", [{"width": np.full(len(S), np.nan)}, {"width": S[1:]}, {"nominal": 0.0}, {"s": S[::-1]}, {"height": -1.0}]
)
def test_a_strip_that_cannot_be_is_refused(wrong):
    with pytest.raises(UsageError):
        dataclasses.replace(LINE, **wrong)
    with pytest.raises(UsageError, match="nougat"):
        Scene(0, "nougat")
