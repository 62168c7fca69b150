"""No line that a host can send ends the printer's process, or keeps it busy for ever."""

from __future__ import annotations

import math

import numpy as np
import pytest
from feeding import drain, feed, make_live
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from printing_hosts import MACHINE, ask, send

from gcodectl.link.dialect import Dialect
from plant_models.gantry import Firmware
from plant_models.printer import chords
from plant_models.printer.limits import LEAST_ACCEL, LEAST_SPEED, MOST
from plant_models.printer.live import Live
from plant_models.printer.orders import Halt, Motion
from plant_models.printer.outcome import write_outcome
from plant_models.printer.state import State
from plant_models.printer.virtual import VirtualPrinter
from plant_models.printer.words import REACH

HUGE = b"9" * 60
NUMBERS = [b"", b"0", b"-0", b"1", b"-1", b"5", b"40", b".5", b"-.5", b"999", b"32768", b"4294967296", b"1e9", b"-1e9"]
NUMBERS += [b"1000000000", b"-1000000000", HUGE, b"-" + HUGE, b"0." + b"0" * 50 + b"1", b"0.000001", b"-0.000001"]
NUMBERS += [b"nan", b"inf", b"-inf", b"+3", b"--1", b"1.2.3", b"_", b"0x10", b".", b"-", b"1_0"]
COMMANDS = b"G0 G1 G1 G1 G2 G3 G2 G3 G4 G5 G10 G11 G17 G18 G19 G20 G21 G28 G29 G90 G91 G92 T0 T1 T99 M0 M25 M82 M83 M84"
COMMANDS += b" M92 M104 M105 M106 M109 M114 M115 M117 M140 M190 M200 M201 M203 M204 M205 M207 M208 M220 M221 M302 M400"
COMMANDS += b" M410 M503 M600 M900 M999"
WORD = st.builds(
    lambda *parts: b"".join(parts),
    st.sampled_from([b" ", b" ", b""]), st.sampled_from([bytes([c]) for c in b"XYZEFIJKRPSTBDLA"]),
    st.sampled_from(NUMBERS),
)  # fmt: skip
ODD = st.builds(
    lambda name, words: (name + b"".join(words))[:80], st.sampled_from(COMMANDS.split()), st.lists(WORD, max_size=4)
)
PLAIN = st.builds(lambda x, y, f: b"G1 X%d Y%d E.02 F%d" % (x, y, f), *[st.integers(-40, 40)] * 2, st.integers(1, 9000))
ARC = st.builds(lambda g, x, i, r: b"G%d X%d %s%d" % (g, x, r, i), st.integers(2, 3), *[st.integers(-9, 9)] * 2,
                st.sampled_from([b"I", b"J", b"R"]))  # fmt: skip
GARBAGE = st.lists(st.integers(0, 255).filter(lambda c: c not in b'\r\n;"(*\\\x08'), max_size=80).map(bytes)
LINES = st.lists(st.one_of(PLAIN, PLAIN, PLAIN, ARC, ODD, ODD, ODD, GARBAGE), max_size=25)


def odd_printer(live: Live, extruders: int = 1) -> VirtualPrinter:
    """A printer that says nothing by itself: its waits may be long."""
    return VirtualPrinter(MACHINE, dialect=Dialect(greeting=False, keepalive=0, extruders=extruders), motion=live)


def answer(one: VirtualPrinter, number: int, line: bytes) -> bytes:
    """Send a line and wait for its ok; returns all that was said."""
    said = send(one, number, line)
    while not any(part.startswith(b"ok") for part in said.splitlines()):
        before = one.now
        assert one.deadline() < math.inf, f"{line!r} is never answered"
        one.advance(one.deadline())
        assert one.now >= before
        said += one.transmit()
    return said


@seed(20261122)
@settings(max_examples=80, deadline=None)
@given(LINES, st.integers(1, 2), st.sampled_from(["square", "jerk"]), st.sampled_from([0.0, 0.02]))
def test_whatever_is_sent_is_answered_once_and_what_is_executed_has_no_gaps(
    lines: list[bytes], extruders: int, junction: str, slowdown: float
):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chords, "MOST", 40)
        live = Live(MACHINE, Firmware(junction=junction), slowdown=slowdown)
        one = odd_printer(live, extruders)
        for number, line in enumerate(lines, 1):
            said = answer(one, number, line)
            assert sum(part.startswith(b"ok") for part in said.splitlines()) == 1, (line, said)
            assert one.receiver.last == number
        assert len(one.executed) == len(lines)
        while live.deadline() < math.inf:
            one.advance(live.deadline())
    assert live.idle
    assert all(abs(at) <= 2 * REACH for at in live.position())
    check_execution(live)


def check_execution(live: Live) -> None:
    """All of it is finite, time goes on without gaps, and every phase goes where its block goes."""
    execution = live.execution()
    phases, run = execution.phases, execution.segments
    for table, names in ((phases, "t duration s v a"), (run, "p0 p1 length e volume speed accel corner_speed pause")):
        assert all(np.isfinite(getattr(table, name)).all() for name in names.split())
    assert (phases.duration > 0).all()
    ends = phases.t + phases.duration
    np.testing.assert_allclose(phases.t[1:], ends[:-1], rtol=1e-12, atol=1e-9)
    assert (phases.v >= 0).all()
    assert (phases.v[1:] <= run.speed[phases.segment[1:]] * (1 + 1e-9)).all()


@pytest.mark.parametrize(
    "line",
    [b"M205 J-1", b"M205 J0", b"M205 J1e9", b"M205 X-5 Y-5 E-1", b"M205 B-5", b"M205 X Y J B E", b"M201 X0 Y-1 Z-1 E-1",
     b"M203 X-1 Y0 Z-5 E-5", b"M204 P-1 T0 R-3", b"M204 S-1", b"M220 S0", b"M220 S-50", b"M221 S-5", b"M900 K-1",
     b"M92 X0 Y-1", b"M207 F-5", b"M208 F0", b"G1 F0", b"G1 F-5", b"G1 F", b"G2", b"G2 I0 J0", b"G3 X5 R0",
     b"G2 R5", b"M900 K99"],
)  # fmt: skip
def test_what_no_machine_can_do_changes_nothing(line: bytes):
    job = [b"G1 X5 E.1 F900", b"G1 X9 Y5 E.1", b"G10", b"G11", b"G1 Y0 Z1 E.1", b"M400"]
    asked, plain = make_live(), make_live()
    feed(asked, [line, *job])
    feed(plain, job)
    a, b = asked.execution(), plain.execution()
    np.testing.assert_array_equal(a.phases.t, b.phases.t)
    np.testing.assert_array_equal(a.phases.v, b.phases.v)


def read(*lines: bytes) -> Motion | Halt | None:
    state = State(MACHINE, Firmware())
    return [state.read(line) for line in lines][-1]


def test_settings_are_cut_to_what_a_firmware_holds():
    limits, state = (one := State(MACHINE, Firmware())).limits, one
    for line in (b"M203 X" + HUGE, b"M201 X.0000001 Z" + HUGE, b"M204 P1e9 T.0000001", b"M205 B" + HUGE):
        state.read(line)
    assert limits.max_speed[0] == MOST
    assert (limits.accel_cap, limits.z_accel) == (LEAST_ACCEL, MOST)
    assert (limits.accel, limits.travel_accel) == (1.0, LEAST_ACCEL), "1e9 ends at the e, as an E word begins there"
    assert limits.least_time == pytest.approx(4295, abs=1)
    state.read(b"M220 S" + HUGE)
    assert state.read(b"G1 X1 F60").feed == 327.67  # type: ignore[union-attr]
    assert state.read(b"G1 X2 F.0000000001").feed == LEAST_SPEED * 327.67  # type: ignore[union-attr]


def test_a_block_is_never_slower_than_a_drive_can_count():
    live = make_live()
    feed(live, [b"M83", b"M203 E.0000001", b"M201 E.0000001", b"G1 X.001 E50", b"G1 X.002 E50", b"M400"])
    run = drain(live).execution().segments
    assert run.speed.tolist() == [LEAST_SPEED] * 2
    assert run.accel.tolist() == [LEAST_ACCEL] * 2


def test_positions_end_where_the_counters_do():
    for line in (b"G1 X" + HUGE, b"G0 X9" + b"0" * 400, b"G92 X" + HUGE):
        state = State(MACHINE, Firmware())
        state.read(b"G20")
        state.read(line)
        assert state.at == (REACH, 0.0, 0.0)
    pushed = read(b"M221 S0", b"G1 E9" + b"0" * 400)
    assert isinstance(pushed, Motion)
    assert (pushed.e, pushed.e_end) == (0.0, REACH)


def test_a_dwell_is_a_dwell_unless_its_clock_runs_over():
    assert read(b"G4 P2000000000") == Halt(2e6)
    for line in (b"G4 P" + HUGE, b"G4 P4294967296", b"G4 S" + HUGE, b"G4 P-5", b"G4 S-1", b"G4 S", b"G4 P"):
        assert read(line) == Halt(0.0)
    assert read(b"G4 P1e12") == Halt(0.001), "a number ends at the e"
    one = odd_printer(make_live())
    assert answer(one, 1, b"G4 P2000000000") == b"ok\n"
    assert one.now == 2e6


@pytest.mark.parametrize("line", [b"G2 I1000000000", b"G3 J" + HUGE, b"G2 X5 R-" + HUGE, b"G3 I32768 P99 Z" + HUGE])
def test_an_arc_has_no_more_chords_than_16_bit_count(line: bytes):
    motion = read(line)
    assert isinstance(motion, Motion)
    assert len(motion.ends) == chords.MOST
    assert np.isfinite(motion.ends).all()


def test_a_tool_that_is_not_there_is_refused():
    one = odd_printer(make_live(), extruders=2)
    assert answer(one, 1, b"T99") == b"echo:T99 Invalid extruder\nok\n"
    assert len(one.motion.execution().segments) == 0  # type: ignore[attr-defined]


def test_a_long_arc_is_cut_as_the_planner_takes_it():
    live = make_live()
    live.take(b"G2 I1000000000", 0.0)
    assert not live.ready()
    live.quickstop(live.deadline())
    assert live.idle
    assert live.ready()


def test_a_number_of_thousands_of_digits_is_none_that_a_firmware_reads():
    one = VirtualPrinter(MACHINE, dialect=Dialect(greeting=False, keepalive=0, longest=20_000), motion=make_live())
    many = b"9" * 9000
    heads = (b"G", b"T", b"M", b"M221 S5 T", b"M104 S5 T", b"G2 I5 P", b"G1 X", b"M220 S", b"M113 S", b"M155 S")
    for number, head in enumerate(heads, 1):
        assert answer(one, number, head + many).splitlines()[-1].startswith(b"ok")
    assert ask(one, b"M110 N" + many).endswith(b"ok\n")
    assert one.receiver.last < 2**63


def test_what_is_said_by_itself_is_said_at_whole_seconds():
    one = odd_printer(make_live())
    assert ask(one, b"M155 S.001", b"M113 S.001") == b"ok\nok\n"
    assert one.deadline() == math.inf
    assert one.commands.keepalive == 0
    ask(one, b"M155 S" + HUGE)
    assert one.deadline() == one.now + 60.0


@pytest.mark.parametrize("line", [b"G4 P2000000000", b"G1 X9000000 E50"])
def test_a_print_that_fits_into_no_memory_is_not_scored(line: bytes, tmp_path):
    live = make_live()
    feed(live, [b"G1 X5 E.1 F600", line, b"G1 X5 E.1", b"M400"])
    drain(live)
    assert write_outcome(tmp_path, live, [(0.0, line)], plant="syringe", machine=MACHINE) is None
    assert "can be scored" in (tmp_path / "score.json").read_text()
