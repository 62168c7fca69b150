"""The live planner: the whole file's motion where it sees all, and a firmware's where it sees fifteen blocks."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from feeding import DATA, JOBS, MACHINE, MANY, SETTLED, assert_same, corpus, drain, feed, make_live, run, whole
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_models.firmware import Execution
from plant_models.gantry import PATH, PAUSE, Firmware
from plant_models.planner import junction_kernel
from plant_models.printer.live import DELAY, Live

OWN = re.compile(rb"^(M201|M203|M205|M204 P|M900)[^\n]*$", re.MULTILINE)
"""Settings that only the live reader obeys, among others."""


@pytest.mark.parametrize("path", sorted(DATA.glob("*.gcode")), ids=lambda path: path.stem)
@pytest.mark.parametrize("junction", ["square", "jerk"])
def test_a_planner_that_sees_all_moves_as_the_whole_file_does(path, junction: str):
    firmware = Firmware(junction=junction)
    data = path.read_bytes()
    live = run(data.splitlines(), blocks=MANY, firmware=firmware)
    assert_same(live.execution(), whole(data, firmware))


@pytest.mark.parametrize(
    ("name", "machine"),
    [
        ("paste_cube_prusaslicer.gcode", "syringe"), ("paste_features_prusaslicer.gcode", "syringe-klipper"),
        ("ps_cube10_relE.gcode", "filament"), ("aw_arcs_relE.gcode", "filament"), ("cncjs_jsdc.gcode", "filament"),
        ("pellet_box_prusaslicer.gcode", "pellet"), ("ps_fwretract_G10G11.gcode", "filament-klipper"),
    ],
)  # fmt: skip
def test_so_it_does_with_real_files(name: str, machine: str):
    data = OWN.sub(b"", corpus(name))
    other = whole(data, machine=machine)
    assert_same(run(data.splitlines(), blocks=MANY, machine=machine).execution(), other)
    short = run(data.splitlines(), machine=machine)
    assert other.duration - 1e-6 <= short.execution().duration <= 1.02 * other.duration
    assert not short.starved


def check_motion(execution: Execution, firmware: Firmware) -> None:
    """Nothing faster or harder than its limits, no step but at junctions that allow it, at rest at the end."""
    run, phases = execution.segments, execution.phases
    of, ends = phases.segment, phases.v + phases.a * phases.duration
    assert (np.diff(of) >= 0).all()
    np.testing.assert_allclose(phases.t[1:], phases.t[:-1] + phases.duration[:-1], atol=1e-9)
    assert (np.maximum(phases.v, ends) <= run.speed[of] * (1 + 1e-9) + 1e-12).all()
    assert (np.abs(phases.a) <= run.accel[of] * (1 + 1e-12)).all()
    covered = np.bincount(of, (phases.v + 0.5 * phases.a * phases.duration) * phases.duration, len(run))
    np.testing.assert_allclose(covered, run.length, atol=1e-9)
    on_path = run.kind == PATH
    safe = np.where(on_path, run.length, 1.0)
    limit = junction_kernel(
        run.kind, np.where(on_path[:, None], run.p1 - run.p0, 0.0) / safe[:, None], np.where(on_path, run.e, 0) / safe,
        run.length, run.speed, run.accel, run.corner_speed, run.rest, run.e_corner_speed, firmware.junction == "jerk",
    )  # fmt: skip
    first = np.searchsorted(of, np.arange(len(run)))
    assert (phases.v[first] ** 2 <= limit[:-1] * (1 + 1e-6) + 1e-9).all()
    np.testing.assert_allclose(ends[first[1:] - 1], phases.v[first[1:]], atol=1e-6)
    assert abs(ends[-1]) < 1e-6


@settings(max_examples=40, deadline=None)
@given(JOBS, st.integers(4, 16), st.sampled_from(["square", "jerk"]))
def test_no_limit_is_exceeded_and_nothing_is_lost(job: list[bytes], blocks: int, junction: str):
    firmware = Firmware(junction=junction)
    live = run(job, blocks=blocks, firmware=firmware)
    execution = live.execution()
    if len(execution.segments):
        check_motion(execution, firmware)
        moved = execution.segments[execution.segments.kind != PAUSE]
        jumps = (moved.p1 - moved.p0).sum(axis=0) if len(moved) else np.zeros(3)
        if not any(line.startswith(b"G92 X") for line in job) and len(moved):
            np.testing.assert_allclose(live.position()[:3], moved.p0[0] + jumps, atol=1e-6)
    if not {b"G10", b"G11"} & set(job):  # the other reader rests at a G11 that changes nothing, too
        assert whole(b"\n".join(job), firmware).duration <= execution.duration + 1e-6


@settings(max_examples=40, deadline=None)
@given(JOBS, st.lists(st.floats(0, 0.3), max_size=60))
def test_when_it_is_looked_at_does_not_matter(job: list[bytes], looks: list[float]):
    other, live, now = run(job), make_live(), 0.0
    for line in job:
        while not live.ready():
            due = live.deadline()
            if looks and now + looks[-1] < due:
                now += looks.pop()
            else:
                now = due
            live.advance(now)
            live.advance(now - 1.0)
        live.take(line, now)
    while live.deadline() < math.inf:
        now = min(now + (looks.pop() if looks else 9.0), live.deadline())
        live.advance(now)
    a, b = live.execution(), other.execution()
    np.testing.assert_array_equal(a.phases.t, b.phases.t)
    np.testing.assert_array_equal(a.phases.v, b.phases.v)
    assert live.starved == other.starved


def test_fewer_blocks_brake_earlier():
    line = [*SETTLED, *(b"G1 X%.1f F6000" % (k / 10) for k in range(1, 400))]
    times = [run(line, blocks=blocks).execution().duration for blocks in (4, 8, 16, 64)]
    assert times == sorted(times, reverse=True)
    assert times[0] > 1.2 * times[2], "in 15 blocks of 0.1 mm it stops from 39 mm/s"
    peak = run(line, blocks=16).execution().phases.v.max()
    assert peak <= math.sqrt(2 * MACHINE.travel_accel * 1.5) + 1e-9


def test_an_idle_planner_waits_for_three_blocks_or_a_tenth_of_a_second():
    live = make_live()
    live.take(b"G1 X10 F600", 5.0)
    assert live.deadline() == 5.0 + DELAY
    live.take(b"G1 X20", 5.01)
    assert live.deadline() == 5.0 + DELAY
    live.take(b"G1 X30", 5.02)
    drain(live)
    assert live.begun == 5.02
    late = make_live()
    late.take(b"G1 X10", 5.0)
    late.advance(6.0)
    assert late.begun == 5.0 + DELAY


def test_one_that_waits_for_rest_begins_at_once():
    live = make_live()
    live.take(b"G1 X10 F600", 5.0)
    live.take(b"M400", 5.01)
    assert live.begun == 5.01
    assert not live.ready()
    assert not live.idle
    end = live.deadline()
    live.advance(end)
    assert live.ready()
    assert live.idle
    assert live.deadline() == math.inf


def test_a_command_is_done_when_its_last_piece_is_in_the_ring():
    live = make_live()
    live.take(b"G2 X20 I10 F600", 0.0)
    assert not live.ready()
    assert live.free() == 0
    with pytest.raises(AssertionError):
        live.take(b"G1 X0", 0.0)
    left = math.ceil(10 * math.pi / 0.5) - 15
    for _ in range(left):
        assert not live.ready()
        live.advance(live.deadline())
    assert live.ready()
    drain(live)
    assert live.position() == (20.0, 0.0, 0.0, 0.0)


def test_a_dwell_is_waited_out():
    live = make_live()
    feed(live, [b"G1 X10 F600", b"G4 S2"])
    moved = live.deadline()
    live.advance(moved)
    assert not live.ready()
    assert live.deadline() == moved + 2.0
    live.advance(moved + 2.0)
    assert live.ready()
    execution = live.execution()
    assert execution.segments.kind.tolist() == [PATH, PAUSE]
    assert execution.duration == pytest.approx(moved + 2.0)


def test_what_does_not_move_is_done_at_once():
    live = make_live()
    feed(live, [b"M117 G1 X5", b"; nothing", b"M105", b"G1 F600", b"M104 S200", b"G1 X0 Y0"])
    assert live.idle
    assert len(live.execution().segments) == 0
    assert math.isnan(live.begun)
    assert live.execution().duration == 0.0


def test_linear_advance_is_each_segments_own():
    job = [*SETTLED, b"G1 X30 E.1 F600", b"M400", b"M900 K0.2", b"G1 X60 E.1", b"M400", b"M900 K0.1", b"G1 X90 E.1"]
    execution = run(job).execution()
    plain = run([line for line in job if not line.startswith(b"M900")]).execution().command(0.002).values[0]
    u = execution.command(0.002).values[0]
    assert u.sum() == pytest.approx(plain.sum())
    at = (execution.begins()[execution.segments.kind == PATH] / 0.002).astype(int)
    extra = [np.abs((u - plain)[max(k, 0) : k + 60]).max() for k in at - 2]
    assert extra[0] == 0.0
    assert extra[1] == pytest.approx(2 * extra[2], rel=1e-3)
    assert extra[2] > 1.0


def test_late_on_the_clock_is_as_early():
    job = (DATA / "star_rel.gcode").read_bytes().splitlines()
    live = make_live()
    feed(live, job, 1e6)
    assert_same(drain(live).execution(), run(job).execution())


def test_short_blocks_are_slowed_while_the_ring_runs_empty():
    job = [*SETTLED, b"G1 X0.1 F600", *(b"G1 X%.1f" % (k / 10) for k in range(2, 12))]
    speeds = []
    for slowdown in (0.0, 0.02):
        live = Live(MACHINE, Firmware(), slowdown=slowdown)
        feed(live, job)
        speeds.append(drain(live).execution().segments.speed)
    assert (speeds[0] == 10.0).all()
    # 10 ms each; the third and the fourth come when two wait: 2 / 2 x (20 - 10) ms more; with eight none is slowed
    assert speeds[1][:4].tolist() == [10.0, 10.0, pytest.approx(5.0), pytest.approx(5.0)]
    assert (np.diff(speeds[1][3:9]) >= 0).all()
    assert (speeds[1][9:] == 10.0).all()
    told = run([b"M205 B20000", *job]).execution().segments.speed
    np.testing.assert_array_equal(told, speeds[1])
