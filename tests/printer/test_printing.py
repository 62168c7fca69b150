"""The virtual printer with its real motion: a part is printed line by line, and what stops a print stops the motion."""

from __future__ import annotations

import math

import pytest
from printing_hosts import MACHINE, ask, send

from plant_models.gantry import Firmware
from plant_models.printer.faults import parse_faults
from plant_models.printer.live import Live
from plant_models.printer.virtual import VirtualPrinter

PART = [b"M104 S50", b"G28", b"G90", b"M83", b"M109 S50", b"G1 X0 Y0 Z.6 F2400", b"M117 part"]
PART += [b"G1 X%d Y%d E.01 F600" % (k % 20, k % 3) for k in range(1, 60)]
PART += [b"G4 P200", b"G10", b"G11", b"M106 S9", b"M400"]


def real(faults: str = "") -> VirtualPrinter:
    one = VirtualPrinter(MACHINE, faults=parse_faults(faults), motion=Live(MACHINE, Firmware()))
    one.transmit()
    return one


def stream(one: VirtualPrinter, lines: list[bytes], window: int = 1) -> list[bytes]:
    """Send lines, at most `window` without an ok at a time; returns what the printer said besides."""
    said: list[bytes] = []
    unanswered = 0
    for number, line in enumerate(lines, 1):
        heard = send(one, number, line)
        unanswered += 1
        while True:
            answers = heard.splitlines()
            unanswered -= sum(answer.startswith(b"ok") for answer in answers)
            said += [answer for answer in answers if not answer.startswith(b"ok")]
            if not one.alive or unanswered < (1 if number == len(lines) else window):
                break
            assert one.deadline() < math.inf
            one.advance(one.deadline())
            heard = one.transmit()
    return said


@pytest.mark.parametrize("window", [1, 4])
def test_every_line_is_executed_once_and_the_motion_has_its_time(window: int):
    one = real()
    stream(one, PART, window)
    assert [(e.number, e.text) for e in one.executed] == list(enumerate(PART, 1))
    assert one.motion.idle
    assert one.motion.position()[:3] == (59 % 20, 59 % 3, 0.6)
    assert one.now > one.executed[4].t + 10.0
    assert all(a.t <= b.t for a, b in zip(one.executed, one.executed[1:], strict=False))


def test_ok_waits_for_a_place_in_the_planner():
    one = real()
    heard = [ask(one, b"G1 X%d F60" % k) for k in range(1, 25)]
    blocks = sum(b"ok" in said for said in heard)
    assert 14 <= blocks <= 16
    assert one.blocked
    assert one.motion.free() == 0


@pytest.mark.parametrize("stopper", [b"M112", b"M410"])
def test_what_stops_it_stops_the_motion(stopper: bytes):
    one = real()
    for k in range(1, 10):
        ask(one, b"G1 X%d F60" % k)
    one.advance(0.5)
    ask(one, stopper)
    assert one.motion.idle
    assert 0 < one.motion.position()[0] < 1


def test_a_reset_forgets_where_it_was():
    one = real("reset@20")
    stream(one, PART[:19])
    assert send(one, 20, PART[19]).startswith(b"start\n")
    assert one.motion.position() == (0.0, 0.0, 0.0, 0.0)
    assert one.receiver.last == 0
    stream(one, PART)
    assert one.motion.idle
