"""What is wrong with a measurement is found, and nothing is found where nothing is wrong."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gcodectl.learn.model import Model
from gcodectl.learn.reference import training_routine, with_levels
from gcodectl.session.checking import alignment, delay_of, extent, resample, resting, saturation, scale, tallness
from gcodectl.session.measured import Series

ROUTINE = with_levels(training_routine(5.0))
SPEED = 10.0
EXTRUDERS = [Model(1.0, 0.05), Model(1.0, 1.0, 0.1), Model(0.9, 4.5), Model(1.1, 2.0, 0.3)]


def measured(model=EXTRUDERS[1], noise=0.0, step=0.02, kind="t,q", seed=0):
    q = model.predict(ROUTINE.q_ref, ROUTINE.dt)
    t = np.arange(step / 2.0, ROUTINE.duration, step)
    q = np.interp(t, ROUTINE.t + ROUTINE.dt / 2.0, q)
    q = q * (1.0 + noise * np.random.default_rng(seed).normal(size=len(q)))
    return Series(kind, t, q, source="m") if kind == "t,q" else Series(kind, t * SPEED, q / SPEED, source="m")


def faults(series, shift=0.0):
    found = [*extent(series, ROUTINE, SPEED, shift), *saturation(series)]
    if not found:
        q = resample(series, ROUTINE, SPEED, 0.6, shift)
        found += scale(q, ROUTINE.q_ref)
    if not found:
        found += alignment(delay_of(ROUTINE.q_ref, q, ROUTINE.dt), [])
    return found


@pytest.mark.parametrize("model", EXTRUDERS)
@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("kind", ["t,q", "s,area"])
def test_nothing_is_found_where_nothing_is_wrong(model, noise, kind):
    assert faults(measured(model, noise, kind=kind)) == []


def test_a_coarse_camera_that_sees_whole_pixels_is_no_fault():
    series = measured()
    for pixel in (0.05, 0.5, 1.0):
        assert faults(dataclasses.replace(series, y=np.round(series.y / pixel) * pixel)) == []


def test_resampling_keeps_the_volume_and_bridges_small_holes():
    series = measured(step=0.05)
    y = series.y.copy()
    y[200:204] = np.nan
    q = resample(dataclasses.replace(series, y=y), ROUTINE, SPEED, 0.6)
    exact = EXTRUDERS[1].predict(ROUTINE.q_ref, ROUTINE.dt)
    assert q.sum() == pytest.approx(exact.sum(), rel=1e-3)
    assert np.abs(q - exact).max() < 0.35  # a mean over 50 ms, in a rise of 1 s
    shifted = resample(dataclasses.replace(series, x=series.x + 0.5), ROUTINE, SPEED, 0.6, -0.5)
    assert shifted == pytest.approx(resample(series, ROUTINE, SPEED, 0.6))


@pytest.mark.parametrize(
    ("spoil", "what", "said"),
    [
        (lambda s: s[: len(s.x) // 2], "short", "covers t from 0.01 to 16.9"),
        (lambda s: s[200:], "short", "measure the rest"),
        (lambda s: s.gap(300, 400), "missing", "has holes at t = 5.99 to 8.01 s"),
        (lambda s: s.but(x=s.x / 60.0), "scale", "as in `t [min]`"),
        (lambda s: s.but(x=s.x * 1000.0), "scale", "as in `t [ms]`"),
        (lambda s: s.but(y=s.y * 60.0), "scale", "it looks like mm^3/min"),
        (lambda s: s.but(y=s.y / 60.0), "scale", "it looks like ml/min"),
        (lambda s: s.but(y=s.y * 1000.0), "scale", "times the volume that was pushed: it looks like"),
        (lambda s: s.but(y=s.y * 0.0 + 1e-3), "scale", "see that"),
        (lambda s: s.but(y=-s.y), "scale", "flows the wrong way: turn the sign of its column"),
        (lambda s: s.but(x=s.x + 12.0), "misaligned", "counted from another begin: correct it with --shift -12.01"),
        (lambda s: s.but(x=s.x - 2.0), "misaligned", "counted from another begin: correct it with --shift 1.99"),
        (lambda s: s.but(x=s.x * 40.0), "scale", "and the path over 33.89 s: see to its unit"),
        (lambda s: s[::20], "missing", "has a row every 0.4 s, and at least one every 0.3 s is needed"),
        (lambda s: s.but(y=np.minimum(s.y, 4.0)), "saturated", "cut off at q = 4 over"),
        (lambda s: s.but(x=s.x - 0.4, tail=0.4), "misaligned", "before the plunger moves"),
        (lambda s: s.but(x=s.x + 1.6, head=1.6), "misaligned", "after the plunger"),
        (lambda s: s.but(y=s.y * 0.0 + 4.0), "misaligned", "does not follow the plunger"),
    ],
)
def test_what_is_wrong_is_found_and_said(spoil, what, said):
    found = faults(spoil(Spoiled(measured(noise=0.05))).series)
    assert [one.what for one in found] == [what]
    assert said in found[0].sentence


@pytest.mark.parametrize(("height", "found"), [(0.6, []), (0.3, []), (1.5, []), (600.0, ["scale"]), (6e-4, ["scale"])])
def test_a_height_in_another_unit_is_found(height, found):
    beads = measured(kind="s,area")
    series = dataclasses.replace(beads, kind="s,width", height=np.full(len(beads.x), height))
    assert [one.what for one in tallness(series, 0.6)] == found


@pytest.mark.parametrize(("zero", "said"), [(0.0, False), (0.1, False), (0.5, True), (-0.5, True)])
def test_what_flows_before_the_plunger_moves_is_noted(zero, said):
    q = EXTRUDERS[1].predict(ROUTINE.q_ref, ROUTINE.dt) + zero
    q += np.random.default_rng(1).normal(0.0, 0.01, len(q))
    found = resting(q, ROUTINE.q_ref, ROUTINE.dt, ROUTINE.flow)
    assert len(found) == said
    assert not said or f"reads {zero:.1f}" in found[0]


def test_what_another_print_of_the_session_says_of_alignment():
    assert alignment(0.3, [0.25, 0.3, 0.35]) == []
    (late,) = alignment(0.8, [0.25, 0.3, 0.35])
    assert "0.50 s later than in the session's other prints" in late.sentence
    assert "--shift -0.50" in late.sentence
    (early,) = alignment(-0.1, [0.3])
    assert "--shift 0.40" in early.sentence
    (again,) = alignment(-0.1, [0.3], 1.0)
    assert "--shift 1.40" in again.sentence  # in place of the shift of 1 s that was asked for


@pytest.mark.parametrize("model", EXTRUDERS)
@pytest.mark.parametrize("off", [-0.5, 0.0, 0.5])
def test_a_shift_is_told_to_a_tenth_of_a_second(model, off):
    q = model.predict(ROUTINE.q_ref, ROUTINE.dt)
    moved = np.interp(ROUTINE.t - off, ROUTINE.t, q, left=0.0)
    assert delay_of(ROUTINE.q_ref, moved, ROUTINE.dt) - model.delay == pytest.approx(off, abs=0.1)


class Spoiled:
    """A measurement to be spoiled."""

    def __init__(self, series):
        self.series = series
        self.x, self.y = series.x, series.y

    def __getitem__(self, rows):
        return Spoiled(dataclasses.replace(self.series, x=self.x[rows], y=self.y[rows]))

    def gap(self, low, high):
        return self[np.r_[0:low, high : len(self.x)]]

    def but(self, head=0.0, tail=0.0, **changes):
        """Change columns; `head` and `tail`: so many seconds of nothing put before and after."""
        one = dataclasses.replace(self.series, **changes)
        x, y = one.x, one.y
        if head:
            x, y = np.append(np.arange(0.0, head, 0.02), x), np.append(np.zeros(len(np.arange(0.0, head, 0.02))), y)
        if tail:
            more = x[-1] + np.arange(0.02, tail, 0.02)
            x, y = np.append(x, more), np.append(y, np.zeros(len(more)))
        return Spoiled(dataclasses.replace(one, x=x, y=y))
