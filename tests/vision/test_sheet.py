"""The sheet: what is printed is where it says, and is found there again."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gcodectl.errors import InputError, UsageError
from gcodectl.vision.rectify import find_camera
from gcodectl.vision.sheet import Sheet, sheet_around

SHEET = Sheet((10.0, -5.0), (130.0, 60.0))


def test_markers_stand_around_the_window_and_do_not_touch():
    corners = SHEET.corners
    low, high = corners.min(axis=1), corners.max(axis=1)
    outside = (high[:, 0] < 10) | (low[:, 0] > 130) | (high[:, 1] < -5) | (low[:, 1] > 60)
    assert outside.all()
    paper_low, paper_high = SHEET.paper
    assert np.all(low > paper_low)
    assert np.all(high < paper_high)
    centers = corners.mean(axis=1)
    apart = np.abs(centers[:, None] - centers[None]).max(axis=2) + 1e9 * np.eye(len(centers))
    assert apart.min() > 1.3 * SHEET.marker


def test_its_image_is_found_where_it_is_known_to_be():
    per_mm = 8.0
    page = SHEET.image(per_mm)
    camera = find_camera(np.repeat(page[:, :, None], 3, axis=2), SHEET, "page")
    assert camera.markers == len(SHEET.corners)
    low, high = SHEET.paper
    points = np.array([[20.0, 0.0], [70.0, 30.0], [125.0, 55.0]])
    expected = (points - [low[0], high[1]]) * [per_mm, -per_mm] - 0.5
    assert np.abs(camera.pixels(points) - expected).max() < 0.3
    assert camera.position[2] > 100.0


def test_the_page_has_its_true_size_and_all_cells():
    page = SHEET.svg()
    low, high = SHEET.paper
    assert f'width="{high[0] - low[0]:g}mm" height="{high[1] - low[1]:g}mm"' in page
    black = sum(int((SHEET.bits(number) == 0).sum()) for number in range(len(SHEET.corners)))
    assert len(re.findall(r"M[-0-9.]+ [-0-9.]+h[0-9.]+v", page)) == black


def test_a_sheet_goes_around_points():
    around = sheet_around(np.array([[0.2, 0.2], [99.7, 40.0]]), 5.0)
    assert (around.low, around.high) == ((-5.0, -5.0), (105.0, 45.0))


@pytest.mark.parametrize(
    ("low", "high", "marker"),
    [
        ((0, 0), (0, 10), 0), ((0, 0), (-5, 10), 0), ((0, 0), (np.nan, 1), 0), ((0, 0), (1000, 1000), 5),
        ((0, 0), (9, 9), -1),
    ],
)  # fmt: skip
def test_a_sheet_that_cannot_be_is_refused(low, high, marker):
    with pytest.raises(UsageError):
        Sheet(low, high, marker)
    with pytest.raises(UsageError):
        sheet_around(np.zeros((0, 2)), 5.0)


def test_another_sheets_markers_do_not_pass_for_this_ones():
    other = Sheet((0.0, 0.0), (60.0, 90.0))
    page = np.repeat(other.image(8.0)[:, :, None], 3, axis=2)
    with pytest.raises(InputError, match="flat sheet"):
        find_camera(page, SHEET, "page")


def test_markers_in_one_row_are_not_enough():
    page = np.repeat(SHEET.image(8.0)[:, :, None], 3, axis=2)
    with pytest.raises(InputError, match="one row"):
        find_camera(np.ascontiguousarray(page[: int(8.0 * SHEET.rim)]), SHEET, "page")
