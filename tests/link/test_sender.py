"""The sender on a port: a scripted one, and a real pty with a virtual printer behind it."""

import io
import os
import threading
import tty
from collections.abc import Callable
from pathlib import Path

import pytest
from duels import MACHINE, job_of

from gcodectl.errors import CancelledError, DisconnectedError, NoPortError
from gcodectl.link import transport
from gcodectl.link.host import Host
from gcodectl.link.sender import Log, Sender
from gcodectl.link.settings import Settings
from plant_models.printer.virtual import VirtualPrinter


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Plugged:
    """A port with a virtual printer on it, whose time passes as the sender waits."""

    def __init__(self, printer: VirtualPrinter, clock: Clock) -> None:
        self.printer, self.clock, self.closed = printer, clock, False
        self.lost_at = 1e9

    def read(self, timeout: float) -> bytes:
        if self.clock.now >= self.lost_at:
            raise DisconnectedError("pulled out")
        data = self.printer.transmit()
        if not data:
            self.clock.now += max(timeout, 1e-4)
            self.printer.advance(self.clock.now)
        return data or self.printer.transmit()

    def write(self, data: bytes) -> None:
        self.clock.now += 1e-4
        self.printer.receive(data, self.clock.now)

    def close(self) -> None:
        self.closed = True


def made(count: int, **settings: float) -> tuple[Host, VirtualPrinter, Clock, Plugged]:
    clock = Clock()
    printer = VirtualPrinter(MACHINE)
    return Host(job_of(count), Settings(**settings), clock()), printer, clock, Plugged(printer, clock)  # type: ignore[arg-type]


def test_a_job_goes_down_the_port_and_the_log_has_both_ways() -> None:
    host, printer, clock, port = made(20)
    turns: list[float] = []
    file = io.BytesIO()
    Sender(host, lambda: port, log=Log(file), on_turn=lambda: turns.append(clock()), clock=clock).run()
    assert host.failure is None
    assert [one.text for one in printer.executed if one.text.startswith(b"G1")] == [
        one.command for one in job_of(20)[1:]
    ]
    assert port.closed
    assert len(turns) >= 2
    lines = [line.split(b" ", 2) for line in file.getvalue().splitlines()]
    assert {way for _, way, _ in lines} == {b">", b"<"}
    times = [float(time) for time, _, _ in lines]
    assert times == sorted(times)
    assert times[0] == 0.0
    assert sum(way == b">" and b"G1 X" in text for _, way, text in lines) == 20


@pytest.mark.parametrize("times", [1, 2])
def test_once_stops_in_good_order_and_twice_at_once(times: int) -> None:
    host, printer, clock, port = made(10_000)
    turns = 0

    def turn() -> None:
        nonlocal turns
        turns += 1
        if turns == 3:
            for _ in range(times):
                sender.cancel()
                sender._cancel(clock())

    sender = Sender(host, lambda: port, clock=clock, on_turn=turn)
    sender.run()
    assert isinstance(host.failure, CancelledError)
    assert printer.alive is (times == 1)
    assert host.safe is (times == 1)


def test_a_port_that_comes_back_is_used_to_make_the_printer_safe(monkeypatch: pytest.MonkeyPatch) -> None:
    host, printer, clock, port = made(10_000)
    port.lost_at = 100.5
    opened = 0

    def sleep(seconds: float) -> None:
        clock.now += seconds

    def reopen() -> Plugged:
        nonlocal opened
        opened += 1
        if opened == 2:
            raise NoPortError("not yet")
        if opened > 2:
            port.lost_at = 1e9
        return port

    monkeypatch.setattr("gcodectl.link.sender.time.sleep", sleep)
    Sender(host, reopen, clock=clock).run()
    assert isinstance(host.failure, DisconnectedError)
    assert "pulled out" in str(host.failure)
    assert opened == 3
    assert host.safe
    assert [one.text for one in printer.executed][-4:-1] == [b"M108", b"M104 S0", b"M140 S0"]


def test_a_port_that_cannot_be_opened_says_which_there_are(tmp_path: Path) -> None:
    with pytest.raises(NoPortError, match=r"cannot open .*nothing.*the serial ports here"):
        transport.open_port(str(tmp_path / "nothing"), 115200)
    with pytest.raises(NoPortError, match="cannot open socket"):
        transport.open_port("socket://127.0.0.1:1", 115200)
    with pytest.raises(NoPortError, match="cannot open foo"):
        transport.open_port("foo://bar", 115200)


class Found:
    def __init__(self, device: str, vid: int | None) -> None:
        self.device, self.vid, self.description = device, vid, f"a {device}"


@pytest.mark.parametrize(
    ("ports", "found"),
    [
        ([Found("/dev/ttyS0", None), Found("/dev/ttyACM0", 0x2341)], "/dev/ttyACM0"),
        ([Found("COM3", None)], "COM3"),
        ([], "no serial port"),
        ([Found("a", 1), Found("b", 2)], "several.*a.*b"),
    ],
)
def test_the_port_is_found_where_there_is_one(monkeypatch: pytest.MonkeyPatch, ports: list[Found], found: str) -> None:
    monkeypatch.setattr(transport, "_ports", lambda: ports)
    if found in {one.device for one in ports}:
        assert transport.find_port() == found
    else:
        with pytest.raises(NoPortError, match=found):
            transport.find_port()


def read_on(port: transport.Port) -> None:
    for _ in range(transport.EMPTY):
        assert port.read(30.0) == b""


def pour(port: transport.Port) -> None:
    for _ in range(1000):
        port.write(b"x" * 4096)


def test_a_pty_is_read_written_and_found_closed() -> None:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    port = transport.open_port(os.ttyname(theirs), 115200)
    port.write(b"M105\n")
    assert os.read(ours, 100) == b"M105\n"
    assert port.read(0.0) == b""
    os.write(ours, b"ok\n")
    assert port.read(30.0) == b"ok\n"
    os.close(theirs)
    os.close(ours)
    with pytest.raises(DisconnectedError, match=r"was lost|was closed"):
        read_on(port)
    with pytest.raises(DisconnectedError):
        pour(port)
    port.close()


def test_a_port_that_takes_nothing_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "STUCK", 0.05)
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    port = transport.open_port(os.ttyname(theirs), 115200)
    with pytest.raises(DisconnectedError, match="takes nothing"):
        pour(port)
    port.close()
    os.close(ours)
    os.close(theirs)


class NoDescriptor:
    """A port that only pyserial can read, as rfc2217 is."""

    in_waiting = 0
    timeout = 0.0

    def __init__(self) -> None:
        self.written = b""
        self.fails = False

    def read(self, size: int) -> bytes:
        if self.fails:
            raise OSError("gone")
        return b"ok\n"[:size]

    def write(self, data: bytes) -> None:
        self.written += data

    def close(self) -> None:
        self.written += b"closed"


def test_a_port_without_a_descriptor_goes_through_pyserial() -> None:
    inner = NoDescriptor()
    port = transport.Port(inner, "rfc2217://x")
    port.write(b"M105\n")
    assert port.read(0.5) == b"o"
    assert inner.timeout == 0.5
    inner.fails = True
    with pytest.raises(DisconnectedError, match="rfc2217://x was lost: gone"):
        port.read(0.5)
    port.close()
    assert inner.written == b"M105\nclosed"


def test_a_socket_is_a_port() -> None:
    import socket

    server = socket.create_server(("127.0.0.1", 0))
    said: list[bytes] = []

    def answer(accept: Callable[[], tuple[socket.socket, object]] = server.accept) -> None:
        with accept()[0] as client:
            said.append(client.recv(100))
            client.sendall(b"ok\n")

    thread = threading.Thread(target=answer)
    thread.start()
    port = transport.open_port(f"socket://127.0.0.1:{server.getsockname()[1]}", 115200)
    port.write(b"M105\n")
    assert port.read(30.0) == b"ok\n"
    with pytest.raises(DisconnectedError, match="closed by the other side"):
        read_on(port)
    thread.join(30)
    assert said == [b"M105\n"]
    port.close()
    server.close()


def test_two_at_once_are_twice() -> None:
    host, printer, clock, port = made(10_000)

    def turn() -> None:
        if host.reached > 3:
            sender.cancel()
            sender.cancel()

    sender = Sender(host, lambda: port, clock=clock, on_turn=turn)
    sender.run()
    assert not printer.alive


def test_who_does_not_insist_asks_once() -> None:
    host, printer, clock, port = made(10_000)
    sender = Sender(
        host, lambda: port, clock=clock, on_turn=lambda: sender.cancel(insist=False) if host.reached else None
    )
    sender.run()
    assert isinstance(host.failure, CancelledError)
    assert printer.alive
    assert host.safe


class Full(io.BytesIO):
    """A disk that takes no more."""

    def write(self, _: object) -> int:
        raise OSError(28, "full")


class Late(io.BytesIO):
    """A disk that says so when the buffer is written out."""

    def flush(self) -> None:
        raise OSError(28, "full")


@pytest.mark.parametrize("file", [Full(), Late()])
def test_a_log_that_cannot_be_written_is_given_up(file: io.BytesIO) -> None:
    host, printer, clock, port = made(20)
    Sender(host, lambda: port, log=Log(file), clock=clock).run()
    assert host.failure is None
    assert sum("the log cannot be written" in note for note in host.notes) == 1
    assert len(printer.executed) > 20


def test_a_fault_of_ours_switches_the_heaters_off_and_closes_the_port() -> None:
    host, printer, clock, port = made(10_000)

    def turn() -> None:
        if host.reached > 3:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        Sender(host, lambda: port, clock=clock, on_turn=turn).run()
    printer.advance(clock.now + 10)
    assert port.closed
    assert [one.text for one in printer.executed][-2:] == [b"M104 S0", b"M140 S0"]


def test_a_port_is_for_one_alone() -> None:
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    port = transport.open_port(os.ttyname(theirs), 115200)
    with pytest.raises(NoPortError, match="another program has it open"):
        transport.open_port(os.ttyname(theirs), 115200)
    port.close()
    transport.open_port(os.ttyname(theirs), 115200).close()
    os.close(ours)
    os.close(theirs)
