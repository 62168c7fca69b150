"""What is left of a print when it is over: the lines that were executed, the way of the nozzle, the bead, the score.

    executed.gcode   every line executed, once or more, in order          executed.csv    the same with their times
    trajectory.csv   t, X, Y, Z, speed, u and q of each tool              bead.csv        every bin: asked for, laid
    score.json       what `gcodectl simulate --json` says, and how the planner was fed

Time 0 is where the first motion began; lines before it have negative times. The plant is driven by exactly what the
live planner executed, pauses for want of lines included.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.errors import InputError
from gcodectl.records import Signal
from plant_models.bead import Roads
from plant_models.firmware import Execution, standing
from plant_models.gantry import Firmware, cut
from plant_models.match import match
from plant_models.printer.live import Live
from plant_models.printing import Bench, set_up
from plant_models.reading import read_moves
from plant_models.score import Score, bin_errors, score

LONGEST = 100_000.0
"""s of a print that is laid and scored at the most: more does not fit into a memory."""
FARTHEST = 5e6
"""mm of path, likewise."""
MOST_ROWS = 20_000
"""Rows of trajectory.csv at most: about 1 MB."""
Executed = Sequence[tuple[float, bytes]]
"""(when, s; the command without its number and checksum) of every line executed."""


def write_outcome(
    folder: Path, live: Live, executed: Executed, *, plant: str | None, machine: Machine, target: Path | None = None,
    seed: int = 0, firmware: Firmware | None = None,
) -> Score | None:  # fmt: skip
    """Write all files into `folder` (made where it is not there); returns the score.

    None, and score.json says why, where there is no plant, nothing to score, or another part than `target`'s; the
    roads are `target`'s, or else those of what was executed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    begun = live.begun if not math.isnan(live.begun) else (executed[0][0] if executed else 0.0)
    _write_executed(folder, executed, begun)
    execution = live.execution()
    about: dict[str, object] = {
        "file": str(folder / "executed.gcode"), "target": str(target or folder / "executed.gcode"), "plant": plant,
        "seed": seed, "machine": machine.name, "max_flow": machine.max_flow,
    }  # fmt: skip
    fed = {
        "starved": [[when - begun, how_long] for when, how_long in live.starved],
        "least_buffered": live.least_buffered if math.isfinite(live.least_buffered) else None,
        "lines": len(executed),
    }
    result, reason, bench = None, "no plant was given", None
    command = flow = None
    try:
        if plant is not None:
            _check_size(execution)
            original = execution.segments
            if target is not None:
                moves = read_moves(target.read_bytes(), machine, source=str(target), pass_unknown=True)
                original = cut(moves, machine, firmware or Firmware())
            bench = set_up(original, machine, plant, seed=seed, firmware=firmware)
            command, flow = bench.printed(execution)
            result, reason = _judge(folder, bench, execution, flow), ""
    except InputError as error:
        reason = error.reason
    if len(execution.phases):
        _write_trajectory(folder, execution, command, flow)
    if result is None or bench is None:
        table: dict[str, object] = {"score": None, "reason": reason}
    else:
        table = {"dt": bench.dt, "tail": bench.tail, **result.table(), "standing_s": standing(execution)}
    (folder / "score.json").write_text(json.dumps({**about, **table, **fed}, indent=1) + "\n")
    return result


def _check_size(execution: Execution) -> None:
    """Raise InputError where an execution is longer than can be laid."""
    if execution.duration > LONGEST:
        raise InputError(f"the print took {execution.duration:.0f} s, and no more than {LONGEST:.0f} s can be scored")
    length = float(execution.segments.length.sum())
    if length > FARTHEST:
        raise InputError(f"the print has {length:.3g} mm of path, and no more than {FARTHEST:.3g} mm can be scored")


def _judge(folder: Path, bench: Bench, execution: Execution, flow: Signal) -> Score:
    """Score what was laid, and write the bead."""
    places = match(bench.roads, execution.segments)
    errors, _, _ = bin_errors(bench.roads, execution, flow, places)
    _write_bead(folder, bench.roads, errors)
    return score(bench.roads, execution, flow, places)


def _write_executed(folder: Path, executed: Executed, begun: float) -> None:
    (folder / "executed.gcode").write_bytes(b"".join(text + b"\n" for _, text in executed))
    rows = ((number, f"{when - begun:.6f}", text.decode("latin-1")) for number, (when, text) in enumerate(executed, 1))
    _write_table(folder / "executed.csv", ("number", "t", "line"), rows)


def _write_trajectory(folder: Path, execution: Execution, command: Signal | None, flow: Signal | None) -> None:
    """Write the way at the times of every k-th sample, u and q as means over them, so that no volume is lost."""
    fine = 0.002 if command is None else command.dt
    samples = execution.samples(fine) if command is None else command.values.shape[1]
    step = max(1, math.ceil(samples / MOST_ROWS))
    times = np.arange(math.ceil(samples / step)) * (step * fine)
    place, speed = execution.position(times), execution.speed(np.minimum(times, execution.duration))
    names, columns = ["t", "x", "y", "z", "speed"], [times, *place.T, np.where(times < execution.duration, speed, 0.0)]
    if command is not None and flow is not None:
        for number, tool in enumerate(command.channels):
            mark = str(tool) if len(command.channels) > 1 else ""
            names += [f"u{mark}", f"q{mark}"]
            columns += [_means(command.values[number], step), _means(flow.values[number], step)]
    rows = (
        tuple(f"{value:.5g}" if k > 3 else f"{value:.4f}" for k, value in enumerate(row))
        for row in zip(*columns, strict=True)
    )
    _write_table(folder / "trajectory.csv", names, rows)


def _means(values: Floats, step: int) -> Floats:
    """Return the means over `step` samples each, the last with zeros behind it."""
    padded = np.zeros(math.ceil(len(values) / step) * step)
    padded[: len(values)] = values
    means: Floats = padded.reshape(-1, step).mean(axis=1)
    return means


def _write_bead(folder: Path, roads: Roads, errors: Floats) -> None:
    laid = (errors + 1.0) * roads.target
    line = roads.path.line[roads.bin_segment]
    rows = (
        (road, number, f"{x:.3f}", f"{y:.3f}", f"{z:.3f}", f"{asked:.5g}", f"{got:.5g}")
        for road, number, (x, y, z), asked, got in zip(
            roads.bin_road.tolist(), line.tolist(), roads.middle.tolist(), roads.target.tolist(), laid.tolist(),
            strict=True,
        )
    )  # fmt: skip
    _write_table(folder / "bead.csv", ("road", "line", "x", "y", "z", "target", "laid"), rows)


def _write_table(path: Path, names: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(rows)
