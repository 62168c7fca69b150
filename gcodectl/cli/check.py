"""`gcodectl check`: whether a file can be followed safely, and what it would do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from gcodectl.cli.options import AsJson, File, MachineName, PassUnknown

if TYPE_CHECKING:
    from gcodectl.cli.feasibility import Tally
    from gcodectl.pipeline import Options


def command(
    file: File = "-",
    machine: MachineName = "syringe",
    pass_unknown: PassUnknown = False,
    as_json: AsJson = False,
) -> None:
    """Read FILE as a printer would: what it does, and what the machine's firmware would refuse, slow down or blur.

    Exit status 3 where it cannot be understood safely, 4 where the firmware would refuse a line.
    """
    import json

    from gcodectl.cli.common import open_input, reading_options
    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.cli.feasibility import Tally
    from gcodectl.errors import UnsafeError
    from gcodectl.gcode.lines import read_chunks

    options = reading_options(file, machine, pass_unknown)
    announce_compiling()
    with open_input(file) as stream:
        tally = Tally(options.machine)
        found = _survey(read_chunks(stream), options, tally)
    typer.echo(json.dumps({**found, "firmware": tally.table()}) if as_json else _table(found, tally))
    refusal = tally.refusal(options.source)
    if refusal:
        raise UnsafeError(refusal)


def _survey(chunks: Any, options: Options, tally: Tally) -> dict[str, Any]:
    """Walk through a file: what it moves, where, how much, how long."""
    import numpy as np

    from gcodectl.motion.feasible import inspect
    from gcodectl.motion.limits import Limit
    from gcodectl.pipeline import read_moves, time_moves
    from gcodectl.records import Kind

    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    lines = moving = roads = layers = barriers = 0
    volume = extruded = path = time_s = 0.0
    tools: set[int] = set()
    limited = np.zeros(len(Limit), dtype=np.int64)
    timed = time_moves(read_moves(chunks, options), options.machine)
    for moves, speeds, phases, findings in inspect(timed, options.machine):
        if not len(moves):
            continue
        tally.add(findings)
        lays = (moves.e > 0) & (moves.length > 0)
        lines, layers = int(moves.line[-1]), max(layers, int(moves.layer.max()) + 1)
        moving += int((speeds.distance > 0).sum())
        barriers += int((moves.kind == Kind.BARRIER).sum())
        extruded += float(np.nansum(moves.e))
        volume += float(np.sum(moves.e[lays] * moves.area[lays]))
        path += float(np.sum(moves.length[lays]))
        roads += int(np.sum(lays & ~np.concatenate([[False], lays[:-1]])))
        tools |= set(np.unique(moves.tool[lays]).tolist())
        limited += np.bincount(speeds.limited_by, minlength=len(Limit))
        limited += np.bincount(speeds.ruled_by, minlength=len(Limit))
        if lays.any():
            low = np.fmin(low, np.fmin(moves.p0[lays], moves.p1[lays]).min(axis=0))
            high = np.fmax(high, np.fmax(moves.p0[lays], moves.p1[lays]).max(axis=0))
        if len(phases):
            time_s = float(phases.t[-1] + phases.duration[-1])
    return {
        "source": options.source, "lines": lines, "moves": moving, "layers": layers, "tools": sorted(tools),
        "barriers": barriers, "time_s": time_s, "road_mm": path, "volume_mm3": volume, "e_total": extruded,
        "low": low.tolist() if roads else None, "high": high.tolist() if roads else None,
        "limited_by": {one.label: int(limited[one]) for one in Limit if one},
    }  # fmt: skip


def _table(found: dict[str, Any], tally: Tally) -> str:
    """The result in lines for people."""
    from gcodectl.cli.common import duration

    rows = [
        f"{found['source']}: understood, {found['lines']} lines, {found['moves']} moves, {found['layers']} layers",
        f"  time      {duration(found['time_s'])} by the motion plan",
        f"  roads     {found['road_mm'] / 1000:.2f} m, {found['volume_mm3'] / 1000:.2f} ml",
        f"  E         {found['e_total']:.5g} mm in all",
    ]
    if found["low"] is not None:
        axes = zip("XYZ", found["low"], found["high"], strict=True)
        rows.append("  part      " + "  ".join(f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in axes) + " mm")
    limits = ", ".join(f"{name} {count}" for name, count in found["limited_by"].items() if count)
    rows.append(f"  limited   moves by {limits or 'nothing'}")
    return "\n".join(rows + tally.rows())
