"""The command line, run in this process."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest
from streaming import Ended, Stream

from gcodectl.cli import main


@pytest.fixture
def stream(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Stream:
    """Run `gcodectl stream` here, with a state folder of its own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))

    def run(*words: object, stdin: bytes | None = None) -> Ended:
        monkeypatch.setattr(sys, "argv", ["gcodectl", "stream", *map(str, words)])
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin or b"")))
        capfd.readouterr()
        status: object = 0
        try:
            main.run()
        except SystemExit as end:
            status = end.code
        out, said = capfd.readouterr()
        assert isinstance(status, int)
        return Ended(status, out, said)

    return run
