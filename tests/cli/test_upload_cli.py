"""`gcodectl upload` from outside."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from loopback import Heard, serving

KEY = "s3cret"


def run(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "gcodectl.cli.main", "upload", *map(str, arguments)],
        capture_output=True, text=True, timeout=60, check=False, env={**os.environ, **environment},
    )  # fmt: skip


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    path = tmp_path / "cube.gcode"
    path.write_text("G28\n")
    return path


def test_one_json_object_and_the_key_from_the_environment(cube: Path):
    with serving(Heard()) as heard:
        done = run(cube, "--moonraker", heard.url, "--print", "--json", GCODECTL_API_KEY=KEY)
    assert (done.returncode, done.stderr) == (0, "")
    said = json.loads(done.stdout)
    assert (said["path"], said["bytes"], said["checked"], said["print_started"]) == ("cube.gcode", 4, True, True)
    assert heard.got["X-Api-Key"] == KEY
    assert KEY not in done.stdout


def test_a_line_for_people_and_a_key_file_open_to_all(cube: Path, tmp_path: Path):
    key = tmp_path / "key"
    key.write_text(KEY)
    key.chmod(0o644)
    with serving(Heard()) as heard:
        done = run(cube, "--moonraker", heard.url, "--api-key-file", key)
    assert done.returncode == 0
    assert done.stdout.startswith("cube.gcode: on Moonraker at http://127.0.0.1:")
    assert "chmod 600" in done.stderr
    assert KEY not in done.stdout + done.stderr


def test_a_print_that_did_not_begin_is_a_failure(cube: Path):
    answer = b'{"item": {"path": "cube.gcode"}, "print_started": false}'
    with serving(Heard(answer=answer)) as heard:
        done = run(cube, "--moonraker", heard.url, "--print")
    assert done.returncode == 5
    assert "did not begin to print" in done.stderr


def test_a_refusal_is_one_sentence_without_the_key(cube: Path):
    with serving(Heard(status=401, answer=b"")) as heard:
        done = run(cube, "--octoprint", heard.url, OCTOPRINT_API_KEY=KEY)
    assert done.returncode == 5
    assert done.stderr.count("\n") == 1
    assert "OCTOPRINT_API_KEY" in done.stderr
    assert KEY not in done.stderr


@pytest.mark.parametrize("where", [(), ("--moonraker", "http://a", "--octoprint", "http://b")])
def test_one_host_must_be_named(cube: Path, where: tuple[str, ...]):
    done = run(cube, *where)
    assert done.returncode == 2
    assert "one of them" in done.stderr
