"""Each fault does what it says, when it says, and the printer is alive afterwards where it claims to be."""

from __future__ import annotations

import math

import pytest
from printing_hosts import ask, job, printer, send, wait

from gcodectl.errors import UsageError
from plant_models.printer.faults import KINDS, Fault, parse_faults


def test_a_spec_is_read():
    assert parse_faults("lost-ok@150, garble-in%0.001,busy=5@200,") == (
        Fault("lost-ok", 0.0, 150), Fault("garble-in", 0.0, None, 0.001), Fault("busy", 5.0, 200),
    )  # fmt: skip
    assert parse_faults("silence@1")[0].value == 5.0
    assert parse_faults("") == ()


@pytest.mark.parametrize(
    "spec", ["lost-ok", "nothing@1", "lost-ok=3@1", "busy=x@1", "busy=-1@1", "garble-in%0", "garble-in%2", "@1",
             "busy=1e@1", "busy=1e99@1"],
)  # fmt: skip
def test_a_wrong_spec_is_refused_with_what_there_is(spec: str):
    with pytest.raises(UsageError, match="--faults"):
        parse_faults(spec)


def test_the_refusal_names_all_faults():
    with pytest.raises(UsageError) as caught:
        parse_faults("nothing@1")
    assert all(name in str(caught.value) for name in KINDS)


def test_a_lost_ok_is_lost_once():
    one = printer("lost-ok@2")
    assert [send(one, k, b"M117") for k in (1, 2, 3)] == [b"ok\n", b"", b"ok\n"]
    assert [e.number for e in one.executed] == [1, 2, 3]


def test_a_lost_line_is_never_seen():
    one = printer("lost-line@2")
    assert [send(one, k, b"M117") for k in (1, 2)] == [b"ok\n", b""]
    assert b"Last Line: 1\nResend: 2\nok\n" in send(one, 3, b"M117")
    assert [send(one, k, b"M117") for k in (2, 3)] == [b"ok\n", b"ok\n"]


MISMATCH = b"Error:checksum mismatch, Last Line: 0\nResend: 1\n"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("checksum", MISMATCH + b"ok\n"),
        ("checksum-ok", MISMATCH + b"ok\n"),
        ("checksum-no-ok", MISMATCH),
        ("duplicate-resend", MISMATCH + b"ok\nResend: 1\nok\n"),
        ("missing-checksum", b"Error:No Checksum with line number, Last Line: 0\nResend: 1\nok\n"),
    ],
)
def test_a_good_line_is_refused_once(name: str, said: bytes):
    one = printer(f"{name}@1")
    assert send(one, 1, b"M117") == said
    assert send(one, 1, b"M117") == b"ok\n"
    assert [e.number for e in one.executed] == [1]


def test_a_garbled_line_is_never_executed_as_itself():
    for seed in range(60):
        one = printer("garble-in@1", seed=seed)
        send(one, 1, b"G1 X10")
        wait(one, 20.0)
        assert all(e.number is None and e.text != b"G1 X10" for e in one.executed)


def test_bare_lines_and_pieces_of_lines_pass_where_faults_wait():
    one = printer("lost-line@9,checksum%1")
    assert ask(one, b"M117 a") == b"ok\n"
    one.receive(b"M1", one.now)
    one.receive(b"17\nN1 M117\nM11", one.now)
    assert one.transmit().endswith(b"Resend: 1\nok\n") or one.receiver.last == 0
    assert [e.text for e in one.executed] == [b"M117 a", b"M117"]


def test_a_garbled_ok_differs_in_one_bit():
    one = printer("garble-out@1")
    said = send(one, 1, b"M117")
    wrong = [a ^ b for a, b in zip(said, b"ok\n", strict=True) if a != b]
    assert len(wrong) == 1
    assert wrong[0].bit_count() == 1


def test_split_ok_and_slow_ok_take_their_time():
    one = printer("split-ok=0.5@1,slow-ok=2@2")
    assert send(one, 1, b"M117") == b"o"
    assert one.blocked
    assert wait(one, 0.6) == b"k\n"
    assert not one.blocked
    assert send(one, 2, b"M117") + send(one, 3, b"M105") == b""
    assert wait(one, 2.1)[:7] == b"ok\nok T"


def test_a_joined_ok_runs_into_the_next():
    one = printer("join-ok@1")
    assert send(one, 1, b"M117") + send(one, 2, b"M117") == b"okok\n"


def test_bogus_and_future_resends_ask_for_what_nobody_misses():
    one = printer("bogus-resend@3,future-resend=7@4")
    for k in (1, 2):
        send(one, k, b"M117")
    assert send(one, 3, b"M117") == b"Error:checksum mismatch, Last Line: 0\nResend: 1\nok\nok\n"
    assert b"Resend: 11\n" in send(one, 4, b"M117")
    assert one.receiver.last == 4


def test_busy_says_so_and_silence_does_not():
    one = printer("busy=5@1,silence=5@2")
    assert send(one, 1, b"M117") == b""
    assert one.blocked
    assert wait(one, 5.0) == b"echo:busy: processing\n" * 2 + b"ok\n"
    ask(one, b"M155 S1")
    assert send(one, 2, b"M117") == b"" == send(one, 4, b"M117")
    assert wait(one, 4.9) == b""
    said = wait(one, 0.2)
    assert said.startswith(b"Error:Line Number is not Last Line Number+1, Last Line: 2\nResend: 3\nok\nok\n")
    assert b"busy" not in said


def test_the_dead_say_nothing():
    one = printer("dead@1")
    assert send(one, 1, b"M117") == b"" == wait(one, 100.0) == ask(one, b"M105")
    assert not one.alive
    assert one.executed == []


def test_kill_and_thermal_runaway_halt():
    one = printer("kill@1")
    assert send(one, 1, b"M117") == b"Error:Printer halted. kill() called!\n"
    one = printer("thermal@1")
    ask(one, b"M104 S100")
    assert send(one, 1, b"M117").startswith(b"Error:Thermal Runaway")
    assert not one.alive
    assert one.commands.thermals.hotends[0].target == 0


def test_reset_loses_queue_position_and_heat():
    one = printer("reset@3", greeting=True)
    one.transmit()
    ask(one, b"M104 S100", b"G1 X1")
    said = send(one, 1, b"G4 P1000")
    one.receive(b"M110 N2\n", one.now)
    wait(one, 1.0)
    assert send(one, 3, b"G1 X3").startswith(b"start\n")
    assert said == b""
    assert (one.receiver.last, one.alive, one.motion.idle) == (0, True, True)
    assert one.motion.taken[-1] == b"G92 X0 Y0 Z0 E0"  # type: ignore[attr-defined]
    assert b"/0.00 B" in ask(one, b"M105")
    assert 3 not in [e.number for e in one.executed]


def test_a_closed_port_hears_and_says_nothing_and_comes_back():
    one = printer("close=3@1")
    assert send(one, 1, b"M117") == b""
    assert one.closed
    assert one.open_at == 3.0
    assert ask(one, b"M105") == b""
    assert wait(one, 3.0) == b""
    assert not one.closed
    assert send(one, 2, b"M105")[:4] == b"ok T"


def test_a_pause_ends_by_itself_and_holds_nothing_back():
    one = printer("pause=3@1")
    assert parse_faults("pause@1")[0].value == 5.0
    assert send(one, 1, b"M117") == b"//action:pause\nok\n"
    assert one.deadline() == 3.0
    assert not one.blocked
    assert wait(one, 2.0) + send(one, 2, b"M117") == b"ok\n"
    assert wait(one, 0.9) == b""
    assert wait(one, 0.2) == b"//action:resume\n"
    assert one.deadline() == math.inf


def test_pauses_may_overlap_and_are_said_in_the_order_of_their_ends():
    one = printer("pause=3@1,pause=1@2,busy=9@3")
    assert b"".join(send(one, k, b"M117") for k in (1, 2, 3)).count(b"//action:pause\n") == 2
    assert wait(one, 1.5) == b"//action:resume\n"
    assert wait(one, 7.5) == b"echo:busy: processing\n//action:resume\n" + b"echo:busy: processing\n" * 3 + b"ok\n"


def test_a_pause_that_ends_while_the_port_is_gone_is_said_when_it_is_back():
    one = printer("pause=1@1,close=3@1")
    send(one, 1, b"M117")
    assert wait(one, 2.9) == b""
    assert wait(one, 0.1) == b"//action:resume\n"


def test_a_reset_forgets_that_it_paused():
    one = printer("pause=3@1,reset@2", greeting=True)
    send(one, 1, b"M117")
    assert send(one, 2, b"M117").startswith(b"start\n")
    assert wait(one, 9.0) == b""


@pytest.mark.parametrize("name", ["pause", "resume", "cancel"])
def test_actions_are_said(name: str):
    assert send(printer(f"{name}@1"), 1, b"M117") == b"//action:" + name.encode() + b"\nok\n"


def test_noise_is_a_line_that_is_no_answer():
    said = send(printer("noise=40@1"), 1, b"M117")
    line, ok, rest = said.split(b"\n")
    assert (len(line), ok, rest) == (40, b"ok", b"")
    assert line[0] >= 128
    assert b"\r" not in line


def test_chance_is_seeded():
    def heard(seed: int) -> list[bytes]:
        return job(printer("checksum%0.2,busy=3%0.1,noise%0.1", seed=seed), 60)

    assert heard(1) == heard(1) != heard(2)


SURVIVED = [name for name, kind in KINDS.items() if kind.survivable and name not in ("reset", "close")]


@pytest.mark.parametrize("name", SURVIVED)
def test_a_printer_that_survives_executes_every_line_of_a_patient_host_once(name: str):
    one = printer(f"{name}@20,{name}@21")
    job(one, 40)
    numbers = [e.number for e in one.executed if e.number is not None]
    assert one.alive
    assert all(fault.survivable for fault in parse_faults(f"{name}@1"))
    if name in ("bogus-resend", "future-resend"):  # the plain host believes the first, and runs ahead of the other
        assert numbers[:19] == list(range(1, 20))
    else:
        assert numbers == list(range(1, 41))


@pytest.mark.parametrize("name", [name for name in KINDS if name not in SURVIVED])
def test_a_printer_that_does_not_survive_a_job_says_so(name: str):
    (fault,) = parse_faults(f"{name}@5")
    one = printer(f"{name}@5")
    for k in range(1, 6):
        send(one, k, b"M117")
    assert one.alive is fault.survivable
