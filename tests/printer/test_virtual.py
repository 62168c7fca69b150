"""The virtual printer's loop: what blocks it, what it says meanwhile, what stops it."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from printing_hosts import MACHINE, Blocks, ask, job, printer, send, wait

from gcodectl.link.wire import numbered
from plant_models.printer.virtual import Executed, VirtualPrinter


def test_an_ok_means_that_the_motion_is_in_the_buffer():
    one = printer()
    assert b"".join(send(one, k, b"G1 X%d" % k) for k in range(1, 17)) == b"ok\n" * 16
    assert not one.blocked
    assert send(one, 17, b"G1 X17") == b""
    assert one.blocked
    assert wait(one, 1.0) == b"ok\n"
    assert not one.blocked
    assert send(one, 18, b"M400") == b""
    assert wait(one, 15.9).replace(b"echo:busy: processing\n", b"") == b""
    assert wait(one, 0.2).endswith(b"ok\n")
    assert [e.number for e in one.executed] == list(range(1, 19))
    assert one.executed[-1] == Executed(18, b"M400", 1.0)


def test_it_reads_while_it_is_blocked_as_far_as_the_queue_goes():
    one = printer()
    ask(one, b"G4 P5000", b"M105", b"M105", b"M105", b"M105")
    assert (len(one.executed), one.receiver.free) == (1, 0)
    assert wait(one, 5.0).count(b"ok") == 5


def test_it_says_that_it_is_busy_every_interval():
    one = printer()
    ask(one, b"G4 P7000")
    assert wait(one, 6.5) == b"echo:busy: processing\n" * 3
    wait(one, 1.0)
    ask(one, b"M113 S0", b"G4 P60000")
    assert wait(one, 59.0) == b""


def test_wait_is_said_when_there_is_nothing_to_do():
    one = printer(wait=1.0)
    assert wait(one, 3.5) == b"wait\n" * 3
    ask(one, b"G4 P3000")
    assert wait(one, 3.0) == b"echo:busy: processing\nok\n"
    assert wait(one, 1.0) == b"wait\n"
    assert printer().deadline() == math.inf


def test_advanced_ok_tells_the_planners_room():
    one = printer(advanced_ok=True)
    assert send(one, 1, b"G1 X1") == b"ok N1 P15 B3\n"
    assert ask(one, b"G1 X1") == b"ok P14 B3\n"


@pytest.mark.parametrize("line", [b"M112", numbered(2, b"M112").strip()])
@pytest.mark.parametrize("emergency", [True, False])
def test_m112_kills(line: bytes, emergency: bool):
    one = printer(emergency_parser=emergency)
    ask(one, b"M104 S100", b"G1 X1")
    send(one, 1, b"M140 S50")
    said = ask(one, line)
    assert said == b"Error:Printer halted. kill() called!\n"
    assert not one.alive
    assert not one.blocked
    assert one.deadline() == math.inf
    assert one.motion.idle
    assert one.commands.thermals.hotends[0].target == 0
    assert ask(one, b"M105") == wait(one, 1e3) == b""


def test_m112_kills_though_everything_is_full_only_with_an_emergency_parser():
    for emergency in (True, False):
        one = printer(emergency_parser=emergency)
        ask(one, *[b"G4 P9000"] * 9)
        ask(one, b"M112")
        assert one.alive is not emergency


@pytest.mark.parametrize("emergency", [True, False])
def test_m410_drops_what_is_buffered(emergency: bool):
    one = printer(emergency_parser=emergency)
    for _ in range(16):
        ask(one, b"G1 X1")
    assert ask(one, b"M400") == b""
    assert ask(one, b"M410") == b"ok\nok\n"
    assert one.motion.idle


def test_time_may_pass_in_any_steps():
    whole, steps = printer(), printer()
    lines = [b"M155 S3", b"M109 S50", b"G1 X1", b"M400", b"G4 P2500", b"M105"]
    assert ask(whole, *lines) == ask(steps, *lines)
    said = b""
    for k in range(400):
        said += wait(steps, 0.05 + 0.1 * (k % 3))
    assert wait(whole, steps.now) == said
    assert steps.executed == whole.executed


def test_a_motion_that_never_moves_on_is_our_mistake():
    one = printer()
    one.motion.deadline = lambda: 1.0  # type: ignore[method-assign]
    with pytest.raises(AssertionError, match="again and again"):
        one.advance(2.0)


def test_without_a_motion_nothing_takes_time():
    one = VirtualPrinter(MACHINE)
    one.transmit()
    assert ask(one, b"G28", b"M400", b"M114").count(b"ok\n") == 3
    one.act("M410")
    assert one.motion.idle
    assert one.motion.position() == (0.0, 0.0, 0.0, 0.0)


def test_every_line_of_a_job_is_executed_once():
    one = printer()
    assert b"Resend" not in b"".join(job(one, 50))
    assert [e.number for e in one.executed] == list(range(1, 51))


HALVES = [b"M109 S", b"M155 S", b"M110 N", b"\nM118 ", b"G28\n"]


@given(st.lists(st.one_of(st.binary(max_size=20), st.sampled_from(HALVES)), max_size=20))
def test_garbage_never_raises(parts: list[bytes]):
    one = printer("garble-in%0.2,garble-out%0.2", wait=1.0)
    for part in parts:
        one.receive(part, one.now + 0.5)
    one.advance(one.now + 500.0)
    one.transmit()
    assert isinstance(one.motion, Blocks)
