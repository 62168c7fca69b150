"""From frames to surfaces, on a part that nothing here sees: registration, the scan, the cleaning, the whole chain."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gcodectl.errors import InputError
from gcodectl.thermal.cleaning import clean
from gcodectl.thermal.cooling import standardised
from gcodectl.thermal.frames import Frames
from gcodectl.thermal.fresh import fresh_threshold, layings, otsu
from gcodectl.thermal.perspective import Perspective, fit_perspective
from gcodectl.thermal.radiance import apparent
from gcodectl.thermal.road import Road
from gcodectl.thermal.scan import window
from gcodectl.thermal.track import locate, track
from plant_models.cooling import cooling_part
from plant_models.cooling_camera import EMISSIVITY, Camera

SPAN = 100.0
"""s of a layer that is recorded here."""


def held(frames: Frames) -> Frames:
    images = [frames[k] for k in range(len(frames))]
    return Frames(frames.times, frames.names, lambda k: images[k])


@pytest.fixture(scope="module")
def recorded():
    part = cooling_part("wall", 5)
    camera = Camera(part)
    frames = held(camera.frames(np.arange(0.0, SPAN)))
    return part, camera, frames, fit_perspective(*camera.matches())[0]


@pytest.fixture(scope="module")
def tracked(recorded):
    part, _, frames, perspective = recorded
    (one,) = track(frames, part.road, perspective, part.band, EMISSIVITY)
    return one


def test_temperatures_are_those_of_the_surface(recorded, tracked):
    part, _, _, _ = recorded
    true = part.temperatures(tracked.times[None, :])
    error = tracked.temperatures - true
    assert np.sqrt(np.nanmean(error**2)) < 2.0
    assert np.sqrt(np.nanmean(error[1:] ** 2)) < 1.0
    late = tracked.times > part.deposited[-1] + 5.0
    assert np.isfinite(error[:, late]).all()
    hidden = late & (tracked.raw < 100.0)
    assert hidden.sum() > 100  # the head did stand before it,
    assert np.sqrt(np.mean(error[hidden] ** 2)) < 1.5  # and what it hid is known
    assert tracked.cleaned.cold >= hidden.sum()
    ahead = tracked.surface.at(np.full(len(part.s), 180.0), part.band.ambient) - part.temperatures(180.0)
    assert np.sqrt(np.mean(ahead**2)) < 4.0
    assert tracked.residual < 0.5
    kept = np.where(tracked.cleaned.kept, tracked.raw, np.nan)
    assert np.nanmax(np.abs(standardised(tracked.cleaned.cooling, tracked.times, kept, 24.0))) <= 3.0
    assert len(tracked.cleaned.lost) == 0


def test_later_layers_are_found_by_themselves(tracked):
    part = cooling_part("wall", 5)
    camera, before = Camera(part), tracked.registered
    for layer in range(1, 10):
        part.print_layer(part.at_speed(250.0 * layer))
        if layer in (2, 3, 4, 6, 7):  # not every one is seen: what moved most since is found as well
            continue
        frames = held(camera.frames(250.0 * layer + np.arange(18.0)))
        ((_, found),) = locate(frames, part.road, before, part.band, EMISSIVITY)
        error = np.linalg.norm(found.perspective.pixels(part.points) - camera.pixels(part.points), axis=1)
        assert error.mean() < 1.0
        assert error.max() < 2.0
        assert found.moved > 1.0
        before = found


def test_a_corner_cut_off_by_the_frame(recorded):
    part, camera, frames, perspective = recorded
    cut = Frames(frames.times, frames.names, lambda k: frames[k][:, :515])
    (one,) = track(cut, part.road, perspective, part.band, EMISSIVITY)
    outside = np.flatnonzero(camera.pixels(part.points, 0)[:, 0] > 515)
    assert 5 < len(outside) < 25
    assert set(outside) <= set(one.cleaned.lost) <= set(range(outside[0] - 1, outside[-1] + 2))
    assert np.isnan(one.raw[outside[2:-2]]).all()
    late = one.times > 30.0
    error = (one.temperatures - part.temperatures(one.times[None, :]))[:, late]
    seen = np.setdiff1d(np.arange(1, len(part.s)), one.cleaned.lost)
    assert np.sqrt(np.mean(error[seen] ** 2)) < 1.0
    assert np.sqrt(np.mean(error[one.cleaned.lost] ** 2)) < 10.0  # guessed from its neighbours, over a bump


def test_frames_far_apart():
    part = cooling_part("wall", 5)
    camera = Camera(part)
    frames = held(camera.frames(np.arange(0.0, 245.0, 12.0)))
    (one,) = track(frames, part.road, fit_perspective(*camera.matches())[0], part.band, EMISSIVITY)
    error = one.temperatures - part.temperatures(one.times[None, :])
    assert np.sqrt(np.nanmean(error[1:] ** 2)) < 1.5


def test_two_layers_of_one_recording(recorded):
    part = cooling_part("wall", 5)
    camera = Camera(part)
    first = held(camera.frames(np.arange(0.0, 60.0, 2.0)))
    part.print_layer(part.at_speed(130.0))
    second = held(camera.frames(np.arange(130.0, 190.0, 2.0)))
    both = Frames(
        np.concatenate([first.times, second.times]), first.names + second.names,
        lambda k: first[k] if k < len(first) else second[k - len(first)],
    )  # fmt: skip
    found = track(both, part.road, recorded[3], part.band, EMISSIVITY)
    assert [one.laying.first for one in found] == [1, len(first) + 1]
    assert found[0].laying.until == found[1].laying.first
    error = found[1].temperatures - part.temperatures(found[1].times[None, :])
    assert np.sqrt(np.nanmean(error[1:] ** 2)) < 1.5


def test_the_chassis_heated_again():
    part = cooling_part("chassis", 6)
    camera = Camera(part)
    frames = held(camera.frames(np.arange(0.0, 124.0, 1.5)))
    (one,) = track(frames, part.road, fit_perspective(*camera.matches())[0], part.band, EMISSIVITY)
    law = part.truth()
    again = np.flatnonzero(law.t0 > part.deposited)
    assert len(np.intersect1d(one.cleaned.heated, again)) > 0.8 * len(again)
    assert len(np.setdiff1d(one.cleaned.heated, np.concatenate([again - 1, again, again + 1]))) == 0
    sure = again[1:-1]
    assert np.median(np.abs(one.surface.t0[sure] - law.t0[sure])) < 5.0
    t = np.full(len(part.s), 120.0)
    error = one.surface.at(t, part.band.ambient) - part.temperatures(t)
    assert np.sqrt(np.mean(error[1:] ** 2)) < 2.0


def test_otsu_leaves_the_least_variance_within():
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(30, 5, 3000), rng.normal(200, 10, 700)]).astype(np.float32)
    levels = np.arange(31.0, 199.0)
    within = [values[values <= one].var() * np.mean(values <= one) + values[values > one].var() * np.mean(values > one)
              for one in levels]  # fmt: skip
    best = levels[int(np.argmin(within))]
    assert np.count_nonzero((values > best) != (values > otsu(values))) <= 2
    three = np.concatenate([values, rng.normal(120, 10, 3000)]).astype(np.float32)
    assert otsu(three) < 120.0 < 150.0 <= fresh_threshold(three[None, :], 150.0) < 185.0


def test_a_window_is_a_circle_in_the_plane():
    flat = Perspective(np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]))
    road = Road.along(np.array([[20.0, 30.0], [100.0, 30.0]]), 10.0, 1.0)
    slots = window(flat, road, (60, 130))
    image = np.zeros((60, 130), dtype=np.float32)
    image[34, 60] = 7.0  # 4 px beside the path
    seen = dataclasses.replace(slots, smooth=np.zeros(len(road), dtype=bool)).highest(image)
    away = np.hypot(60.0 - road.xy[:, 0], 4.0)
    np.testing.assert_array_equal(seen, np.where(away <= 5.0, 7.0, 0.0))
    assert slots.smooth.all()
    out = window(flat, road, (60, 50))
    assert np.isnan(out.highest(image[:, :50])[-1])
    assert np.isfinite(out.highest(image[:, :50])[0])


def test_cleaning_drops_what_is_not_the_surface():
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 120.0)
    true = 90.0 + 150.0 * np.exp(-0.012 * t) + np.zeros((3, 1))
    raw = true + rng.normal(0, 0.3, true.shape)
    raw[:, :10] = 45.0
    raw[0, 30:36], raw[0, 36] = 45.0, 140.0  # hidden, and half hidden
    raw[1, 70] += 3.0
    raw[2, 50:] = 80.0 + (raw[2, 50] - 80.0 + 40.0) * np.exp(-0.015 * (t[50:] - 50.0)) + rng.normal(0, 0.3, 70)
    found = clean(t, raw, 12.0, 24.0)
    assert found.cold == 7
    assert not found.kept[0, 30:37].any()
    assert not found.kept[1, 70]
    assert 1 <= found.outlying < 12
    assert found.heated.tolist() == [2]
    assert found.cooling.t0.tolist() == [13.0, 13.0, 50.0]
    np.testing.assert_allclose(found.temperatures[0, 30:37], true[0, 30:37], atol=0.5)
    np.testing.assert_allclose(found.cooling.b1, [-0.012, -0.012, -0.015], rtol=0.1)
    assert np.isnan(found.temperatures[2, :50]).all()
    raw[1] = 45.0
    with pytest.raises(InputError, match=r"1 of 3 locations show no cooling \(location 1 has 0 of 120 frames"):
        clean(t, raw, 12.0, 24.0)


def test_a_location_without_a_curve_takes_its_neighbours(recorded, tracked):
    part, camera, frames, perspective = recorded
    hole = np.round(camera.pixels(part.points, 0)[60]).astype(int)
    box = np.s_[hole[1] - 9 : hole[1] + 10, hole[0] - 8 : hole[0] + 9]

    def hidden(k):
        image = frames[k].copy()
        image[box] = 24.0
        return image

    (one,) = track(Frames(frames.times, frames.names, hidden), part.road, perspective, part.band, EMISSIVITY)
    assert 60 in one.cleaned.lost
    assert len(one.cleaned.lost) <= 3
    t = np.full(len(part.s), 90.0)
    assert abs(one.surface.at(t, 24.0)[60] - tracked.surface.at(t, 24.0)[60]) < 2.0


@pytest.mark.parametrize("case", ["cold", "outside", "elsewhere", "short", "size", "nan"])
def test_bad_recordings_are_named(recorded, case):
    part, _, frames, perspective = recorded
    road, images = part.road, [frames[k] for k in range(40)]
    if case == "cold":
        images = [np.full_like(one, 31.0) for one in images]
        message = r"no frame from frame 0 .* to frame 39 .*hottest pixel reads 31 degC"
    elif case == "outside":
        road = Road.along(np.array([[0, 0], [4000.0, 0], [4000.0, 500.0]]), 20.0)
        message = r"frame 0 .*: \d+ % of the path is outside the frame \(640 x 512 px\): x \d+"
    elif case == "elsewhere":
        road = Road.along(np.array([[100, 60], [800.0, 60], [800.0, 140.0], [100.0, 140.0], [100, 60]]), 20.0)
        message = r"frame \d+ .*: only \d+ % of the path lies on fresh road"
    elif case == "short":
        images = images[:16]
        message = r"frame 1 .* and after: \d+ of 110 locations show no cooling"
    elif case == "size":
        images[20] = images[20][:-2]
        message = r"frame 20 .*: it is 640 x 510 pixels"
    else:
        images[7] = np.where(np.arange(640) < 40, np.nan, images[7])
        message = r"frame 7 .*are no numbers"
    bad = Frames(frames.times[: len(images)], frames.names[: len(images)], lambda k: images[k])
    with pytest.raises(InputError, match=message):
        track(bad, road, perspective, part.band, EMISSIVITY)


def test_hidden_by_the_head_is_not_laid_anew(recorded):
    part, _, frames, _ = recorded
    found = layings(frames, apparent(200.0, EMISSIVITY, 24.0))
    assert len(found) == 1
    assert abs(frames.times[found[0].last] - part.deposited[-1]) < 6.0
