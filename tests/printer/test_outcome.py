"""What is written when a print is over, and that its score is the simulation's."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest
from feeding import DATA, MACHINE, make_live, run, whole

from plant_models.gantry import Firmware, cut
from plant_models.printer.outcome import MOST_ROWS, write_outcome
from plant_models.printing import set_up
from plant_models.reading import read_moves

BOX = DATA / "three_lines.gcode"


def columns(path: Path) -> dict[str, list[str]]:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def executed(path: Path) -> list[tuple[float, bytes]]:
    return [(0.25 * k, line) for k, line in enumerate(path.read_bytes().splitlines())]


def test_the_score_is_that_of_the_simulation(tmp_path: Path):
    live = run(BOX.read_bytes().splitlines())
    result = write_outcome(tmp_path, live, executed(BOX), plant="paste-a", machine=MACHINE, target=BOX, seed=3)
    bench = set_up(cut(read_moves(BOX.read_bytes(), MACHINE), MACHINE, Firmware()), MACHINE, "paste-a", seed=3)
    other = bench.judge(whole(BOX.read_bytes()))
    assert result is not None
    assert result.table() == pytest.approx(other.table(), rel=1e-6)
    table = json.loads((tmp_path / "score.json").read_text())
    assert {name: table[name] for name in other.table()} == pytest.approx(other.table(), rel=1e-6)
    assert table["starved"] == []
    assert table["least_buffered"] is None
    assert (table["plant"], table["machine"], table["seed"], table["dt"]) == ("paste-a", "syringe", 3, bench.dt)
    assert table["lines"] == len(BOX.read_bytes().splitlines())


def test_the_tables_hold_the_print(tmp_path: Path):
    live = run(BOX.read_bytes().splitlines())
    result = write_outcome(tmp_path / "new", live, executed(BOX), plant="paste-a", machine=MACHINE, target=BOX)
    assert result is not None
    way = columns(tmp_path / "new" / "trajectory.csv")
    t, q = [float(text) for text in way["t"]], [float(text) for text in way["q"]]
    bead = columns(tmp_path / "new" / "bead.csv")
    laid = sum(float(text) for text in bead["laid"])
    assert len(bead["laid"]) == result.bins
    assert laid == pytest.approx(result.on_road * result.target_volume, rel=1e-3)
    assert sum(float(text) for text in bead["target"]) == pytest.approx(result.target_volume, rel=1e-3)
    assert sum(q) * (t[1] - t[0]) == pytest.approx(laid + result.off_path * result.target_volume, rel=1e-2)
    assert max(float(text) for text in way["speed"]) == pytest.approx(40.0, abs=0.1)
    assert (way["x"][-1], way["y"][-1], way["speed"][-1]) == ("20.0000", "80.0000", "0")
    assert len(t) <= MOST_ROWS


def test_every_line_is_written_in_order_with_its_time(tmp_path: Path):
    lines = [(1.0, b"G28"), (2.0, b"G1 X10 F600"), (2.5, b'M117 caf\xe9, "so"')]
    live = make_live()
    for when, line in lines:
        live.take(line, when)
    live.advance(9.0)
    write_outcome(tmp_path, live, lines, plant=None, machine=MACHINE)
    assert (tmp_path / "executed.gcode").read_bytes() == b'G28\nG1 X10 F600\nM117 caf\xe9, "so"\n'
    table = columns(tmp_path / "executed.csv")
    assert table["line"][2] == 'M117 caf\xe9, "so"'
    assert [float(text) for text in table["t"]] == pytest.approx([-1.1, -0.1, 0.4])


def test_without_a_target_the_roads_are_its_own(tmp_path: Path):
    live = run(BOX.read_bytes().splitlines())
    result = write_outcome(tmp_path, live, executed(BOX), plant="linear", machine=MACHINE)
    assert result is not None
    assert result.roads == 1
    assert result.unvisited == 0.0


def test_two_tools_have_their_columns(tmp_path: Path):
    path = DATA / "box_two_tools.gcode"
    live = run(path.read_bytes().splitlines())
    assert write_outcome(tmp_path, live, executed(path), plant="paste-a", machine=MACHINE, target=path) is not None
    assert {"u0", "q0", "u1", "q1"} <= columns(tmp_path / "trajectory.csv").keys()


@pytest.mark.parametrize(
    ("lines", "plant", "target", "reason"),
    [
        ([b"G1 X10 F600"], None, None, "no plant"),
        ([b"G1 X10 F600"], "paste-a", None, "no road"),
        ([b"M105"], "paste-a", None, "no road"),
        ([b"G1 X10 F600"], "paste-a", BOX, "never passed over"),
        ([b"M105"], "paste-a", BOX, "never passed over"),
    ],
)
def test_where_there_is_no_score_it_says_why(tmp_path: Path, lines, plant, target, reason: str):
    result = write_outcome(tmp_path, run(lines), [(0.0, line) for line in lines], plant=plant, machine=MACHINE,
                           target=target)  # fmt: skip
    assert result is None
    table = json.loads((tmp_path / "score.json").read_text())
    assert table["score"] is None
    assert reason in table["reason"]
    assert (tmp_path / "trajectory.csv").exists() == (lines != [b"M105"])


def test_starving_is_told_in_the_prints_own_time(tmp_path: Path):
    live = make_live()
    for now, line in ((10.0, b"G1 X10 F600"), (20.0, b"G1 X20")):
        live.take(line, now)
        live.advance(now + 5.0)
    write_outcome(tmp_path, live, [], plant=None, machine=MACHINE)
    table = json.loads((tmp_path / "score.json").read_text())
    (when, how_long), = table["starved"]  # fmt: skip
    assert when == pytest.approx(1.02)
    assert how_long == pytest.approx(20.1 - 11.12)
    assert table["least_buffered"] == 0.0
    assert math.isclose(live.begun, 10.1)
