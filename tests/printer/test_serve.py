"""The virtual printer on a pty and on a TCP port: hosts come, go, come back; time is real or jumps."""

from __future__ import annotations

import math
import os
import signal
import socket
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import serial
from printing_hosts import printer

from gcodectl.errors import NoPortError, UsageError
from gcodectl.link.wire import numbered
from plant_models.printer.ports import Port, TcpPort
from plant_models.printer.pty_port import PtyPort
from plant_models.printer.serve import Server
from plant_models.printer.virtual import VirtualPrinter

PATIENCE = 30.0


@contextmanager
def serving(one: VirtualPrinter, port: Port, speed: float = math.inf, once: bool = False) -> Iterator[threading.Thread]:
    """Serve in a thread; stop it at the end."""
    ready, finished = threading.Event(), []
    server = Server(one, port, speed=speed, once=once)
    thread = threading.Thread(target=server.run, kwargs={"finish": finished.append, "ready": ready.set})
    thread.start()
    try:
        assert ready.wait(PATIENCE)
        yield thread
    finally:
        server.stop()
        thread.join(PATIENCE)
    assert not thread.is_alive()
    assert finished == [one]
    assert not port.is_open


@contextmanager
def host(port: Port) -> Iterator[serial.SerialBase]:
    with serial.serial_for_url(port.name, timeout=PATIENCE) as one:
        yield one


def print_lines(one: serial.SerialBase, first: int, last: int, text: bytes = b"G1 X%d") -> None:
    for k in range(first, last + 1):
        one.write(numbered(k, text % k if b"%" in text else text))
        while (line := one.readline()) != b"ok\n":
            assert line.startswith((b"echo:busy", b" T:", b"X:")), line


@pytest.fixture(params=["pty", "tcp"])
def port(request: pytest.FixtureRequest, tmp_path: Path) -> Port:
    return PtyPort(tmp_path / "printer") if request.param == "pty" else TcpPort("127.0.0.1", 0)


def test_a_job_goes_through_and_a_host_may_come_back(port: Port):
    one = printer()
    with serving(one, port):
        with host(port) as first:
            print_lines(first, 1, 40)
            print_lines(first, 41, 41, b"M400")
        with host(port) as second:
            print_lines(second, 42, 60)
            print_lines(second, 61, 61, b"M109 S60")
    assert [e.number for e in one.executed] == list(range(1, 62))
    assert one.now > 40.0


def test_the_clock_that_jumps_stands_still_while_lines_come(port: Port):
    one = printer()
    with serving(one, port), host(port) as there:
        print_lines(there, 1, 16)
        assert one.now == 0.0
        print_lines(there, 17, 20)
        assert 4.0 <= one.now < 5.0


def test_what_is_left_in_the_buffer_goes_on_when_nobody_sends(port: Port):
    one = printer()
    with serving(one, port), host(port) as there:
        print_lines(there, 1, 3)
        there.write(b"M155 S7\n")
        assert there.readline() == b"ok\n"
        assert [there.readline()[:3] for _ in range(3)] == [b" T:"] * 3
        assert one.motion.idle


def test_real_time_may_be_faster(port: Port):
    one = printer()
    with serving(one, port, speed=500.0), host(port) as there:
        print_lines(there, 1, 20)
        print_lines(there, 21, 21, b"M109 S60")
        assert one.now > 15.0


def test_once_ends_when_the_host_has_gone(port: Port):
    one = printer()
    with serving(one, port, once=True) as thread:
        with host(port) as there:
            print_lines(there, 1, 1)
        thread.join(PATIENCE)
        assert not thread.is_alive()


def test_a_port_that_is_lost_comes_back(port: Port):
    one = printer("close=0.01@2")
    with serving(one, port):
        with host(port) as there:
            print_lines(there, 1, 1)
            there.write(numbered(2, b"M117"))
            assert _gone(there)
        again = _patiently(port)
        with again:
            print_lines(again, 3, 3)
    assert [e.number for e in one.executed] == [1, 2, 3]


def _gone(there: serial.SerialBase) -> bool:
    """Read until the port says that it is lost; each kind of port does so in its own way."""
    try:
        return there.read(1) == b""
    except (serial.SerialException, OSError):
        return True


def _patiently(port: Port) -> serial.SerialBase:
    """Open the port as soon as it is back."""
    waiting = threading.Event()
    for _ in range(int(PATIENCE / 0.02)):
        try:
            return serial.serial_for_url(port.name, timeout=PATIENCE)
        except (serial.SerialException, OSError):
            waiting.wait(0.02)
    raise AssertionError("the port did not come back")


def test_a_pty_is_a_raw_terminal_with_a_link_that_goes_away(tmp_path: Path):
    port = PtyPort(tmp_path / "printer")
    with port:
        assert port.link.is_symlink()
        assert stat.S_ISCHR(port.link.stat().st_mode)
        slave = os.open(port.link, os.O_RDWR | os.O_NOCTTY)
        os.write(slave, b"M105\n\x03\x04")
        assert port.read() == b"M105\n\x03\x04"
        assert port.read() == b""
        os.close(slave)
        assert port.read() == b""
        assert port.left
        assert port.deaf
        slave = os.open(port.link, os.O_RDWR | os.O_NOCTTY)
        os.write(slave, b"M114\n")
        assert port.read() == b"M114\n"
        os.close(slave)
        assert port.write(b"nobody is there") == 15
    assert not port.link.is_symlink()
    port.close()


def test_a_pty_keeps_its_hands_off_what_is_not_its_own(tmp_path: Path):
    path = tmp_path / "printer"
    path.write_text("a file")
    with pytest.raises(UsageError, match="there already"):
        PtyPort(path).open()
    with pytest.raises(UsageError, match="no folder"):
        PtyPort(tmp_path / "no" / "printer").open()
    path.unlink()
    path.symlink_to("/dev/pts/no-such-terminal")
    with PtyPort(path) as port:
        port.link.unlink()
        port.link.symlink_to("/dev/null")
    assert path.is_symlink()


def test_a_pty_that_is_not_read_takes_no_more(tmp_path: Path):
    with PtyPort(tmp_path / "printer") as port:
        assert sum(port.write(b"x" * 4096) for _ in range(64)) < 64 * 4096


def test_a_second_tcp_host_is_turned_away():
    port = TcpPort("127.0.0.1", 0)
    with serving(printer(), port), host(port) as first:
        print_lines(first, 1, 1)
        with socket.create_connection((port.host, port.port), timeout=PATIENCE) as second:
            assert second.recv(100) == b""
        print_lines(first, 2, 2)


def test_an_address_that_is_taken_is_no_port():
    with TcpPort("127.0.0.1", 0) as port, pytest.raises(NoPortError, match="cannot listen"):
        TcpPort("127.0.0.1", port.port).open()


def test_bytes_are_noted_with_their_times(tmp_path: Path):
    noted: list[tuple[float, str, bytes]] = []
    port = PtyPort(tmp_path / "printer")
    ready = threading.Event()
    server = Server(printer(), port, speed=math.inf, once=True, log=lambda *one: noted.append(one))
    thread = threading.Thread(target=server.run, kwargs={"ready": ready.set})
    thread.start()
    assert ready.wait(PATIENCE)
    with host(port) as there:
        print_lines(there, 1, 1, b"M117 a")
    thread.join(PATIENCE)
    assert noted == [(0.0, "<", numbered(1, b"M117 a")), (0.0, ">", b"ok\n")]
    server.stop()  # too late, and harmless


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_and_is_given_back(tmp_path: Path, number: signal.Signals):
    before = signal.getsignal(number)
    port = PtyPort(tmp_path / "printer")
    Server(printer(), port).run(ready=lambda: os.kill(os.getpid(), number))
    assert signal.getsignal(number) is before
    assert not port.link.is_symlink()


def test_a_tcp_host_that_does_not_read_or_breaks_off_does_no_harm():
    with TcpPort("127.0.0.1", 0) as port:
        assert port.write(b"nobody is there") == 0
        assert port.fileno() == port.readers()[0]
        host = socket.create_connection((port.host, port.port), timeout=PATIENCE)
        while not port.there:
            assert port.read() == b""
        assert port.read() == b""
        assert port.fileno() == port.readers()[1]
        while port.write(b"x" * 65_536):
            pass
        host.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # closing breaks off at once
        host.close()
        while port.there:
            assert port.read() == b""
        assert port.left
        assert port.deaf


def test_a_quiet_pty_reads_as_nothing_and_one_without_a_host_swallows(tmp_path: Path):
    with PtyPort(tmp_path / "printer") as port:
        assert port.read() == b""
        assert port.there
        assert not port.deaf
        slave = os.open(port.link, os.O_RDWR | os.O_NOCTTY)
        os.write(slave, b"x")
        assert port.read() == b"x"
        os.close(slave)
        assert port.write(b"y") == 1  # its own hand is off, and the host has gone
