"""What pip and Debian can install beside it, on the same file in the same run: MB/s and memory; ratios follow.

`wc -l`, Python copying lines, gcodeparser (an environment of its own), Printrun's gcoder and OctoPrint's interpreter
(both in build/peers, made by tools/peers.sh). They only read; check reads, plans and times, filter writes as well.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from speed_bench.cells import LADDER, Cell, Plan, by
from speed_bench.inputs import FAMILIES, MB, ROOT, make_input
from speed_bench.process import median, run

GCODEPARSER = "gcodeparser==0.3.0"
DRIVE = Path(__file__).resolve().parent / "peer_drive.py"
SMALLEST_TIMED = 0.25
"""s; what is quicker on the probe is called instant and gets the largest input."""


def measured_peers(plan: Plan, cells: list[Cell]) -> list[dict[str, Any]]:
    """Measure every peer that is there, or say why it is not; ratios of our own MB/s to theirs, where both are."""
    found = []
    for name, find in _peers().items():
        try:
            words = find()
        except (OSError, subprocess.SubprocessError) as error:
            found.append({"peer": name, "skipped": _reason(error)})
            continue
        found.append({"peer": name, **_measured(words, plan)})
    for row in found:
        for stage in ("check", "neutral", "learned"):
            ours = by(cells, family="real", stage=stage, role="small")
            if ours and "mb_s" in row:
                row[f"{stage}_over"] = ours["mb_s"] / row["mb_s"]
    return found


def _reason(error: Exception) -> str:
    said = getattr(error, "stderr", None) or str(error)
    return said.strip().splitlines()[-1][:160] if said.strip() else type(error).__name__


def _peers() -> dict[str, Callable[[], list[str]]]:
    return {
        "wc -l": _wc,
        "Python, copying lines": lambda: [sys.executable, str(DRIVE), "copy"],
        "gcodeparser": lambda: [str(_gcodeparser()), str(DRIVE), "gcodeparser"],
        "Printrun's gcoder": lambda: [str(_shared()), str(DRIVE), "printrun"],
        "OctoPrint's interpreter": lambda: [str(_shared()), str(DRIVE), "octoprint"],
    }


def _wc() -> list[str]:
    if not shutil.which("wc"):
        raise FileNotFoundError("there is no wc here")
    return ["wc", "-l"]


def _shared() -> Path:
    """Return the Python of build/peers, which tools/peers.sh makes where it can."""
    python = ROOT / "build" / "peers" / "bin" / "python"
    if not (ROOT / "build" / "peers" / ".made-of").exists():
        subprocess.run([ROOT / "tools" / "peers.sh"], check=True, capture_output=True, text=True, timeout=600)
    return python


def _gcodeparser() -> Path:
    """Return a Python that has gcodeparser, in an environment made once."""
    folder = ROOT / "build" / "speed-peers"
    python, stamp = folder / "bin" / "python", folder / ".made-of"
    if not stamp.exists() or stamp.read_text() != GCODEPARSER:
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run(
            [sys.executable, "-m", "venv", "--without-pip", folder], check=True, capture_output=True, text=True
        )
        pip = (sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--disable-pip-version-check")
        subprocess.run([*pip, "--no-input", GCODEPARSER], check=True, capture_output=True, text=True, timeout=180)
        stamp.write_text(GCODEPARSER)
    return python


def _measured(words: list[str], plan: Plan) -> dict[str, Any]:
    """Run a peer on the largest input that its own rate allows, up to the plan's small one."""
    one = make_input(FAMILIES[0], 0.0, plan.folder)
    probe = run([*words, str(one.path)])
    if probe.failure():
        return {"error": probe.failure()}
    rate = 0.0 if probe.wall_s < SMALLEST_TIMED else probe.wall_s / (one.bytes / MB)
    sizes = [size for size in (*LADDER, plan.small) if size <= plan.small and size * rate <= plan.limit]
    file = make_input(FAMILIES[0], max(sizes, default=0.0), plan.folder)
    runs = [run([*words, str(file.path)]) for _ in range(plan.repeat)]
    wall = median([each.wall_s for each in runs])
    return {
        "input_mb": file.bytes / MB, "wall_s": wall, "mb_s": file.bytes / MB / wall, "lines_s": file.lines / wall,
        "peak_mb": max(each.peak_mb for each in runs), "error": next((e.failure() for e in runs if e.failure()), ""),
    }  # fmt: skip
