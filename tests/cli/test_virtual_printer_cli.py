"""`gcodectl virtual-printer` from outside."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial
import typer
from typer.testing import CliRunner

from gcodectl.cli import virtual_printer
from gcodectl.errors import InputError, UsageError
from gcodectl.link.wire import numbered

app = typer.Typer()
app.command("virtual-printer")(virtual_printer.command)
PATIENCE = 120.0
"""s; kernels may have to be compiled first."""
PART = "G28\nG21\nG90\nM83\nG1 Z.6 F600\nG1 X0 Y0 F2400\nG1 F600\nG1 X20 E.055\nG1 Y20 E.055\nG1 X0 E.055\n"


def run(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(one) for one in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


class Host(threading.Thread):
    """Sends lines to a port as soon as it is there, and leaves."""

    def __init__(self, path: Path, lines: list[bytes]) -> None:
        super().__init__()
        self.path, self.lines, self.said = path, lines, b""

    def run(self) -> None:
        waiting = threading.Event()
        for _ in range(int(PATIENCE / 0.02)):
            if self.path.is_symlink():
                break
            waiting.wait(0.02)
        with serial.Serial(str(self.path), timeout=30.0) as port:
            for number, line in enumerate(self.lines):
                port.write(numbered(number, line))
                while True:
                    said = port.readline()
                    self.said += said
                    if not said or said.startswith(b"ok"):
                        break


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "printer"


def serve(link: Path, lines: list[bytes], *options: object) -> tuple[str, bytes]:
    host = Host(link, lines)
    host.start()
    output = run("--machine", "syringe", "--link", link, "--speed", "max", "--once", *options)
    host.join(PATIENCE)
    return output, host.said


def lines_of(path: Path) -> Iterator[bytes]:
    yield b"M110 N0"
    for line in path.read_bytes().splitlines():
        text = line.partition(b";")[0].strip()
        if text:
            yield text
    yield b"M400"


def test_a_part_is_printed_scored_and_reported(link: Path, tmp_path: Path):
    part, report, log = tmp_path / "part.gcode", tmp_path / "report", tmp_path / "log.txt"
    part.write_text(PART)
    lines = [*lines_of(part), b"M118 P0 SCORE"]
    output, said = serve(link, lines, "--plant", "paste-a", "--report", report, "--target", part, "--log", log)
    assert f"{len(lines)} commands executed, rmse" in output
    assert b"SCORE\necho:" in said
    assert (report / "executed.gcode").read_bytes() == b"".join(line + b"\n" for line in lines)
    assert json.loads((report / "score.json").read_text())["rmse"] > 0
    assert "0.000000 < N0 M110 N0*" in log.read_text()
    assert " > ok\\n\n" in log.read_text()


def test_without_a_report_it_counts(link: Path):
    output, said = serve(link, [b"M110 N0", b"M105"], "--advanced-ok", "--no-greeting", "--no-emergency-parser")
    assert f"a printer is at {link}" in output
    assert "2 commands executed\n" in output
    assert said.startswith((b"ok P15 B3\nok T:", b"ok N0 P15 B3\nok T:"))


def test_faults_strike_and_are_listed(link: Path):
    _, said = serve(link, [b"M110 N0", b"M117"], "--faults", "checksum@1", "--seed", "3")
    assert b"Resend: 1\n" in said
    listed = run("--machine", "syringe", "--faults", "help")
    assert "slow-ok=0.5 " in listed
    assert "; the printer is dead" in listed


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ((), "--link PATH and --tcp"),
        (("--link", "a", "--tcp", "5000"), "--link PATH and --tcp"),
        (("--tcp", "host:port"), "5000"),
        (("--tcp", ":70000"), "5000"),
        (("--tcp", "0", "--speed", "fast"), "--speed"),
        (("--tcp", "0", "--speed", "-1"), "--speed"),
        (("--tcp", "0", "--faults", "nothing@1"), "there are"),
        (("--tcp", "0", "--queue", "0"), "places"),
        (("--tcp", "0", "--junction", "round"), "junction"),
        (("--tcp", "0", "--plant", "paste-a"), "--report"),
        (("--tcp", "0", "--plant", "jam", "--report", "."), "jam"),
        (("--tcp", "0", "--target", "no/such.gcode"), "no such file"),
    ],
)
def test_a_wrong_call_is_refused(options: tuple[str, ...], why: str):
    with pytest.raises((UsageError, InputError), match=why):
        run("--machine", "syringe", *options)


def test_a_tcp_port_is_this_machines_alone_unless_told_otherwise():
    for told, host in (("0", "127.0.0.1"), (":0", "127.0.0.1"), ("0.0.0.0:0", "0.0.0.0"), ("[::1]:0", "::1")):
        port = virtual_printer._port(None, told)
        assert (port.host, port.port) == (host, 0)  # type: ignore[union-attr]


CORPUS = os.environ.get("GCODECTL_CORPUS", "")


@pytest.mark.skipif(not CORPUS, reason="GCODECTL_CORPUS does not say where the corpus is")
def test_a_corpus_file_is_executed_line_by_line(link: Path, tmp_path: Path):
    lines = list(lines_of(Path(CORPUS) / "pellet_box_prusaslicer.gcode"))
    report = tmp_path / "report"
    serve(link, lines, "--report", report)
    assert (report / "executed.gcode").read_bytes().splitlines() == lines
