"""The first run compiles all that check, tasks and filter call; none after it needs numba, nor compiles."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from filtering import DATA

from gcodectl.cli.compiling import run_all

ROOT = Path(__file__).parents[2]
CALL = """import sys
sys.argv = ["gcodectl", *sys.argv[1:]]
from gcodectl.cli.main import run
try:
    run()
finally:
    print(sorted({"numba", "scipy", "ruckig", "matplotlib", "cv2", "serial"} & set(sys.modules)), file=sys.stderr)"""


@pytest.mark.parametrize("words", [
    ("check", "--json"), ("tasks", "--csv"), ("filter",), ("filter", "--material", "clay"),
], ids=" ".join)  # fmt: skip
def test_a_run_after_the_first_is_light(words: tuple[str, ...]) -> None:
    run_all()  # what the first run does
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "-c", CALL, words[0], str(DATA / "arcs_rel.gcode"), *words[1:]]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1] == "[]", done.stderr
    assert "compiling" not in done.stderr
    if words[0] == "check":
        found = json.loads(done.stdout)
        assert sum(found["time_by_type"].values()) == pytest.approx(found["time_s"])
        assert sum(found["time_by_layer"].values()) == pytest.approx(found["time_s"])
