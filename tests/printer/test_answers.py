"""What the virtual printer answers to what hosts send."""

from __future__ import annotations

import pytest
from printing_hosts import ask, printer, send, wait


def test_it_greets_unless_it_is_silent():
    assert printer(greeting=True).transmit().startswith(b"start\nMarlin 2.1")
    assert printer().transmit() == b""


def test_m105_is_its_own_ok():
    assert ask(printer(), b"M105") == b"ok T:21.00 /0.00 B:21.00 /0.00 @:0 B@:0\n"
    assert ask(printer(advanced_ok=True), b"M105") == b"ok T:21.00 /0.00 B:21.00 /0.00 @:0 B@:0\n"
    assert b" T0:21.00 /0.00 T1:21.00 /0.00" in ask(printer(extruders=2), b"M105")


def test_m114_and_the_end_of_g28_and_g92_say_where_it_is():
    one = printer()
    where = b"X:5.00 Y:0.00 Z:0.00 E:0.00 Count X:400 Y:0 Z:0\n"
    assert ask(one, b"G1 X5 F600", b"M114") == b"ok\n" + where + b"ok\n"
    assert ask(one, b"G92 E0") == where + b"ok\n"
    assert ask(one, b"G28") == b""
    assert wait(one, 1.0) == where + b"ok\n"


def test_m115_says_what_it_can():
    said = ask(printer(), b"M115")
    assert said.startswith(b"FIRMWARE_NAME:Marlin")
    assert said.endswith(b"\nok\n")
    assert b"\nCap:EMERGENCY_PARSER:1\n" in said
    assert b"\nCap:AUTOREPORT_TEMP:1\n" in said
    assert b"\nCap:EMERGENCY_PARSER:0\n" in ask(printer(emergency_parser=False), b"M115")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"M113", b"echo:M113 S2\nok\n"),
        (b"M118 E1 hello there", b"echo:hello there\nok\n"),
        (b"M118 A1 P0 action:x", b"//action:x\nok\n"),
        (b"M118 P0 SCORE", b"SCORE\necho:nothing is scored here\nok\n"),
        (b"M117 hello", b"ok\n"),
        (b"M106 S255", b"ok\n"),
        (b"M107", b"ok\n"),
        (b"M220", b"FR:100%\nok\n"),
        (b"M221", b"echo:E0 Flow: 100%\nok\n"),
        (b"M900", b"Advance K=0.00\nok\n"),
        (b"M220 S50", b"ok\n"),
        (b"M20", b"Begin file list\nEnd file list\nok\n"),
        (b"M21", b"echo:No media\nok\n"),
        (b"M23 a.gco", b"open failed, File: a.gco.\nok\n"),
        (b"M24", b"echo:No media\nok\n"),
        (b"M27", b"Not SD printing\nok\n"),
        (b"M12345", b'echo:Unknown command: "M12345"\nok\n'),
        (b"hello", b'echo:Unknown command: "hello"\nok\n'),
        (b"   ", b'echo:Unknown command: ""\nok\n'),
        (b"T1", b"echo:T1 Invalid extruder\nok\n"),
        (b"M104 T3 S20", b"echo:M104 Invalid extruder 3\nok\n"),
        (b"M109 T3 S20", b"echo:M109 Invalid extruder 3\nok\n"),
        (b"M876 S0", b"ok\n"),
        (b"M108", b"ok\n"),
        (b"M524", b"ok\n"),
    ],
)
def test_answers(line: bytes, said: bytes):
    assert ask(printer(), line) == said


def test_what_was_set_is_told():
    one = printer()
    ask(one, b"M220 S50", b"M900 K0.25", b"M113 S5")
    assert ask(one, b"M220", b"M900", b"M113") == b"FR:50%\nok\nAdvance K=0.25\nok\necho:M113 S5\nok\n"


def test_m503_tells_the_machine():
    said = ask(printer(), b"M503")
    assert b"echo: M92 X80.00 Y80.00 Z400.00 E" in said
    assert said.endswith(b"ok\n")


def test_words_need_no_space_between_them_and_zeros_may_lead():
    one = printer()
    assert ask(one, b"M0105")[:4] == b"ok T"
    ask(one, b"M104S100")
    assert b"/100.00 B" in ask(one, b"M105")
    assert ask(one, b"G01X7", b"M114").startswith(b"ok\nX:")


def test_tools_have_heaters_of_their_own():
    one = printer(extruders=2)
    ask(one, b"M104 T1 S90", b"T1")
    assert b" T:21.00 /90.00" in ask(one, b"M105")
    assert b"T0:21.00 /0.00" in ask(one, b"M105")


def test_m109_waits_and_says_temperatures_every_second():
    one = printer()
    assert ask(one, b"M109 S60", b"M105") == b""
    assert one.blocked
    said = wait(one, 3.5).splitlines()
    assert [line[:3] for line in said] == [b" T:", b"ech", b" T:", b" T:"]
    assert said[0].endswith(b"W:?")
    said = wait(one, 100.0).splitlines()
    assert [line for line in said if line.endswith(b"W:1")]
    assert said[-2:][0] == b"ok"
    assert said[-1].startswith(b"ok T:60.00 /60.00")
    assert not one.blocked


def test_m109_s_does_not_wait_for_cooling_and_r_does():
    one = printer()
    ask(one, b"M190 S60")
    wait(one, 1000.0)
    assert ask(one, b"M190 S40") == b"ok\n"
    assert ask(one, b"M190 R30") == b""
    assert b"ok\n" in wait(one, 1000.0)
    assert ask(one, b"M109") == b"ok\n"


@pytest.mark.parametrize("emergency", [True, False])
def test_m108_ends_the_wait(emergency: bool):
    one = printer(emergency_parser=emergency)
    assert ask(one, b"M109 S200") == b""
    assert ask(one, b"M108").count(b"ok\n") == 2


def test_autoreports_come_in_their_time_and_stop():
    one = printer()
    assert ask(one, b"M155 S2", b"M155") == b"ok\nok\n"
    assert wait(one, 5.0).count(b" T:21.00 /0.00") == 2
    ask(one, b"M155 S0")
    assert wait(one, 60.0) == b""


def test_m110_bare_counts_when_it_is_carried_out():
    one = printer()
    assert ask(one, b"M110 N41") == b"ok\n"
    assert send(one, 42, b"M117") == b"ok\n"


def test_a_score_hook_is_called():
    one = printer()
    one.on_score = lambda this: f"rmse {len(this.executed)}"
    assert ask(one, b"M118 P0 SCORE") == b"SCORE\necho:rmse 1\nok\n"
