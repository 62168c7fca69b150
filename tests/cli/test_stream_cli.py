"""`gcodectl stream` against a virtual printer on a pty, in this process."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import sys
from pathlib import Path

import pytest
from filtering import DATA
from streaming import Printer, Stream

from gcodectl.cli import jobs, show_stream
from gcodectl.cli.jobs import Job
from gcodectl.cli.show_stream import Shown
from gcodectl.errors import CancelledError
from gcodectl.link import journal, transport
from gcodectl.link.host import Host
from gcodectl.link.job import read_lines
from gcodectl.link.replies import Heat
from gcodectl.link.settings import Settings
from gcodectl.link.stopping import Stopping

BOX = DATA / "box_abs.gcode"
HOT = b"M140 S60\nM104 S205\nG28\n"


def moves_of(data: bytes) -> list[bytes]:
    return [line.command for line in read_lines([data]) if line.command.startswith(b"G1 X")]


@pytest.fixture
def printer(tmp_path: Path) -> Printer:
    return Printer(tmp_path / "printer")


@pytest.fixture
def part(tmp_path: Path) -> Path:
    path = tmp_path / "part.gcode"
    path.write_bytes(HOT + BOX.read_bytes())
    return path


def entries(tmp_path: Path) -> list[dict[str, object]]:
    return [json.loads(one.read_text()) for one in (tmp_path / "state" / "gcodectl").glob("*.json")]


def interrupt(monkeypatch: pytest.MonkeyPatch, line: int, *signals: signal.Signals) -> None:
    """Send ourselves signals once the printer has acknowledged `line`."""
    turn, left = Shown.turn, list(signals)

    def interrupting(self: Shown) -> None:
        turn(self)
        if self._host.reached >= line:
            while left:
                signal.raise_signal(left.pop(0))

    monkeypatch.setattr(Shown, "turn", interrupting)
    monkeypatch.setattr("gcodectl.link.sender.TURN", 0.0)
    monkeypatch.setattr("gcodectl.link.sender.LOOK", 0.0)


@pytest.mark.parametrize("window", ["1", "4", "auto"])
def test_a_file_is_printed_line_by_line(stream: Stream, tmp_path: Path, window: str) -> None:
    log = tmp_path / "log"
    with Printer(tmp_path / "printer", advanced_ok=True) as printer:
        ended = stream(BOX, "--port", printer.port, "--window", window, "--log", log)
    assert ended.status == 0
    assert "printed in " in ended.said
    assert ended.out == ""
    assert printer.moves == moves_of(BOX.read_bytes())
    assert printer.done[-3:] == [b"M400", b"M155 S0", b"M105"]
    assert entries(tmp_path) == []
    sent = [line.split(b" ", 3) for line in log.read_bytes().splitlines()]
    assert sum(way == b">" for _, way, *_ in sent) >= len(printer.done)


def test_events_say_where_it_is(stream: Stream, printer: Printer) -> None:
    with printer:
        ended = stream(BOX, "--port", printer.port, "--json")
    first, *_, last = ended.events
    assert first == {"event": "phase", "phase": "greeting"}
    assert last["ok"] is last["safe"] is True
    assert (last["exit_status"], last["layer"], last["layers"], last["left_s"]) == (0, 3, 3, 0.0)
    assert set(last["heats"]) == {"B", "T"}
    assert "progress" in {event["event"] for event in ended.events}
    assert ended.said == ""


@pytest.mark.parametrize("ending", [b"\n", b"\r\n", b"\r"])
def test_a_pipe_is_read_as_it_comes(stream: Stream, printer: Printer, tmp_path: Path, ending: bytes) -> None:
    data = BOX.read_bytes().replace(b"\n", ending)
    with printer:
        ended = stream("-", "--port", printer.port, "--json", stdin=data + b"M117 caf\xe9")
    assert ended.status == 0
    assert printer.moves == moves_of(data)
    assert b"M117 caf?" in printer.done
    assert ended.events[-1]["left_s"] is None
    assert not (tmp_path / "state").exists()


def test_a_filtered_file_prints_as_the_filter_writes_it(stream: Stream, printer: Printer) -> None:
    with printer:
        ended = stream(BOX, "--filter", "--port", printer.port, "--json")  # a neutral extruder
    assert ended.status == 0
    assert printer.moves == moves_of(BOX.read_bytes())
    assert (ended.events[-1]["layer"], ended.events[-1]["left_s"]) == (3, 0.0)


def test_a_bad_line_in_a_pipe_ends_in_a_safe_printer(stream: Stream, printer: Printer) -> None:
    with printer:
        ended = stream("-", "--port", printer.port, stdin=HOT + b"M112\nG1 X1\n")
    assert ended.status == 4
    assert "standard input:line 4: `M112` M112 acts when it arrives" in ended.said
    assert "--resume" not in ended.said
    assert printer.done[-4:] == [b"M104 S0", b"M140 S0", b"M107", b"M105"]
    assert printer.moves == []


@pytest.mark.parametrize(
    ("data", "status", "why"),
    [
        (b"", 3, "holds no command"),
        (b"; nothing\n\n", 3, "holds no command"),
        (b"G28\nG1 X" + b"0" * 200, 4, "takes 2.. bytes"),
        (b"G28\nM112\n", 4, "line 2: `M112`"),
        (b"G28\nG1 X1 \xe9\n", 4, "no firmware reads"),
        (b"M117 " + b"a" * 100, 4, "shorten it"),
    ],
)
def test_what_must_not_be_sent_is_refused_before_a_port_is_opened(
    stream: Stream, tmp_path: Path, data: bytes, status: int, why: str
) -> None:
    path = tmp_path / "x.gcode"
    path.write_bytes(data)
    for words in ((), ("--filter",)):
        ended = stream(path, "--port", tmp_path / "none", *words)
        if words and status == 4:
            assert ended.status in (3, 4)
        else:
            assert ended.status == status
            assert re.search(why, ended.said), ended.said


@pytest.mark.parametrize(
    ("words", "status", "why"),
    [
        (("--window", "0"), 2, "--window 0: write a number"),
        (("--window", "x"), 2, "--window x"),
        (("--rx-bytes", "0"), 2, "--rx-bytes 0"),
        (("--baud", "0"), 2, "--baud 0: it must be positive"),
        (("--material", "clay"), 2, "goes with --filter"),
        (("--filter", "--material", "jam"), 2, "no material 'jam'"),
        (("--yes",), 2, "goes with --resume"),
        (("--resume",), 3, "nothing to resume"),
        (("--machine", "none"), 2, "no machine"),
        (("--port", "none"), 10, "cannot open none: there is no such port"),
        (("--port", "none", "--log", "no/folder"), 2, "--log no/folder"),
        (("--port", "none", "--log", "."), 2, "name a file"),
        (("--port", "socket://127.0.0.1"), 10, "no port number"),
        (("--port", "hwgrep://zebra"), 10, "no ports found"),
    ],
)
def test_a_wrong_call_is_refused(stream: Stream, words: tuple[str, ...], status: int, why: str) -> None:
    ended = stream(BOX, *words)
    assert ended.status == status
    assert why in ended.said
    assert ended.said.count("\n") == 1


def test_what_is_no_file_is_refused(stream: Stream, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for source, status, why in (
        (tmp_path, 3, "is a folder"), (tmp_path / "none", 3, "no such file"), (pipe, 2, f"gcodectl stream - < {pipe}"),
    ):  # fmt: skip
        ended = stream(source)
        assert ended.status == status
        assert why in ended.said
    assert "came down a pipe is gone" in stream("-", "--resume").said


def test_a_dry_run_says_what_would_be(stream: Stream) -> None:
    ended = stream(BOX, "--dry-run", "--port", "none")
    assert ended.status == 0
    assert "104 commands to send, 44.2 s of motion; if it is stopped, E is pulled back 0.02 mm" in ended.out
    assert "nothing to say" in stream("-", "--dry-run").out
    plan = stream(BOX, "--dry-run", "--json").events[0]
    assert (plan["event"], plan["lines"], plan["resume_after"]) == ("plan", 104, None)


def test_a_failed_start_says_so_in_its_events_too(stream: Stream) -> None:
    ended = stream(BOX, "--port", "none", "--json")
    assert ended.status == 10
    assert ended.events[-1]["ok"] is False
    assert ended.events[-1]["exit_status"] == 10


def test_nobody_answers(stream: Stream, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("gcodectl.cli.stream._settings", lambda *_: Settings(connect=0.1))
    monkeypatch.setattr("gcodectl.link.host.GREET_EVERY", 0.1)
    with socket.create_server(("127.0.0.1", 0)) as deaf:
        url = f"socket://127.0.0.1:{deaf.getsockname()[1]}"
        ended = stream(BOX, "--port", url)
    assert ended.status == 11
    assert f"the port was {url} at 115200 baud" in ended.said
    assert entries(tmp_path) == []


def test_a_port_is_for_one_alone(stream: Stream, printer: Printer) -> None:
    with printer:
        held = transport.open_port(printer.port, 115200)
        ended = stream(BOX, "--port", printer.port)
        held.close()
    assert ended.status == 10
    assert "another program has it open" in ended.said


def test_the_one_port_there_is_is_found_once(stream: Stream, printer: Printer, monkeypatch: pytest.MonkeyPatch) -> None:
    with printer:
        monkeypatch.setattr("gcodectl.link.transport.find_port", lambda: printer.port)
        assert stream(BOX).status == 0


def test_once_stops_in_good_order_and_resume_goes_on(
    stream: Stream, part: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Printer(tmp_path / "printer") as first, monkeypatch.context() as patch:
        interrupt(patch, 60, signal.SIGINT)
        ended = stream(part, "--port", first.port)
    assert ended.status == 130
    assert "stopped by you; line " in ended.said
    assert "`--resume` goes on after it" in ended.said
    assert first.done[-6:-1] == [b"M83", b"G1 E-0.0200 F300", b"M104 S0", b"M140 S0", b"M107"]
    [entry] = entries(tmp_path)
    assert entry["ended"] is True
    assert entry["pulled"] == pytest.approx(0.02)

    assert stream(part, "--resume", "--port", "none", stdin=b"n\n").status == 130
    assert stream(part, "--resume", "--port", "none", "--yes").status == 10
    assert entries(tmp_path) == [entry]  # a start that failed does not lose the place
    assert f"goes on after line {entry['line']}, with " in stream(part, "--resume", "--dry-run").out

    with Printer(tmp_path / "printer2") as second:
        ended = stream(part, "--resume", "--port", second.port, stdin=b"y\n")
    assert ended.status == 0
    assert "Acknowledged is not deposited" in ended.said
    assert "It was killed" not in ended.said
    told = [text for text in second.done if text.startswith((b"M109", b"M83", b"G1 E0.0200", b"G21"))]
    assert told == [b"M109 S205", b"M83", b"G1 E0.0200 F300", b"G21"]
    assert [*first.moves, *second.moves] == moves_of(part.read_bytes())
    assert b"G28" not in second.done
    assert entries(tmp_path) == []
    assert stream(part, "--resume", "--yes", "--port", "none").status == 3


def test_twice_stops_at_once(stream: Stream, part: Path, printer: Printer, monkeypatch: pytest.MonkeyPatch) -> None:
    interrupt(monkeypatch, 60, signal.SIGINT, signal.SIGINT)
    with printer:
        ended = stream(part, "--port", printer.port)
        assert printer.dies()
    assert ended.status == 130
    assert "stopped at once by you (M112); the printer did not confirm that its heaters are off" in ended.said
    assert "if the printer still knows where it is, `--resume`" in ended.said
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler  # as it was before


@pytest.mark.parametrize("one", [signal.SIGTERM, signal.SIGHUP])
def test_sigterm_stops_in_good_order_however_often(
    stream: Stream, part: Path, printer: Printer, monkeypatch: pytest.MonkeyPatch, one: signal.Signals
) -> None:
    before = signal.signal(one, signal.SIG_DFL)  # under nohup, SIGHUP is nobody's business
    interrupt(monkeypatch, 60, one, one, one)
    try:
        with printer:
            ended = stream(part, "--port", printer.port, "--json")
    finally:
        signal.signal(one, before)
    assert ended.status == 130
    assert printer.inner.alive
    assert ended.events[-1]["safe"] is True
    assert b"M104 S0" in printer.done


def test_a_file_that_has_changed_is_not_resumed(stream: Stream, part: Path, printer: Printer, tmp_path: Path) -> None:
    with Printer(tmp_path / "p", faults="cancel@1050") as cancelling:
        assert stream(part, "--port", cancelling.port).status == 130
    assert "changed since" in stream(part, "--resume", "--filter", "--yes").said
    part.write_bytes(part.read_bytes() + b"G28\n")
    ended = stream(part, "--resume", "--yes")
    assert ended.status == 3
    assert "changed since" in ended.said
    with printer:  # printed anew, the old place is forgotten
        assert stream(part, "--port", printer.port).status == 0
    assert entries(tmp_path) == []


@pytest.mark.parametrize(
    ("fault", "status", "why"),
    [
        ("reset@1050", 12, "was reset: .*; if the printer still knows where it is, `--resume`"),
        ("kill@1050", 12, "kill.*see to it, or switch it off"),
        ("close=1@1050", 13, "`--resume` goes on after it"),
        ("cancel@1050", 130, "the printer's own cancel"),
        ("lost-ok@1050", 0, "printed in"),
        ("checksum@1050,checksum-no-ok@1060,noise@1070,duplicate-resend@1080", 0, ", 3 lines sent again"),
    ],
)
def test_faults_end_in_their_status(
    stream: Stream, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, status: int, why: str
) -> None:
    monkeypatch.setattr("gcodectl.link.stopping.BETWEEN", 0.2)
    monkeypatch.setattr("gcodectl.cli.stream._settings", lambda *_: Settings(patience=0.3))
    with Printer(tmp_path / "printer", faults=fault, keepalive=0.0) as printer:
        ended = stream(BOX, "--port", printer.port)
    assert ended.status == status
    assert re.search(why, ended.said), ended.said
    if status == 0:
        assert printer.moves == moves_of(BOX.read_bytes())
    else:
        assert printer.moves == moves_of(BOX.read_bytes())[: len(printer.moves)]


def test_a_log_a_journal_and_a_reader_that_fail_do_not_end_a_print(
    stream: Stream, printer: Printer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "state").touch()

    class Gone:
        def write(self, _: str) -> None:
            raise BrokenPipeError("nobody")

    shown = Shown.__init__

    def deaf(self: Shown, *words: object, **more: object) -> None:
        shown(self, *words, **more)  # type: ignore[arg-type]
        self._out = Gone()  # type: ignore[assignment]

    monkeypatch.setattr(Shown, "__init__", deaf)
    monkeypatch.setattr(show_stream, "_drop", lambda _: None)
    with printer:
        ended = stream(BOX, "--port", printer.port, "--json", "--log", "/dev/full")
    assert ended.status == 0
    assert "the journal cannot be kept" in ended.said
    assert "nobody reads the events (nobody): the print goes on" in ended.said
    assert "the log cannot be written" in ended.said
    assert printer.moves == moves_of(BOX.read_bytes())


def test_a_fault_of_ours_switches_the_heaters_off(
    stream: Stream, part: Path, printer: Printer, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(self: Shown) -> None:
        if self._host.reached > 10:
            raise ZeroDivisionError

    monkeypatch.setattr(Shown, "turn", broken)
    monkeypatch.setattr("gcodectl.link.sender.TURN", 0.0)
    monkeypatch.setattr("gcodectl.link.sender.LOOK", 0.0)
    with printer:
        with pytest.raises(ZeroDivisionError):
            stream(part, "--port", printer.port)
        held = transport.open_port(printer.port, 115200)  # it has heard all that was sent before
        held.write(b"M105\n")
        said = b""
        while b"ok T" not in said:
            said += held.read(30.0)
        held.close()
    assert printer.done[-3:] == [b"M104 S0", b"M140 S0", b"M105"]


def test_the_bar_says_layer_time_and_temperatures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    job = jobs.prepare(str(BOX), "syringe", None)
    host = Host([])
    shown = Shown(job, host, as_json=False)
    host.reached = 60
    host.printer.heats = {"T": Heat(199.6, 200.0), "B": Heat(21.0)}
    shown.turn()
    task = shown._bar.tasks[0]
    assert task.description.startswith("layer 1/3, ")
    assert task.description.endswith("s left, B 21, T 200/200")
    assert 0 < task.completed < task.total == pytest.approx(44.2, abs=0.1)
    host.stopping = Stopping(orderly=True, within=60.0, now=0.0)
    assert "Ctrl-C again" in shown._stopping()
    host.stopping.hurry(0.0)
    assert shown._stopping() == "gcodectl: making the printer safe"
    host.failure = CancelledError("x")
    shown.close()
    pipe = Job("-", None, None, 0.0, None)
    shown = Shown(pipe, host, as_json=False)
    assert shown._bar.tasks[0].total is None
    shown.turn()
    assert shown._bar.tasks[0].description.startswith("line 60, ")
    shown.close()


def test_what_was_killed_says_so_and_resumes(stream: Stream, part: Path, tmp_path: Path) -> None:
    job = jobs.prepare(str(part), "syringe", None)
    path = journal.journal_path(part, {"XDG_STATE_HOME": str(tmp_path / "state")})
    entry = journal.Entry(str(part), journal.digest(part, job.how()), 60, job.lines, 0.0, ended=False)
    journal.write(path, entry)
    with Printer(tmp_path / "printer", faults="cancel@1006") as printer:
        ended = stream(part, "--resume", "--yes", "--port", printer.port)
    assert ended.status == 130
    assert "It was killed: what it sent in the last 1 s or so would come twice." in ended.said
    [now] = entries(tmp_path)
    assert (now["line"], now["ended"]) == (60, True)  # it was stopped before the job itself went on


def test_a_file_without_moves_has_no_time(tmp_path: Path) -> None:
    path = tmp_path / "x.gcode"
    path.write_bytes(b"M104 S0\n")
    job = jobs.prepare(str(path), "syringe", None)
    assert job.timeline is not None
    assert job.timeline.total in (0.0, pytest.approx(0.0))
    assert job.timeline.at(0) == 0


def test_a_material_says_what_a_stop_pulls_back() -> None:
    from gcodectl.cli.common import filter_options

    options = filter_options(str(BOX), "syringe", ["clay"], "model", "BALANCED", "replace", pass_unknown=False)
    job = Job(str(BOX), None, None, jobs._stored(options), options)
    assert 0 < job.pull_back < jobs.MOST_PULL
    assert job.how() != Job(str(BOX), None, None, 0.0, None).how() == "plain"
