"""`gcodectl stream` as a process: pipes, signals, and an end in the middle of the night."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from filtering import DATA
from streaming import PATIENCE, Printer

from gcodectl.link.job import read_lines

BOX = DATA / "box_abs.gcode"
ROOT = Path(__file__).parents[2]
COMMAND = [sys.executable, "-m", "gcodectl.cli.main"]
Start = Callable[..., "subprocess.Popen[bytes]"]


@pytest.fixture
def start(tmp_path: Path) -> Start:
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith("SLIC3R_")},
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
        "XDG_STATE_HOME": str(tmp_path / "state"),
    }

    def started(*words: object, **more: object) -> subprocess.Popen[bytes]:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **more}
        return subprocess.Popen([*COMMAND, *map(str, words)], env=environment, **pipes)  # type: ignore[call-overload]

    return started


@pytest.fixture
def printer(tmp_path: Path) -> Printer:
    return Printer(tmp_path / "printer", keepalive=0.0)


def until(process: subprocess.Popen[bytes], line: int) -> None:
    """Read events until the printer has acknowledged `line`."""
    assert process.stdout is not None
    for text in process.stdout:
        if json.loads(text).get("line", 0) >= line:
            return
    pytest.fail("it ended before")


def begun(start: Start, printer: Printer) -> subprocess.Popen[bytes]:
    """Have an endless pipe printed, and wait until its third line is acknowledged."""
    process = start("stream", "-", "--port", printer.port, "--json")
    assert process.stdin is not None
    process.stdin.write(b"G28\nM104 S200\nG1 X1 F600\n")
    process.stdin.flush()
    until(process, 3)
    return process


def test_a_pipe_that_never_ends_is_printed_line_by_line_and_ctrl_c_ends_it(start: Start, printer: Printer) -> None:
    with printer:
        process = begun(start, printer)
        process.send_signal(signal.SIGINT)  # while it waits for standard input
        assert process.stdout is not None
        assert process.stderr is not None
        *_, last = process.stdout
        said = process.stderr.read()
        assert process.wait(PATIENCE) == 130
        assert process.stdin is not None
        process.stdin.close()
    assert json.loads(last)["safe"] is True
    assert said == b"gcodectl: stopped by you\n"
    assert printer.done[-4:] == [b"M104 S0", b"M140 S0", b"M107", b"M105"]


def test_a_filter_can_stand_before_it(start: Start, printer: Printer) -> None:
    with printer:
        before = start("filter", BOX)
        process = start("stream", "-", "--port", printer.port, stdin=before.stdout)
        _, said = process.communicate(timeout=PATIENCE)
        before.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert said.startswith(b"gcodectl: printed in")
    assert printer.moves == [one.command for one in read_lines([BOX.read_bytes()]) if one.command.startswith(b"G1 X")]


def test_a_reader_that_leaves_does_not_end_the_print(start: Start, printer: Printer) -> None:
    with printer:
        process = start("stream", BOX, "--port", printer.port, "--json")
        assert process.stdout is not None
        process.stdout.readline()
        process.stdout.close()
        process.stdout = None
        _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert b"Traceback" not in said
    assert printer.done[-1] == b"M105"


def test_what_was_killed_is_resumed(start: Start, tmp_path: Path) -> None:
    part = tmp_path / "part.gcode"
    part.write_bytes(b"G28\nG90\n" + b"".join(b"G1 X%d F600\n" % (k % 50) for k in range(200)))
    with Printer(tmp_path / "one", faults="dead@1100", keepalive=0.0) as first:
        process = start("stream", part, "--port", first.port, "--json")
        until(process, 2)
        process.kill()
        process.wait(PATIENCE)
    [path] = (tmp_path / "state" / "gcodectl").glob("*.json")
    entry = json.loads(path.read_text())
    assert entry["ended"] is False
    assert 1 <= entry["line"] <= len(first.done)
    with Printer(tmp_path / "two") as second:
        process = start("stream", part, "--port", second.port, "--resume", "--yes")
        _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert b"It was killed" in said
    assert b"G28" not in second.done
    assert len(second.moves) == 200 - max(entry["line"] - 2, 0)


def test_it_is_light_until_it_is_called() -> None:
    code = (
        "import sys; from gcodectl.cli.lazy import COMMANDS, LazyGroup; from gcodectl.cli.main import app\n"
        "made = [LazyGroup().get_command(None, name).get_short_help_str() for name in COMMANDS]\n"
        "assert all(made), made\n"
        "print(sorted({'numpy', 'rich', 'numba', 'serial'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, check=True
    )
    assert done.stdout.strip() == b"[]"
