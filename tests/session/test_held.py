"""One command at a time on a session's folder."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from gcodectl.errors import InputError, UsageError
from gcodectl.session.held import held


def test_a_folder_is_held_once_and_free_again(tmp_path: Path):
    with held(tmp_path):
        with pytest.raises(UsageError, match="another command works on"), held(tmp_path):
            pass
        with pytest.raises(UsageError):
            held(tmp_path).__enter__()
    with held(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


def test_a_command_that_died_holds_nothing(tmp_path: Path):
    holder = (
        "import sys, pathlib; from gcodectl.session.held import held; lock = held(pathlib.Path(sys.argv[1]));"
        "lock.__enter__(); print('held', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", holder, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        with pytest.raises(UsageError), held(tmp_path):
            pass
        process.kill()
        process.wait()
    with held(tmp_path):
        pass


def test_no_folder_is_no_session(tmp_path: Path):
    with pytest.raises(InputError, match="learn start"), held(tmp_path / "none"):
        pass
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="holds no session"), held(tmp_path / "file"):
        pass
