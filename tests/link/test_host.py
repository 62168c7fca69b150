"""What a host does that no fault of a printer brings out: greeting, pausing, stopping, ending."""

import math

import pytest
from duels import MACHINE, STANDARD, job_of, print_job

from gcodectl.config import Machine
from gcodectl.errors import CancelledError, DisconnectedError, FirmwareError, InputError, NoAnswerError, RefusedError
from gcodectl.link.dialect import Dialect
from gcodectl.link.host import Host
from gcodectl.link.job import Line
from gcodectl.link.protocol import TRANSITIONS, Phase, Step, follow
from gcodectl.link.settings import Settings
from plant_models.printer.duel import duel
from plant_models.printer.virtual import VirtualPrinter


class Scripted(Host):
    """A host to which somebody does something at a time."""

    def __init__(self, count: int, at: float, deed: str, **options: object) -> None:
        super().__init__(job_of(count), Settings(**options))  # type: ignore[arg-type]
        self.at, self.deed = at, deed

    def deadline(self) -> float:
        return min(super().deadline(), self.at)

    def advance(self, now: float) -> None:
        if now >= self.at:
            self.at = math.inf
            if self.deed == "cancel":
                self.cancel(CancelledError("enough"), now)
            elif self.deed == "emergency":
                self.emergency("now", now)
            elif self.deed == "twice":
                self.cancel(CancelledError("enough"), now)
                self.emergency("now", now)
            else:
                self.receive(self.deed.encode(), now)
        super().advance(now)


def play(host: Host, dialect: Dialect = STANDARD, machine: Machine = MACHINE) -> tuple[VirtualPrinter, float]:
    printer = VirtualPrinter(machine, dialect=dialect)
    return printer, duel(host, printer)


def texts(printer: VirtualPrinter) -> list[bytes]:
    return [one.text for one in printer.executed]


def test_a_job_ends_with_m400_answered_and_reports_switched_off() -> None:
    outcome = print_job(10)
    done = texts(outcome.printer)
    assert done[-3:] == [b"M400", b"M155 S0", b"M105"]
    assert outcome.host.phase is Phase.ENDED
    assert outcome.host.reached == 11
    assert outcome.host.safe


def test_a_resumed_job_is_not_sent_to_a_printer_that_was_reset() -> None:
    host = Host(job_of(20), Settings(resumed=True))
    printer, _ = play(host)  # it says `start` as it boots
    assert isinstance(host.failure, FirmwareError)
    assert "print anew" in str(host.failure)
    assert not any(text.startswith(b"G1") for text in texts(printer))
    kept = Host(job_of(20), Settings(resumed=True))
    printer, _ = play(kept, Dialect(greeting=False))
    assert kept.failure is None


def test_nothing_is_pulled_back_where_nothing_was_pressed() -> None:
    host = Scripted(5, 30.0, "cancel", pull_back=2.0)
    host._job = iter([Line(1, b"M109 S2000"), Line(2, b"G1 X1")])
    printer, _ = play(host)
    assert host.pulled == 0.0
    assert b"M83" not in texts(printer)


def test_a_silent_port_is_given_up_in_the_stated_time() -> None:
    host = Host(job_of(3), Settings(connect=7.0))
    now, sent = 0.0, b""
    while not host.ended:
        sent += host.transmit()
        now = host.deadline()
        host.advance(now)
    assert isinstance(host.failure, NoAnswerError)
    assert now <= 8.0
    assert sent.count(b"M110") == 4
    assert b"G1" not in sent


def test_a_port_that_says_ok_once_and_then_only_reports_is_given_up() -> None:
    host = Host(job_of(3))
    host.advance(0.0)
    host.receive(b"ok\n", 0.1)
    now = 0.1
    while not host.ended:
        host.transmit()
        now = host.deadline()
        host.receive(b"T:20 /0\n", now)
        host.advance(now)
    assert isinstance(host.failure, NoAnswerError)
    assert now < 30.0


def test_garbage_is_no_greeting() -> None:
    host = Host(job_of(3))
    host.advance(0.0)
    host.receive(b"\x00\xfe\n$ login:\nT:20 /0\n", 1.0)
    assert host.phase is Phase.GREETING


def test_a_reset_before_the_job_begins_starts_the_link_anew() -> None:
    host = Scripted(20, 0.051, "start\n")
    printer, _ = play(host)
    assert host.failure is None
    assert [text for text in texts(printer) if text.startswith(b"G1")] == [line.command for line in job_of(20)[1:]]


def test_cancelling_releases_the_plunger_and_cools_in_good_order() -> None:
    host = Scripted(2000, 0.3, "cancel", pull_back=1.5)
    printer, took = play(host)
    done = texts(printer)
    assert done[-6:-1] == [b"M83", b"G1 E-1.5000 F300", b"M104 S0", b"M140 S0", b"M107"]
    assert isinstance(host.failure, CancelledError)
    assert host.safe
    assert took < 1.0
    assert 10 < len([text for text in done if text.startswith(b"G1 X")]) < 1990


def test_cancelling_ends_a_wait_for_heat() -> None:
    for dialect in (STANDARD, Dialect(emergency_parser=False)):
        host = Scripted(5, 30.0, "cancel")
        host._job = iter([Line(1, b"M109 S2000"), Line(2, b"G1 X1")])
        printer, took = play(host, dialect)
        assert isinstance(host.failure, CancelledError)
        assert host.safe
        assert took < 31  # which it would not be at 2000 degC
        assert b"G1 X1" not in texts(printer)


def test_a_report_that_came_by_itself_does_not_say_that_a_stop_was_heard() -> None:
    host = Scripted(2000, 0.3, "T:20 /0\nError:Printer halted. kill() called!\nT:20 /0\n")
    host.outbox.flight.tells = True
    printer = VirtualPrinter(MACHINE)
    now = 0.0
    while host.failure is None:
        printer.receive(host.transmit(), now)
        host.receive(printer.transmit(), now)
        now += 0.001
        host.advance(now)
    assert not host.ended
    host.receive(b"ok T:20 /0\n", now)
    assert host.ended
    assert host.safe


def test_an_emergency_goes_out_bare_and_then_numbered_at_once() -> None:
    host = Scripted(2000, 0.3, "emergency")
    host.advance(0.0)
    printer, _ = play(host)
    assert not printer.alive
    assert isinstance(host.failure, CancelledError)
    assert not host.safe
    other = Scripted(5, math.inf, "")
    other.transmit()
    other.emergency("now", 1.0)
    bare, numbered = other.transmit().splitlines()
    assert bare == b"M112"
    assert numbered.startswith(b"N")
    assert b" M112*" in numbered
    assert other.ended


def test_a_second_stop_is_an_emergency() -> None:
    host = Scripted(2000, 0.3, "twice")
    printer, _ = play(host)
    assert not printer.alive
    assert str(host.failure) == "enough"


def test_a_pause_sends_nothing_and_a_resume_goes_on() -> None:
    host = Host(job_of(20))
    printer = VirtualPrinter(MACHINE)
    host.advance(0.0)
    for k in range(400):
        now = k * 0.001
        host.advance(now)
        printer.receive(host.transmit(), now)
        host.receive(printer.transmit(), now)
        if host.reached == 5 and host.phase is Phase.PRINTING:
            host.receive(b"//action:pause\n", now)
    assert host.phase is Phase.PAUSED
    assert host.reached in (5, 6)
    host.receive(b"//action:resume\n", 1.0)
    duel(host, printer)
    assert host.failure is None
    assert [text for text in texts(printer) if text.startswith(b"G1")] == [line.command for line in job_of(20)[1:]]


def test_an_unknown_error_ends_the_job_unless_a_resend_request_follows() -> None:
    host = Scripted(2000, 0.3, "Error:something odd\n")
    _, _ = play(host)
    assert isinstance(host.failure, FirmwareError)
    assert "something odd" in str(host.failure)
    assert host.safe
    harmless = Scripted(100, 0.06, "Error:chexksum mismytch\nResend: 1004\n")
    play(harmless)
    assert harmless.failure is None


@pytest.mark.parametrize("word", ["poweroff", "disconnect"])
def test_a_printer_that_leaves_ends_the_job(word: str) -> None:
    host = Scripted(2000, 0.3, f"//action:{word}\n")
    play(host)
    assert isinstance(host.failure, FirmwareError)
    assert word in str(host.failure)


def test_a_job_that_breaks_off_by_itself_is_stopped_in_good_order() -> None:
    def broken() -> object:
        yield from job_of(20)
        raise RefusedError("too long", line=21)

    host = Host(broken())  # type: ignore[arg-type]
    printer, _ = play(host)
    assert isinstance(host.failure, InputError)
    assert host.safe
    assert texts(printer)[-4:-1] == [b"M104 S0", b"M140 S0", b"M107"]
    assert len([text for text in texts(printer) if text.startswith(b"G1")]) == 20


def test_a_job_that_has_no_line_yet_is_asked_again() -> None:
    def slow() -> object:
        for line in job_of(5):
            yield None
            yield line

    host = Host(slow())  # type: ignore[arg-type]
    host.advance(0.0)
    printer = VirtualPrinter(MACHINE)
    for k in range(600):
        now = k * 0.001
        host.advance(now)
        printer.receive(host.transmit(), now)
        host.receive(printer.transmit(), now)
    assert host.ended
    assert host.failure is None
    assert [text for text in texts(printer) if text.startswith(b"G1")] == [line.command for line in job_of(5)[1:]]


def test_a_port_that_never_comes_back_ends_the_wait_for_it() -> None:
    other = Host(job_of(50), Settings(reopen=9.0))
    other.advance(0.0)
    other.receive(b"ok\n", 0.1)
    other.advance(0.2)
    other.transmit()
    for k in range(3):
        other.receive(b"ok T:20 /0\n" if k == 2 else b"ok\n", 0.3)
        other.transmit()
    assert other.phase is Phase.PRINTING
    other.disconnected("unplugged", 1.0)
    assert other.deadline() == 10.0
    other.advance(10.0)
    assert other.ended
    assert isinstance(other.failure, DisconnectedError)
    assert not other.safe


def printing(count: int = 50, **options: object) -> Host:
    """A host that has its first line on the way, at 0.3 s."""
    host = Host(job_of(count), Settings(**options))  # type: ignore[arg-type]
    host.advance(0.0)
    host.receive(b"ok\n", 0.1)
    host.advance(0.2)
    for reply in (b"ok\n", b"ok\n", b"ok T:20 /0\n"):
        host.transmit()
        host.receive(reply, 0.3)
    assert b"M104" in host.transmit()
    return host


def test_a_port_that_comes_and_goes_is_given_up() -> None:
    host = printing(reopen=9.0)
    now = 1.0
    while not host.ended and now < 100.0:
        host.disconnected("closed", now)
        if host.deadline() <= now + 0.5:
            host.advance(now + 0.5)
        host.reconnected(now + 0.5)
        host.transmit()
        now += 0.6
    assert isinstance(host.failure, DisconnectedError)
    assert now < 12.0


def test_a_printer_that_waits_and_hears_nothing_is_given_up() -> None:
    host = printing()
    now = 0.3
    while not host.ended and now < 300.0:
        now += 1.0
        host.receive(b"wait\n", now)
        host.transmit()
        while host.deadline() <= now:
            host.advance(now)
            host.transmit()
    assert isinstance(host.failure, NoAnswerError)
    assert now < 30.0
    assert not host.safe


def test_a_port_that_says_ok_without_end_is_given_up() -> None:
    host = Host(job_of(3), Settings(connect=7.0))
    host.advance(0.0)
    now = 0.0
    while not host.ended and now < 30.0:
        now += 0.04
        host.receive(b"ok\n", now)
        if host.deadline() <= now:
            host.advance(now)
    assert isinstance(host.failure, NoAnswerError)


def test_a_second_reason_to_stop_in_good_order_changes_nothing() -> None:
    host = printing(pull_back=1.5)
    host.outbox.store.append(b"N9 G1 E1*0\n")
    host.cancel(CancelledError("the printer's own cancel"), 1.0)
    host.cancel(CancelledError("stopped by you"), 1.1)
    assert not host.bare
    assert str(host.failure) == "the printer's own cancel"
    assert host.own[0] == b"M83"


def test_what_was_not_sent_has_not_pulled_back() -> None:
    host = printing(pull_back=1.5, stop=5.0)
    host.outbox.store.append(b"N9 G1 E1*0\n")
    host.cancel(CancelledError("enough"), 1.0)
    assert host.pulled == 1.5
    host.fail(FirmwareError("the printer was reset"))
    while not host.ended:
        host.transmit()
        host.advance(host.deadline())
    assert host.pulled == 0.0
    at_once = printing(pull_back=1.5)
    at_once.outbox.store.append(b"N9 G1 E1*0\n")
    at_once.cancel(CancelledError("enough"), 1.0)
    at_once.emergency("now", 1.1)
    assert at_once.pulled == 0.0


def test_an_answer_lost_on_a_printer_without_ok_t_holds_nothing_up() -> None:
    host, now = Host(job_of(3)), 0.0
    executed: list[bytes] = []
    lost = False
    while not host.ended and now < 200.0:
        now = host.deadline() if host.deadline() < now + 0.1 else now + 0.1
        host.advance(now)
        for line in host.transmit().splitlines():
            command = line.partition(b" ")[2].partition(b"*")[0]
            executed += [command] if command else []
            if command == b"G1 X1 Y1.00 E0.020" and not lost:
                lost = True
            elif command:
                host.receive(b"ok\nT:20.0 /0.0\n" if command == b"M105" else b"ok\n", now)
    assert lost
    assert host.failure is None
    assert [one for one in executed if one.startswith(b"G1")] == [line.command for line in job_of(3)[1:]]
    assert now < 20.0


@pytest.mark.parametrize("answer", [b"ok T:0\n", b"Error:No thermistors - no temperature\n"])
def test_a_printer_without_a_heater_prints_and_is_safe_when_it_is_stopped(answer: bytes) -> None:
    for stopped in (False, True):
        host, now = Host(job_of(30)), 0.0
        while not host.ended and now < 60.0:
            now += 0.05
            host.advance(now)
            for line in host.transmit().splitlines():
                if line:
                    host.receive(answer if b"M105" in line else b"ok\n", now)
            if stopped and host.reached == 10 and host.stopping is None:
                host.cancel(CancelledError("enough"), now)
        assert host.ended
        assert (host.failure is None) is not stopped
        assert host.safe
        assert now < 10.0


def test_heating_reports_are_signs_of_life_and_others_are_none() -> None:
    for command, alive in ((b"M109 S200", True), (b"G28", False)):
        host = Host([Line(1, command), Line(2, b"G1 X1")], Settings(silence=60.0))
        now = 0.0
        host.advance(now)
        host.receive(b"ok\n", 0.1)
        host.advance(0.2)
        for reply in (b"ok\n", b"ok\n", b"ok T:20 /0\n"):
            host.transmit()
            host.receive(reply, 0.3)
        assert host.transmit()
        for k in range(80):
            now = 1.0 + k
            host.receive(b"T:20.1 /200 W:?\n", now)
            while host.deadline() <= now:
                host.advance(now)
                host.transmit()
        assert isinstance(host.failure, NoAnswerError) is not alive


def test_the_table_of_phases_ends_everything_and_begins_nothing_anew_in_mid_job() -> None:
    assert set(TRANSITIONS) == set(Phase)
    for phase in Phase:
        seen, todo = set(), [phase]
        while todo:
            one = todo.pop()
            if one not in seen:
                seen.add(one)
                todo += TRANSITIONS[one].values()
        assert Phase.ENDED in seen
    for phase in (Phase.PRINTING, Phase.PAUSED, Phase.FINISHING, Phase.STOPPING, Phase.ENDED):
        assert follow(phase, Step.RESET) is None
