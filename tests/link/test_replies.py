import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcodectl.link.replies import Heat, Kind, read_replies


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        (b"ok", Kind.OK), (b"ok P15 B3", Kind.OK), (b"ok T:20.0 /0.0 B:21 /0", Kind.OK), (b"  ok  ", Kind.OK),
        (b"okay then", Kind.OTHER), (b"o", Kind.OTHER), (b"k", Kind.OTHER), (b"echo: ok?", Kind.OTHER),
        (b"Resend: 12", Kind.RESEND), (b"rs 12", Kind.RESEND), (b"rs N12", Kind.RESEND), (b"Resend:12", Kind.RESEND),
        (b"Resend: x", Kind.OTHER), (b"resource 12", Kind.OTHER),
        (b"Error:checksum mismatch, Last Line: 4", Kind.LINE_ERROR),
        (b"Error:Line Number is not Last Line Number+1, Last Line: 4", Kind.LINE_ERROR),
        (b"Error:No Checksum with line number, Last Line: 4", Kind.LINE_ERROR),
        (b"Error:Printer halted. kill() called!", Kind.FATAL), (b"!! Move out of range", Kind.FATAL),
        (b"Error:Heating failed, system stopped! Heater_ID: 0", Kind.FATAL), (b"fatal: stop", Kind.FATAL),
        (b"Error:MINTEMP triggered, system stopped!", Kind.FATAL),
        (b"Error:checksXm missing", Kind.ERROR), (b"Error:No SD card", Kind.OTHER),
        (b"echo:busy: processing", Kind.BUSY), (b"busy: paused for user", Kind.BUSY), (b"wait", Kind.WAIT),
        (b"start", Kind.START), (b"\x00\xffstart", Kind.START), (b"restart", Kind.OTHER), (b"starting", Kind.OTHER),
        (b"//action:pause", Kind.ACTION), (b"// action:cancel", Kind.ACTION), (b"// a remark", Kind.OTHER),
        (b" T:20.1 /0.0 @:0", Kind.TEMPERATURE), (b"B:60/60", Kind.TEMPERATURE), (b"X:0 Y:0 Z:0 E:0", Kind.OTHER),
        (b"Cap:EMERGENCY_PARSER:1", Kind.CAPABILITY), (b"echo:M113 S2", Kind.KEEPALIVE),
        (b'echo:Unknown command: "M113"', Kind.OTHER), (b'echo:Unknown command: "M113 S2"', Kind.OTHER),
        (b"M113 S2", Kind.KEEPALIVE), (b"Error:No thermistors - no temperature", Kind.OK),
        (b"Printer stopped due to errors. Fix the error and use M999 to restart.", Kind.FATAL),
        (b"", Kind.OTHER), (b"\xff\xfe", Kind.OTHER),
    ],
)  # fmt: skip
def test_a_line_is_what_it_is(line: bytes, kind: Kind) -> None:
    replies = read_replies(line)
    assert [reply.kind for reply in replies] == [kind]


def test_numbers_are_read() -> None:
    assert read_replies(b"Resend: 12")[0].number == 12
    advanced = read_replies(b"ok N12 P15 B3")[0]
    assert (advanced.number, advanced.planner, advanced.queue) == (12, 15, 3)
    assert read_replies(b"ok 5")[0].number == 5
    partly = read_replies(b"ok P7 B2")[0]
    assert (partly.number, partly.planner, partly.queue) == (None, 7, 2)
    assert read_replies(b"echo:M113 S2")[0].number == 2
    assert read_replies(b"//action:prompt_end now")[0].text == "prompt_end now"


def test_heaters_are_read() -> None:
    (reply,) = read_replies(b"ok T:200.1 /205.0 B:-3 /60 T0:200.1 /205.0 T1:21.0 /0.0 @:64 B@:0")
    assert reply.heats == {"T": Heat(200.1, 205), "B": Heat(-3, 60), "T0": Heat(200.1, 205), "T1": Heat(21, 0)}
    assert read_replies(b"T:99.5 W:3")[0].heats == {"T": Heat(99.5, None)}
    assert read_replies(b"ok")[0].heats is None


def test_oks_that_ran_together_are_so_many() -> None:
    assert [reply.kind for reply in read_replies(b"okokok")] == [Kind.OK] * 3
    assert [reply.kind for reply in read_replies(b"ok ok")] == [Kind.OK] * 2
    joined = read_replies(b"okok T:20 /0")
    assert [bool(reply.heats) for reply in joined] == [False, True]


@given(st.binary(max_size=40).filter(lambda line: not set(line) & {10, 13}))
def test_nothing_cannot_be_read(line: bytes) -> None:
    replies = read_replies(line)
    assert replies
    assert all(reply.kind is not Kind.RESEND or reply.number is not None for reply in replies)
