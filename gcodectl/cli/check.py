"""`gcodectl check`: whether a file can be followed safely, and what it would do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from gcodectl.cli.options import AsJson, File, MachineName, PassUnknown, Thermal

if TYPE_CHECKING:
    from gcodectl.cli.feasibility import Tally
    from gcodectl.pipeline import Options
    from gcodectl.thermal.tally import Tally as Heat


NO_JERK = 1e12
"""mm/s^3; stock firmware limits none, and what is checked is what it will do."""

CHUNK = 1 << 20
"""Bytes read at once: nothing waits for what comes out, and fewer chunks are less to look after."""


def command(
    file: File = "-",
    machine: MachineName = "syringe",
    thermal: Thermal = None,
    pass_unknown: PassUnknown = False,
    as_json: AsJson = False,
) -> None:
    """Read FILE as a printer would: what it does, and what the machine's firmware would refuse, slow down or blur.

    Time is that of the motion plan, by the slicer's types; --json has it by layer too. With --thermal, all of it is as
    `filter --thermal` would have it, and how hot the surface beneath is, before and after.
    Exit status 3 where it cannot be understood safely, 4 where the firmware would refuse a line.
    """
    import json

    from gcodectl.cli.common import open_input, reading_options
    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.cli.feasibility import Tally
    from gcodectl.errors import UnsafeError
    from gcodectl.gcode.lines import read_chunks

    options = reading_options(file, machine, pass_unknown, thermal)
    announce_compiling()
    heat = _heat(options)
    with open_input(file) as stream:
        tally = Tally(options.machine)
        found = _survey(read_chunks(stream, CHUNK), options, tally, heat)
    if heat is not None:
        found["heat"] = heat.table()
    typer.echo(json.dumps({**found, "firmware": tally.table()}) if as_json else _table(found, tally, heat))
    refusal = tally.refusal(options.source)
    if refusal:
        raise UnsafeError(refusal)


def _heat(options: Options) -> Heat | None:
    from gcodectl.thermal.tally import Tally as Heat

    return Heat(options.heat.band) if options.heat is not None else None


def _survey(chunks: Any, options: Options, tally: Tally, heat: Heat | None) -> dict[str, Any]:
    """Walk through a file: what it moves, where, how much, how long."""
    import dataclasses

    import numpy as np

    from gcodectl.motion.feasible import inspect
    from gcodectl.motion.limits import Limit
    from gcodectl.pipeline import heed_heat, read_moves, time_moves
    from gcodectl.report import survey as of

    machine = dataclasses.replace(options.machine, jerk=NO_JERK)
    survey = of.Survey(machine)
    heeded = heed_heat(read_moves(chunks, options), dataclasses.replace(options, keep_retracts=True), heat)
    timed = time_moves(heeded, machine)
    for moves, speeds, phases, findings in inspect(timed, machine):
        tally.add(findings)
        survey.add(moves, speeds, phases)
    counts = survey.counts.tolist()
    low, high = survey.box.tolist() if counts[of.ROADS] else (None, None)
    return {
        "source": options.source, "lines": survey.lines, "moves": int(counts[of.MOVING]),
        "layers": len(survey.layers) - 1, "tools": np.flatnonzero(survey.tools).tolist(),
        "barriers": int(counts[of.BARRIERS]), "time_s": survey.time_s, "road_mm": counts[of.PATH],
        "volume_mm3": counts[of.VOLUME], "e_total": counts[of.EXTRUDED], "low": low, "high": high,
        "limited_by": {one.label: int(survey.limited[one]) for one in Limit if one},
        "time_by_layer": survey.by_layer(), "time_by_type": survey.by_type(),
    }  # fmt: skip


def _table(found: dict[str, Any], tally: Tally, heat: Heat | None) -> str:
    """The result in lines for people."""
    from gcodectl.cli.common import duration

    rows = [
        f"{found['source']}: understood, {found['lines']} lines, {found['moves']} moves, {found['layers']} layers",
        f"  time      {duration(found['time_s'])} by the motion plan",
        *(
            f"            {duration(seconds):>10} {100 * seconds / found['time_s']:3.0f} %  {label}"
            for label, seconds in found["time_by_type"].items()
        ),
        f"  roads     {found['road_mm'] / 1000:.2f} m, {found['volume_mm3'] / 1000:.2f} ml",
        f"  E         {found['e_total']:.5g} mm in all",
    ]
    if found["low"] is not None:
        axes = zip("XYZ", found["low"], found["high"], strict=True)
        rows.append("  part      " + "  ".join(f"{axis} {low:.2f} to {high:.2f}" for axis, low, high in axes) + " mm")
    limits = ", ".join(f"{name} {count}" for name, count in found["limited_by"].items() if count)
    rows.append(f"  limited   moves by {limits or 'nothing'}")
    if heat is not None:
        from gcodectl.cli.heat import heat_rows

        rows += [f"  {row}" for row in heat_rows(heat)]
    return "\n".join(rows + tally.rows())
