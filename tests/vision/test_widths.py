"""Widths from photographs: near to what was laid, wherever the sheet lies and whatever the colours; clear refusals."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from strips import DARK, LIGHT, NOZZLE, SIZE, errors, picture, rms, sheet, strip

from gcodectl.errors import InputError, UsageError
from gcodectl.vision.overlay import LEFT, overlay
from gcodectl.vision.view import Scale
from gcodectl.vision.widths import Widths, measure_widths
from plant_models.photo_scene import Scene
from plant_models.photograph import photograph


def measured(image, **more) -> Widths:
    return measure_widths(image, strip().path, strip().datum, sheet(), **more)


@pytest.fixture(scope="module")
def light() -> Widths:
    return measured(picture(LIGHT))


@pytest.mark.parametrize("scene", [LIGHT, DARK], ids=["light-on-dark", "dark-on-light"])
def test_a_strip_is_measured_within_a_few_per_cent(scene):
    found = measured(picture(scene))
    error = errors(found)
    assert np.isfinite(error).all()
    assert rms(error) < 0.05
    assert found.nominal == pytest.approx(NOZZLE, rel=0.06)
    assert found.residual < 0.05


def test_a_plain_photograph_is_measured_without_bias():
    plain = Scene(5, tilt=(2.0, 2.0), blur=1.0, noise=0.005)
    error = errors(measured(picture(plain)))
    true = np.interp(np.arange(len(error)) * 0.25, strip().s, strip().width)
    assert abs(np.mean(error[true > 0.25 * NOZZLE])) < 0.005
    assert rms(error) < 0.015


def test_it_tells_how_the_sheet_was_off(light):
    middle = 0.5 * (np.array(sheet().low) + sheet().high)
    angle = np.radians(LIGHT.shift[2])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    truth = (strip().path - middle) @ turn.T + middle + LIGHT.shift[:2]
    assert np.abs(light.shift.applied(strip().path) - truth).max() < 0.1
    assert light.shift.degrees == pytest.approx(LIGHT.shift[2], abs=0.05)
    assert "+0.9" in light.notes[0]


def test_nothing_is_measured_where_nothing_was_laid(light):
    clear = (light.s < 14) | ((light.s > 89) & (light.s < 96))
    assert np.all(light.width[clear] < 0.1 * NOZZLE)
    assert np.isnan(light.edges[clear]).any(axis=(1, 2)).mean() > 0.9


def test_a_strip_of_which_nothing_came_out_is_measured_as_nothing():
    empty = dataclasses.replace(strip(), width=np.zeros_like(strip().s))
    found = measured(photograph(empty, sheet(), LIGHT, size=SIZE))
    assert np.isfinite(found.width).all()
    assert np.mean(found.width > 0) < 0.02
    assert found.nominal == pytest.approx(NOZZLE, rel=0.06)


def test_a_photograph_upside_down_is_measured_all_the_same(light):
    turned = np.ascontiguousarray(picture(LIGHT)[::-1, ::-1])
    np.testing.assert_allclose(measured(turned).width, light.width, atol=0.03)


def test_a_grey_photograph_is_measured():
    grey = picture(DARK).mean(axis=2).astype(np.uint8)
    assert rms(errors(measured(grey))) < 0.06


def test_the_height_of_a_bead_is_taken_off_where_it_is_seen_aside():
    low = dataclasses.replace(LIGHT, focal=0.56, shadow=0.0, gloss=0.0, flank=0.0, tilt=(5.0, 4.0), texture=0.0)
    image = picture(low, 0.7 * NOZZLE)
    as_seen, put_right = measured(image).nominal, measured(image, height=0.7 * NOZZLE).nominal
    assert as_seen > 1.03 * NOZZLE
    assert put_right == pytest.approx(NOZZLE, rel=0.02)


def test_a_part_that_the_frame_cuts_off_is_not_seen():
    image = picture(LIGHT)[:, : int(0.7 * SIZE[0])]
    found = measured(np.ascontiguousarray(image))
    assert 0.1 < np.isnan(found.width).mean() < 0.6
    assert rms(errors(found)) < 0.05
    assert any("not seen" in note for note in found.notes)


def test_glare_and_what_lies_on_the_road_are_left_out():
    image = picture(LIGHT).copy()
    x, y = measured(image).edges[200].mean(axis=0).astype(int)
    image[y - 40 : y + 40, x - 40 : x + 40] = 255
    found = measured(image)
    assert np.isnan(found.width[200])
    assert np.isnan(found.width).mean() < 0.15
    assert rms(errors(found)) < 0.06


def test_a_phone_photograph_is_measured():
    found = measured(picture(LIGHT, size=(4000, 3000)))
    assert rms(errors(found)) < 0.04


def test_two_marks_or_a_scale_serve_in_place_of_the_sheet():
    straight = Scene(7, "silicone", "dark glass", blur=0.8, texture=0.01)
    image = photograph(strip(), sheet(), straight, size=SIZE, looking_at=np.array([[-19.0, -13.0], [69.0, 27.0]]))
    image = np.ascontiguousarray(image[190:-190, 60:-60])
    low, high = np.array([-19.0, -13.0]), np.array([69.0, 27.0])
    spread = SIZE[0] * 0.94 / (high - low)[0]
    middle, center = 0.5 * (low + high), 0.5 * (np.array(image.shape[1::-1]) - 1)
    marks = tuple(
        (tuple(center + spread * (np.array(at) - middle) * [1, -1]), at) for at in ((-12.0, 20.0), (60.0, 0.0))
    )
    for scale in (Scale(marks=marks), Scale(per_mm=spread)):
        found = measure_widths(image, strip().path, strip().datum, scale)
        assert rms(errors(found)) < 0.04
        assert found.residual == 0.0


def test_an_overlay_draws_the_edges(light):
    drawn = overlay(picture(LIGHT), light)
    changed = np.any(drawn != picture(LIGHT), axis=2)
    assert 0.001 < changed.mean() < 0.05
    x, y = np.round(light.edges[150, 0]).astype(int)
    near = drawn[y - 1 : y + 2, x - 1 : x + 2].reshape(-1, 3).astype(int)
    assert np.abs(near - LEFT).sum(axis=1).min() < 120
    np.testing.assert_array_equal(overlay(picture(LIGHT)[:, :, 0], light).shape, picture(LIGHT).shape)


def blank(image):
    return np.full_like(image, 128)


def no_road(_):
    bare = dataclasses.replace(strip(), width=np.zeros_like(strip().s), datum=np.array([[900.0, 0], [900.0, 9]]))
    return photograph(bare, sheet(), LIGHT, size=SIZE)


def overexposed(_):
    return photograph(strip(), sheet(), dataclasses.replace(DARK, exposure=4.0, blur=0.7), size=SIZE)


def blurred(image):
    import cv2

    return cv2.GaussianBlur(image, (0, 0), 12.0)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (blank, "none of the sheet's"),
        (no_road, "nothing stands out"),
        (overexposed, r"overexposed|markers"),
        (blurred, "markers|blurred"),
        (lambda image: image[:100, :150], "too small"),
        (lambda image: image[450:850, 700:1100], "markers"),
        (lambda image: image.astype(np.float64), "no photograph"),
        (lambda image: image[:, :, :2], "no photograph"),
    ],
)
def test_what_cannot_be_measured_is_refused_by_name(spoil, says):
    with pytest.raises(InputError, match=says) as refusal:
        measured(spoil(picture(LIGHT)), name="IMG_7.jpg")
    assert str(refusal.value).startswith("IMG_7.jpg")


def test_another_road_is_not_taken_for_this_one():
    other = dataclasses.replace(strip(), path=np.array([[0.0, 0.0], [50.0, 14.0], [10.0, 14.0], [60.0, 3.0]]))
    image = photograph(other, sheet(), LIGHT, size=SIZE)
    with pytest.raises(InputError, match="not found"):
        measured(image)


@pytest.mark.parametrize(
    ("path", "datum", "step"),
    [
        (np.zeros((1, 2)), np.array([[0.0, 0], [0, 9]]), 0.25),
        (np.array([[0.0, 0], [np.nan, 1]]), np.array([[0.0, 0], [0, 9]]), 0.25),
        (np.array([[0.0, 0], [10, 0]]), np.array([[0.0, 0], [0, 0]]), 0.25),
        (np.array([[0.0, 0], [10, 0]]), np.array([[0.0, 0], [0, 9]]), 0.0),
    ],
)
def test_a_path_that_is_none_is_refused(path, datum, step):
    with pytest.raises(UsageError):
        measure_widths(picture(LIGHT), path, datum, sheet(), step)
    with pytest.raises(UsageError):
        Scale(per_mm=-1.0)
