"""The whole way: a slicer, gcodectl as its post-processing script, the streamer, a virtual printer with an extruder."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from data.make_parts import box, slice_part, slicer_words

ROOT = Path(__file__).resolve().parent.parent.parent
COMMAND = [sys.executable, "-m", "gcodectl.cli.main"]
PLANT = "paste-a"
LIMIT = 300


def gcodectl(*arguments: object, folder: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(folder / "state")}
    done = subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=LIMIT, env=environment, check=True
    )
    return done.stdout


@pytest.mark.skipif(shutil.which("prusa-slicer") is None, reason="prusa-slicer is not installed")
def test_what_is_streamed_is_what_was_simulated(tmp_path: Path) -> None:
    hook, part, original = tmp_path / "hook", tmp_path / "part.gcode", tmp_path / "original.gcode"
    hook.write_text(
        f'#!/bin/sh\ncp "$1" {original}\n'
        f'PYTHONPATH={ROOT} exec {" ".join(COMMAND)} filter --in-place --material {PLANT} "$1"\n'
    )
    hook.chmod(0o755)
    slice_part(box(), [*slicer_words({}), f"--post-process={hook}"], part, height=1.2)
    wanted = json.loads(
        gcodectl(
            "simulate", part, "--target", original, "--machine", "syringe", "--plant", PLANT, "--json", folder=tmp_path
        )
    )
    port, report = tmp_path / "port", tmp_path / "report"
    printer = subprocess.Popen(
        [
            *COMMAND, "virtual-printer", "--machine", "syringe", "--link", str(port), "--speed", "max", "--once",
            "--plant", PLANT, "--target", str(original), "--report", str(report),
        ],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    try:
        until = time.monotonic() + LIMIT
        while not port.is_symlink():
            assert printer.poll() is None
            assert time.monotonic() < until
            time.sleep(0.05)
        gcodectl("stream", part, "--port", port, folder=tmp_path)
        assert printer.wait(LIMIT) == 0
    finally:
        printer.kill()
    found = json.loads((report / "score.json").read_text())
    for name in ("rmse", "off_path", "time_s", "on_road"):
        assert found[name] == pytest.approx(wanted[name], rel=0.02), name
    assert found["starved"] == []
