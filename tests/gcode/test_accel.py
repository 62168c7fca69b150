"""Accelerations in the output: M204 where the plan needs it, the file's own again where a line relies on that."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable

import numpy as np
import pytest
from filtering import DATA, HEAD, NEUTRAL, body, composed, filtered, moves_of, options
from moves import plain_python

from gcodectl import pipeline
from gcodectl.motion.follow import Follow
from gcodectl.pipeline import Options, Summary, filter_stream
from gcodectl.records import Composed, Moves
from plant_models.firmware import execute
from plant_models.gantry import PATH

ROAD = "G1 X20 E0.02831\nG1 Y20 E0.02831\nG1 X30 Y30 F2400\n"
Following = Callable[[float], None]


@pytest.fixture
def following(monkeypatch: pytest.MonkeyPatch) -> Following:
    """Let the filter know an extruder of 1 s lag and 25 mm^3/s, and give its ramps a share of its time."""

    def follow(share: float, tau: float = 1.0) -> None:
        q = np.array([0.1, 0.5, 1, 2, 4, 6, 9, 12, 18, 24.0])
        table = Follow(q, tau * np.log(25 / (25 - q)), tau * np.log((25 + q) / 25), share, share)
        monkeypatch.setattr(pipeline, "follow_of", lambda _options: table)

    return follow


def speaking(dialect: str, how: Options = NEUTRAL) -> Options:
    return dataclasses.replace(how, machine=dataclasses.replace(how.machine, dialect=dialect))


def accels(out: bytes) -> list[str]:
    return [line for line in body(out) if line.startswith("M204")]


@pytest.mark.parametrize(("dialect", "words"), [("marlin", "PT"), ("klipper", "S"), ("reprapfirmware", "PT")])
def test_a_road_gets_its_own_and_the_file_its_own_again(following: Following, dialect: str, words: str) -> None:
    following(0.5)
    out = filtered(HEAD + ROAD, speaking(dialect))
    up, rest, down, after = accels(out)
    own = "M204 " + " ".join(f"{word}500" for word in words)
    assert rest == after == own
    assert all(re.fullmatch("M204 " + " ".join(rf"{word}\d+" for word in words), line) for line in (up, down))
    lines = body(out)
    assert lines[lines.index("G1 X30 Y30 F2400") - 1] == after
    assert lines[lines.index(up) + 1].startswith("G1 X")


def test_the_files_own_settings_keep_their_meaning(following: Following) -> None:
    following(0.5)
    own = "M204 P400 T900\nM205 J0.02\n"
    inside = HEAD + own + "G1 X5 E0.0071\nM204 P30\nG1 X20 E0.0212\nM204 P600\n" + ROAD
    before, after = moves_of(inside), moves_of(filtered(inside, NEUTRAL))
    # what the file's last line has in force is in force at the end, and corner speeds are what they were
    assert (after.accel[-1], after.travel_accel[-1]) == (before.accel[-1], before.travel_accel[-1]) == (600.0, 900.0)
    assert set(np.unique(after.corner_speed[~np.isnan(after.corner_speed)])) == {before.corner_speed[-1]}
    deposits = after.deposits
    # never more than the file asks for where it asks, by place along the road
    for moves, x0, x1, most in ((after, 0, 5, 400), (after, 5, 20, 30)):
        here = deposits & (moves.p0[:, 0] >= x0 - 1e-6) & (moves.p1[:, 0] <= x1 + 1e-6) & (moves.p1[:, 1] == 0)
        assert here.any()
        assert (moves.accel[here] <= most).all()
    assert (after.accel[deposits & (after.p0[:, 1] > 0)] <= 600).all()


def test_no_line_outside_of_roads_runs_under_a_roads_acceleration(following: Following) -> None:
    following(0.5)
    after = moves_of(filtered(HEAD + ROAD + "G1 X40 Y40 F600\n" + ROAD, options()))
    ruled = (after.accel < 500) & (after.length > 0)
    assert ruled.any()
    aslant = (after.p0[:, 0] != after.p1[:, 0]) & (after.p0[:, 1] != after.p1[:, 1])
    assert (after.e[aslant & (after.length > 0)] != 0).any()
    assert not (ruled & aslant).any()
    assert np.array_equal(after.accel[ruled], after.travel_accel[ruled])


def test_before_a_barrier_the_files_own_is_back(following: Following) -> None:
    following(0.5)
    lines = body(filtered(HEAD + "G1 X20 E0.02831\nG28\nG1 X0 Y0 Z1 F600\nM117 hi\n", NEUTRAL))
    assert lines[lines.index("G28") - 1] == "M204 P500 T500"
    assert lines[-3:] == ["G28", "G1 X0 Y0 Z1 F600", "M117 hi"]


@pytest.mark.parametrize("ending", ["\n", "\r\n", ""])
def test_the_end_of_the_file_has_the_files_own_again(following: Following, ending: str) -> None:
    following(0.5)
    out = filtered((HEAD + "G1 X20 E0.02831").replace("\n", ending or "\n") + ending, NEUTRAL)
    assert body(out)[-1] == "M204 P500 T500"
    assert (b"\r\n" in out) == (ending == "\r\n")


def test_absolute_e_comments_and_the_parts_end_stay(following: Following) -> None:
    following(1.0)
    text = HEAD.replace("M83", "M82\nG92 E0") + "G1 X20 E0.02831 ; side\nG1 Y20 E0.05662\n"
    out = filtered(text, NEUTRAL)
    a, b = moves_of(text), moves_of(out)
    assert b.p1[-1] == pytest.approx(a.p1[-1])
    assert b.e_end[-1] == a.e_end[-1]
    assert b.e.sum() == pytest.approx(a.e.sum(), abs=1e-9)
    assert [line for line in body(out) if "; side" in line] == [line for line in body(out) if line.startswith("G1 X0.")]


@pytest.mark.parametrize("name", ["star_rel", "box_abs", "arcs_rel"])
@pytest.mark.parametrize("material", ["neutral", "paste-a"])
def test_firmware_does_what_was_planned(following: Following, name: str, material: str) -> None:
    following(1.0)
    how = NEUTRAL if material == "neutral" else options()
    # the plan has jerk and the firmware has none: with as good as none in the plan both are one
    how = dataclasses.replace(how, machine=dataclasses.replace(how.machine, jerk=1e9))
    data = (DATA / f"{name}.gcode").read_bytes()
    plan = composed(data, how)
    if material == "neutral":
        plan = composed(data, dataclasses.replace(how, keep_retracts=True))
    out = filtered(data, how)
    planned, done = ramps(plan), ran(moves_of(out, how), how)
    assert len(planned) == len(done)
    # lines that the signal has cut step E at their junctions, which the firmware slows down for
    close = 0.01 if material == "neutral" else 0.25
    assert np.abs(planned - done).max() < close * np.abs(planned).max()


def ramps(plan: Composed) -> np.ndarray:  # type: ignore[type-arg]
    """Seconds of each stretch of ruled rows, in order."""
    moves, p = plan.moves, plan.profile
    took = np.bincount(p.row - moves.row[0], weights=p.duration, minlength=len(moves))
    return stretches(np.where(plan.speeds.ruled_by > 0, took, 0.0)[plan.speeds.distance > 0])


def ran(moves: Moves, how: Options) -> np.ndarray:  # type: ignore[type-arg]
    """The same of what the virtual firmware did with the output."""
    done = execute([moves], how.machine)
    took = np.bincount(done.phases.segment, weights=done.phases.duration, minlength=len(done.segments))
    slow = moves.accel[np.searchsorted(moves.row, done.segments.row)] < how.machine.accel - 1
    slow &= done.segments.kind == PATH
    return stretches(np.where(slow, took, 0.0))


def stretches(took: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    """Sums of the numbers that follow each other without a 0."""
    on = took > 0
    first = on & ~np.concatenate([[False], on[:-1]])
    return np.bincount(np.cumsum(first)[on] - 1, weights=took[on]) if on.any() else np.zeros(0)


def test_the_summary_counts_what_was_slowed(following: Following) -> None:
    following(0.5)
    summary, plain = Summary(), Summary()
    data = (DATA / "star_rel.gcode").read_bytes()
    assert list(filter_stream([data], NEUTRAL, summary))
    following(0.0)
    assert list(filter_stream([data], NEUTRAL, plain))
    assert summary.slowed_starts == summary.slowed_stops == summary.roads > 0
    assert summary.slowed_s == pytest.approx(summary.time_s - plain.time_s, rel=0.5)
    assert plain.slowed_starts == plain.slowed_stops == plain.slowed_s == 0


@pytest.mark.parametrize("dialect", ["marlin", "klipper"])
def test_the_same_with_the_jit_off(following: Following, dialect: str) -> None:
    following(0.5)
    text = HEAD + ROAD + "G28\n" + HEAD + "G1 X5 E0.0071\nM204 S300\nG1 X20 E0.0212\n"
    expected = filtered(text, speaking(dialect, options()))
    with plain_python("gcodectl.gcode.emit", "gcodectl.gcode.accel", "gcodectl.gcode.changes"):
        assert filtered(text, speaking(dialect, options())) == expected
