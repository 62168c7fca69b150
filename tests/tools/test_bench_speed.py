"""The speed bench: its inputs are sound G-code, its arithmetic is right, and it runs, on tiny inputs."""

from __future__ import annotations

import cProfile
import pstats
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from speed_bench import peers
from speed_bench.cells import Plan, Work, _size, works
from speed_bench.inputs import ARCS, FAMILIES, STAR, fine_curves, make_input, raised, repeated, seam_after, split
from speed_bench.process import Ran, run
from speed_bench.profiling import stage_of, summed
from speed_bench.report import show, targets

from gcodectl.config import load_machine
from gcodectl.errors import InputError
from gcodectl.pipeline import Options, read_moves

TOOLS = Path(__file__).resolve().parents[2] / "tools"
TINY = Plan(0.01, 0.02, 1, 5.0)


def moves_of(data: bytes) -> list[Any]:
    return list(read_moves([data], Options(load_machine("filament"))))


def laid(data: bytes) -> float:
    return float(sum(one.e[(one.e > 0) & (one.length > 0)].sum() for one in moves_of(data)))


@pytest.mark.parametrize("path", [STAR, ARCS])
def test_a_part_repeated_in_z_is_so_many_times_the_part(path: Path) -> None:
    data = path.read_bytes()
    head, layers, tail = split(data)
    assert head + layers + tail == data
    thrice = b"".join(repeated(data, 3 * len(layers) + len(head) + len(tail)))
    assert thrice.count(b";LAYER_CHANGE") == 3 * data.count(b";LAYER_CHANGE")
    assert laid(thrice) == pytest.approx(3.0 * laid(data))
    tops = [float(line[3:]) for line in thrice.split(b"\n") if line.startswith(b";Z:")]
    assert tops == sorted(tops)
    assert len(set(tops)) == len(tops)
    assert thrice.endswith(tail)


def test_a_seam_pushes_back_what_was_left_retracted() -> None:
    relative = b"G1 X1 E.5\nG1 X2 E-.3 F10\nG1 E-.5 F2100\n"
    assert seam_after(b"M83\n", relative) == b"G1 E0.8 F2100\n"
    absolute = b"G92 E0\nG1 X1 E1.5\nG1 E1.3 F120\nG92 E0\n"
    assert seam_after(b"M82\n", absolute) == b"G92 E0\nG1 E0.2 F120\nG92 E0\n"
    assert seam_after(b"M83\n", b"G1 X1 E.5\n") == b""


def test_raising_changes_z_words_and_nothing_else() -> None:
    data = b";Z:.4\nG1 X1 Z.2 F720\nG3 X1 Y2 Z0.6 I1 J0\nG1 X5 ; to Z3\nM117 Z4\n"
    assert raised(data, 1.0) == b";Z:1.4\nG1 X1 Z1.2 F720\nG3 X1 Y2 Z1.6 I1 J0\nG1 X5 ; to Z3\nM117 Z4\n"


def test_what_has_no_layers_is_refused() -> None:
    with pytest.raises(InputError, match="LAYER_CHANGE"):
        split(b"G1 X1\nG1 X2 E3\n")


def test_fine_curves_move_a_tenth_of_a_millimetre() -> None:
    data = b"".join(fine_curves(1.0))
    lengths = [length for one in moves_of(data) for length in one.length[one.e > 0].tolist()]
    assert len(lengths) > 5_000
    assert sorted(lengths)[len(lengths) // 2] == pytest.approx(0.1, rel=0.05)


def test_inputs_are_made_once_and_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GCODECTL_CORPUS", str(tmp_path))
    for family in FAMILIES:
        one = make_input(family, 0.02, tmp_path / "one")
        data = one.path.read_bytes()
        assert (one.bytes, one.lines) == (len(data), data.count(b"\n"))
        stamp = one.path.stat().st_mtime_ns
        assert make_input(family, 0.02, tmp_path / "one").path.stat().st_mtime_ns == stamp
        assert make_input(family, 0.02, tmp_path / "two").path.read_bytes() == data


def test_a_process_is_measured() -> None:
    words = "import sys; a = bytes(80_000_000); print('1\\n2'); print('no', file=sys.stderr); sys.exit(3)"
    ran = run([sys.executable, "-c", words], count=True)
    assert ran.lines_out == 2
    assert ran.failure() == "status 3: no"
    assert ran.failure((0, 3)) == ""
    assert ran.peak_mb > 80  # no upper bound: a child begins with the peak of the process that starts it
    late = run([sys.executable, "-c", "import time; time.sleep(60)"], timeout=0.5)
    assert "time limit" in late.failure()


def test_too_slow_a_command_is_cut_to_a_smaller_input(tmp_path: Path) -> None:
    plan = Plan(6.0, 20.0, 1, 4.0, folder=tmp_path)
    one = make_input(FAMILIES[2], 0.0, tmp_path)
    work, probe = Work(FAMILIES[2], "check", 6.0, "small"), Ran(1.0, 1.0, 50.0, 0, 0, "")
    _size(work, plan, one, 3.0, probe)
    assert work.expected == pytest.approx(18.0)
    assert work.input is not None
    assert work.input.bytes < 1.2e6


def test_all_is_in_the_plan_and_less_in_the_quick_one() -> None:
    whole = {(one.family.name, one.stage, one.role) for one in works(TINY)}
    assert len(whole) == 4 * 4 + 4 + 1
    quick = {(one.family.name, one.stage, one.role) for one in works(Plan(6, 20, 1, 4, whole=False))}
    assert quick < whole
    assert {stage for _, stage, _ in quick} == {"check", "tasks", "neutral", "learned", "simulate"}


def cell(family: str, stage: str, role: str, mb: float, mb_s: float, peak: float) -> dict[str, Any]:
    return {
        "family": family, "stage": stage, "role": role, "input_mb": mb, "mb_s": mb_s, "peak_mb": peak, "cut": False,
        "lines": 10, "wall_s": 1.0, "warm_mb_s": mb_s, "lines_s": 10.0,
    }  # fmt: skip


def test_targets_say_what_was_reached(capsys: pytest.CaptureFixture[str]) -> None:
    cells = [
        cell("real", "check", "small", 60, 70.0, 100), cell("real", "check", "large", 500, 70.0, 130),
        cell("real", "learned", "small", 60, 20.0, 200), cell("real", "learned", "large", 60, 20.0, 310),
        {**cell("paste", "learned", "small", 60, 9.0, 100), "lines_out_s": 4e5},
    ]  # fmt: skip
    starts = [{"name": "gcodectl --help", "startup_s": 0.1, "least_s": 0.1, "most_s": 0.1, "error": ""}]
    first = [
        {"name": "first", "first_s": 40.0, "second_s": 1.0, "says_so": True, "says_so_again": False, "error": ""}
    ]  # fmt: skip
    rows = targets(cells, starts, first)
    met = {row["name"]: row["met"] for row in rows}
    assert met["check, real file of 60 MB"]
    assert not met["filter, learned (aim 60), real file of 60 MB"]
    assert met["filter, learned, paste part of 60 MB"]
    assert not met["peak memory, any file, any command"]
    assert not met["memory of check, 500 MB over 60 MB"]
    assert not met["memory of learned, 60 MB over 60 MB"]
    assert met["start-up: gcodectl --help"]
    assert not met["first run after installing, compiling"]
    assert met["it says that it is compiling, once"]
    failed = {"family": "real", "stage": "check", "role": "small", "input_mb": 6.0, "lines": 1, "error": "status 1"}
    assert not any(row["met"] for row in targets([failed]))
    gone = [{"peer": "wc -l", "skipped": "there is no wc here"}]
    show({"cells": [*cells, failed], "targets": rows, "startup": starts, "first_run": first, "peers": gone})
    out = capsys.readouterr().out
    assert "MISSED" in out
    assert "FAILED check, real: status 1" in out
    assert "there is no wc here" in out


def test_a_profile_is_summed_by_stage() -> None:
    watch = cProfile.Profile()
    watch.runcall(lambda: moves_of(STAR.read_bytes()))
    found = summed(pstats.Stats(watch))
    assert sum(one["own_s"] for one in found["stages"]) <= found["total_s"]
    assert any(one["where"].startswith("gcodectl/gcode/") for one in found["stages"])
    assert stage_of("~") == "built in"
    assert stage_of("/x/site-packages/numba/core/a.py") == "numba"


def test_peers_that_are_not_there_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none() -> list[str]:
        raise FileNotFoundError("there is no index to install from")

    copy = [sys.executable, str(peers.DRIVE), "copy"]
    monkeypatch.setattr(peers, "_peers", lambda: {"absent": none, "Python": lambda: copy, "wc -l": peers._wc})
    ours = [{**cell("real", "check", "small", 60, 70.0, 100)}]
    plan = Plan(0.02, 0.02, 1, 5.0, folder=tmp_path)
    absent, python, wc = peers.measured_peers(plan, ours)
    assert absent["skipped"] == "there is no index to install from"
    assert python["check_over"] == pytest.approx(70.0 / python["mb_s"])
    assert wc["error"] == ""
