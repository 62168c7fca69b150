"""Ramps by each line's own speed: the virtual firmware, which knows one acceleration, moves as the plan does."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from filtering import DATA, HEAD, NEUTRAL, body, composed, filtered, moves_of
from following import lag

from gcodectl import pipeline
from gcodectl.columns import Floats
from gcodectl.gcode.cuts import LATE
from gcodectl.pipeline import Options, filter_stream
from gcodectl.records import Composed, Moves
from gcodectl.summary import Summary
from plant_models.firmware import Execution, execute

ROAD = "G1 X20 E0.02831\nG1 Y20 E0.02831\nG1 X30 Y30 F2400\n"
Following = Callable[..., None]


@pytest.fixture
def following(monkeypatch: pytest.MonkeyPatch) -> Following:
    """Let the filter know an extruder of some lag behind 25 mm^3/s, and give its ramps a share of its time."""

    def follow(share: float, tau: float = 1.0) -> None:
        monkeypatch.setattr(pipeline, "follow_of", lambda _options: lag(share, tau))

    return follow


def planned_path(plan: Composed, speed: float) -> tuple[Floats, Floats]:
    """When the plan is where, along all of its path, from the first row on that is not slower than `speed` mm/s."""
    p, moves = plan.profile, plan.moves
    on_path = (moves.length > 0) & (plan.speeds.distance > 0)
    rows = p.row - moves.row[0]
    kept = on_path[rows] & (plan.speeds.cruise[rows] >= speed)
    times, places = [], []
    begun = np.cumsum(np.where(on_path, plan.speeds.distance, 0.0)) - np.where(on_path, plan.speeds.distance, 0.0)
    for k in np.flatnonzero(kept):
        dt = np.linspace(0.0, p.duration[k], 8)
        times.append(p.t[k] + dt)
        places.append(begun[rows[k]] + p.s[k] + dt * (p.v[k] + dt * (p.a[k] / 2 + dt * p.j[k] / 6)))
    return np.concatenate(times), np.concatenate(places)


def executed(out: bytes, how: Options) -> tuple[Execution, Moves]:
    moves = moves_of(out, how)
    return execute([moves], how.machine), moves


def travelled(run: Execution, times: Floats) -> Floats:
    """Path from the start until each time, mm, of what the firmware did."""
    segments, phases = run.segments, run.phases
    path = np.where(segments.kind == 0, segments.length, 0.0)
    index, s = run.at(times)
    segment = phases.segment[index]
    return (np.cumsum(path) - path)[segment] + np.where(segments.kind[segment] == 0, s, 0.0)


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_the_firmware_is_where_the_plan_is_when_it_is(following: Following, share: float) -> None:
    following(share)
    text = HEAD + "G1 X5 Y0 F2400\nG1 F600\n" + ROAD
    out = filtered(text, NEUTRAL)
    plan, (run, _) = composed(text.encode(), dataclasses.replace(NEUTRAL, keep_retracts=True)), executed(out, NEUTRAL)
    times, places = planned_path(plan, 1.0)
    grid = np.arange(0.0, run.duration, 0.001)
    # the head's first move comes from a place that only the firmware believes to know
    there = travelled(run, grid) - (travelled(run, np.array([run.duration]))[0] - places[-1])
    fine = np.concatenate([[False], np.diff(there) > 1e-7]) & (there > 0)
    wanted = np.interp(there[fine], places, times)
    off = grid[fine] - wanted
    off -= np.median(off)
    # a stair of lines beside a ramp: early or late by LATE on either, and what one step of speed costs
    assert np.abs(off).max() < 4 * LATE
    assert there[-1] == pytest.approx(places[-1], abs=1e-3)


def test_lines_never_speed_up_faster_than_was_asked(following: Following) -> None:
    following(1.0)
    run, moves = executed(filtered(HEAD + "G1 X20 E0.02831\nG4 P500\n", NEUTRAL), NEUTRAL)
    rows = (moves.length > 0) & (moves.e > 0)
    v, length = moves.feed[rows], moves.length[rows]
    assert len(v) > 7
    took = length / v
    # from the middle of one line to the middle of the next
    asked = composed((HEAD + "G1 X20 E0.02831\nG4 P500\n").encode(), NEUTRAL).speeds
    steepest = asked.accel[asked.ruled_by > 0].max()
    assert steepest < 0.2 * NEUTRAL.machine.accel
    # cuts fall on the edges of the signal's cells, so a line's mean speed says it up to a cell of 10 ms at either end
    change = np.abs(np.diff(v)) / (0.5 * (took[1:] + took[:-1]))
    assert np.median(change[change > 0]) < 1.1 * steepest
    gained = np.abs(np.cumsum(np.diff(v)))
    since = np.cumsum(0.5 * (took[1:] + took[:-1]))
    rising = since < since[np.argmax(v[1:])]
    assert (gained[rising] <= steepest * (since[rising] + took[0]) + 0.1).all()
    assert v.max() == pytest.approx(10.0, abs=0.01)
    assert run.duration > 20.0 / 10.0


def test_no_accelerations_are_written_and_lines_stay_lines(following: Following) -> None:
    following(0.5)
    text = HEAD + ROAD
    out = filtered(text, NEUTRAL)
    assert b"; gcodectl: changed from" in out
    assert b"M204" not in out
    assert b"SET_VELOCITY_LIMIT" not in out
    lines = [line for line in body(out) if line.startswith("G1 X30 Y30")]
    assert lines == ["G1 X30 Y30 F2400"]


def test_the_files_own_accelerations_stay(following: Following) -> None:
    following(0.5)
    inside = HEAD + "M204 P400 T900\nM205 J0.02\nG1 X5 E0.0071\nM204 P30\nG1 X20 E0.0212\nM204 P600\n" + ROAD
    before, after = moves_of(inside), moves_of(filtered(inside, NEUTRAL))
    assert (after.accel[-1], after.travel_accel[-1]) == (before.accel[-1], before.travel_accel[-1]) == (600.0, 900.0)
    assert set(np.unique(after.corner_speed[~np.isnan(after.corner_speed)])) == {before.corner_speed[-1]}
    plan = composed(inside.encode(), NEUTRAL)
    here = plan.moves.deposits & (plan.moves.p0[:, 0] >= 5 - 1e-6) & (plan.moves.p1[:, 1] == 0)
    assert (plan.speeds.accel[here] <= 30).all()


def test_absolute_e_comments_and_the_parts_end_stay(following: Following) -> None:
    following(1.0)
    text = HEAD.replace("M83", "M82\nG92 E0") + "G1 X20 E0.02831 ; side\nG1 Y20 E0.05662\n"
    out = filtered(text, NEUTRAL)
    a, b = moves_of(text), moves_of(out)
    assert b.p1[-1] == pytest.approx(a.p1[-1])
    assert b.e_end[-1] == pytest.approx(a.e_end[-1], abs=1e-9)
    assert b.e.sum() == pytest.approx(a.e.sum(), abs=1e-9)
    assert len([line for line in body(out) if "; side" in line]) == 1


def test_the_summary_counts_what_was_slowed(following: Following) -> None:
    following(0.5)
    summary, plain = Summary(), Summary()
    data = (DATA / "star_rel.gcode").read_bytes()
    assert list(filter_stream([data], NEUTRAL, summary))
    following(0.0)
    assert list(filter_stream([data], NEUTRAL, plain))
    assert 0 < summary.slowed_starts <= summary.roads
    assert 0 < summary.slowed_stops <= summary.roads
    assert summary.slowed_s == pytest.approx(summary.time_s - plain.time_s, rel=0.5)
    assert plain.slowed_starts == plain.slowed_stops == plain.slowed_s == 0


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_lines_end_as_the_files_do(following: Following, ending: str) -> None:
    following(0.5)
    out = filtered((HEAD + ROAD).replace("\n", ending), NEUTRAL)
    assert out.count(b"\n") > 10
    assert out.count(b"\r\n") == (out.count(b"\n") if ending == "\r\n" else 0)
