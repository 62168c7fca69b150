"""Several photographs of one print: joined where they overlap; one without the datum road goes by one that has it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from strips import LIGHT, SIZE, errors, rms, sheet, strip

from gcodectl.errors import InputError, UsageError
from gcodectl.vision.join import join_widths, measure_session
from gcodectl.vision.view import Shift
from gcodectl.vision.widths import Widths, measure_widths
from plant_models.photograph import photograph


def made_up(width, note="a") -> Widths:
    k = len(width)
    return Widths(np.arange(k) * 0.5, np.array(width), 1.0, Shift(), 0.01, np.zeros((k, 2, 2)), (note,))


def test_a_mean_where_several_see_it_and_nothing_where_none_does():
    joined = join_widths([made_up([1.0, np.nan, 2.0, np.nan]), made_up([3.0, 4.0, np.nan, np.nan], "b")])
    np.testing.assert_array_equal(joined.width, [2.0, 4.0, 2.0, np.nan])
    assert joined.notes[:2] == ("a", "b")
    assert "25 %" in joined.notes[2]
    assert "100.0 %" in joined.notes[2]
    assert np.isnan(joined.edges).all()


def test_what_does_not_belong_together_is_not_joined():
    with pytest.raises(UsageError, match="different"):
        join_widths([made_up([1.0]), made_up([1.0, 2.0])])
    with pytest.raises(UsageError):
        join_widths([])
    with pytest.raises(UsageError):
        measure_session([], strip().path, strip().datum, sheet())
    one = made_up([1.0])
    assert join_widths([one]) is one


def test_two_halves_make_a_strip():
    low, high = sheet().paper
    middle = 0.5 * (low[0] + high[0])
    halves = [np.array([[a, low[1]], [b, high[1]]]) for a, b in ((middle - 8, high[0]), (low[0], middle + 8))]
    images = [
        (name, photograph(strip(), sheet(), dataclasses.replace(LIGHT, seed=k), size=SIZE, looking_at=part))
        for k, (name, part) in enumerate(zip(("right.png", "left.png"), halves, strict=True))
    ]
    with pytest.raises(InputError, match="datum road") as refusal:
        measure_widths(images[0][1], strip().path, strip().datum, sheet(), name="right.png")
    assert "right.png" in str(refusal.value)
    joined = measure_session(images, strip().path, strip().datum, sheet())
    assert np.isfinite(joined.width).mean() > 0.98
    assert rms(errors(joined)) < 0.05
    with pytest.raises(InputError, match=r"right\.png"):
        measure_session(images[:1], strip().path, strip().datum, sheet())
