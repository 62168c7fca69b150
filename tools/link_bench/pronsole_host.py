"""pronsole driven as at a terminal: a command in, and what it says until the next may follow."""

from __future__ import annotations

import queue
import re
import shutil
import subprocess
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

from link_bench.peers import FINISHED, HANG, end, environment

_ERROR = re.compile(r"(?!.*DBus).*(error|can't|could not|traceback)", re.IGNORECASE)


def run(port: str, file: Path, timeout: float) -> tuple[str, tuple[str, ...]]:
    """Connect, load, print, leave; returns how it ended and what it complained of."""
    program = shutil.which("pronsole")
    assert program, "tools/peers.sh installs it"
    with tempfile.TemporaryDirectory() as home:
        process = subprocess.Popen(
            [program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            errors="replace", start_new_session=True, env=environment(home), cwd=home,
        )  # fmt: skip
        said: queue.Queue[str] = queue.Queue()
        assert process.stdout
        threading.Thread(target=_listen, args=(process.stdout, said), daemon=True).start()
        talk = _Talk(process, said, time.monotonic() + timeout)
        try:
            talk.say(f"connect {port} 115200")
            if not talk.hear("now online"):
                return talk.failed(), talk.errors
            talk.say(f"load {file}")
            talk.hear("Loaded")
            talk.say("print")
            if not talk.hear("Print ended at"):
                return talk.failed(), talk.errors
            talk.say("exit")
            return FINISHED, talk.errors
        finally:
            with suppress(subprocess.TimeoutExpired):
                process.wait(5)
            end(process)


def _listen(out: IO[str], said: queue.Queue[str]) -> None:
    for line in out:
        said.put(line)


class _Talk:
    """What was said, and what is waited for."""

    def __init__(self, process: subprocess.Popen[str], said: queue.Queue[str], until: float) -> None:
        self._process, self._said, self._until = process, said, until
        self._errors: list[str] = []

    @property
    def errors(self) -> tuple[str, ...]:
        """What it complained of."""
        return tuple(self._errors)

    def failed(self) -> str:
        """How it ended where it did not finish."""
        return HANG if self._process.poll() is None else f"ended by itself with status {self._process.returncode}"

    def say(self, command: str) -> None:
        """Type a command."""
        assert self._process.stdin
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()

    def hear(self, text: str) -> bool:
        """Wait for a line with `text` in it; False where the time is over or the program has ended."""
        while (left := self._until - time.monotonic()) > 0:
            try:
                line = self._said.get(timeout=min(left, 0.2))
            except queue.Empty:
                if self._process.poll() is not None:
                    return False
                continue
            if _ERROR.match(line):
                self._errors.append(line.strip())
            if text in line:
                return True
        return False
