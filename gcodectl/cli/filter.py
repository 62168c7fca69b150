"""`gcodectl filter`: a slicer's G-code in, the same part with learned flow signals out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcodectl.cli.options import File, MachineName, PassUnknown, Thermal
from gcodectl.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gcodectl.pipeline import Options
    from gcodectl.summary import Summary

TAIL = 4096
LAG = 30.0
"""s of motion by which lines from a pipe may leave behind the last that came: braking, leads, runs of one speed."""


def command(
    file: File = "-",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="OUT", help="Write here, whole or not at all.")
    ] = None,
    in_place: Annotated[
        bool, typer.Option("--in-place", help="Replace FILE by the result, as a slicer's post-processing script must.")
    ] = False,
    machine: MachineName = "syringe",
    material: Annotated[
        list[str] | None,
        typer.Option("--material", help="Material: a name, `file.npz`, or `neutral`; once for each tool, T0 first."),
    ] = None,
    sequencer: Annotated[
        str,
        typer.Option(
            help="`model`: the flow model inverted; `superpose`: basis signals added up; `basis`: one at a time."
        ),
    ] = "model",
    quality: Annotated[
        str,
        typer.Option(
            metavar="TIME|BALANCED|BEAD|0..1",
            help="How much of the time that the extruder needs at a road's ends the motion gives it.",
        ),
    ] = "BALANCED",
    retracts: Annotated[
        str, typer.Option(help="The slicer's retracts: `replace` them by the signals, or `keep`.")
    ] = "replace",
    thermal: Thermal = None,
    pass_unknown: PassUnknown = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print what was done as JSON, on stderr without -o or --in-place.")
    ] = False,
) -> None:
    """Lay learned flow signals over G-code: from FILE or a pipe, to -o OUT, in place, or to standard output.

    Lines from a pipe leave while it is open, at most 30 seconds of motion behind the last that came, however long the
    file is.

    With --thermal, large parts are printed at the pace at which they cool: layers are slowed, and waited for, until
    what lies beneath is no hotter than a new road bears; lines then leave a layer late. `gcodectl thermal example`
    prints such a profile with its explanations, `gcodectl thermal fit` measures the cooling.
    """
    from gcodectl.cli.common import STDIN, filter_options, open_input, write_stdout, write_whole
    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.gcode.lines import read_chunks
    from gcodectl.pipeline import filter_stream
    from gcodectl.summary import Summary

    if in_place and (file == STDIN or output is not None):
        raise UsageError("--in-place takes a FILE, and no -o")
    options = filter_options(
        file, machine, material or ["neutral"], sequencer, quality, retracts, pass_unknown, thermal
    )
    if file != STDIN and _filtered_before(file, options, output, in_place):
        return
    announce_compiling()
    summary = Summary()
    with open_input(file) as stream:
        chunks = _progress(filter_stream(read_chunks(stream), options, summary), file, summary)
        target = Path(file) if in_place else output
        written = write_whole(target, chunks) if target is not None else write_stdout(chunks)
    _report(summary, options, target, written, as_json=as_json)


def _filtered_before(file: str, options: Options, output: Path | None, in_place: bool) -> bool:
    """Say so where FILE has been filtered already, and copy it as it is where a copy is wanted."""
    from gcodectl.cli.common import open_input, write_stdout, write_whole
    from gcodectl.filtered import is_filtered

    with open_input(file) as stream:
        if not stream.seekable():
            return False
        stream.seek(max(0, stream.seek(0, 2) - TAIL))
        if not is_filtered(stream.read()):
            return False
        typer.echo(f"gcodectl: {options.source} has been filtered by gcodectl already; nothing was changed", err=True)
        stream.seek(0)
        whole = iter(lambda: stream.read(1 << 20), b"")
        if output is not None:
            write_whole(output, whole)
        elif not in_place:
            write_stdout(whole)
    return True


def _progress(chunks: Iterable[bytes], file: str, summary: Summary) -> Iterator[bytes]:
    """Pass chunks on; show how far the input has got on a terminal."""
    import sys

    from gcodectl.cli.common import STDIN

    if file == STDIN or not sys.stderr.isatty():
        yield from chunks
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        shown = bar.add_task("reading")
        for chunk in chunks:
            bar.update(shown, description=f"line {summary.lines:,}, layer {summary.layers}")
            yield chunk


def _report(summary: Summary, options: Options, target: Path | None, written: int, *, as_json: bool) -> None:
    """Say what was done: for people on stderr, as JSON on stdout (stderr where stdout carries the G-code)."""
    import dataclasses
    import json

    from gcodectl.cli.common import duration
    from gcodectl.cli.pace import pace_rows

    slowed = summary.slowed_starts + summary.slowed_stops
    pace = pace_rows(options) if slowed else []
    if as_json:
        result = {
            "source": options.source,
            "output": str(target or "-"),
            "bytes": written,
            **dataclasses.asdict(dataclasses.replace(summary, heat=None)),
            "heat": summary.heat.table() if summary.heat else None,
            "pace": pace,
        }
        typer.echo(json.dumps(result), err=target is None)
        return
    if summary.already_filtered:
        typer.echo(f"gcodectl: {options.source} has been filtered by gcodectl already; nothing was changed", err=True)
        return
    where = f", wrote {target}" if target is not None else ""
    slow = (
        f", {summary.slowed_starts} starts and {summary.slowed_stops} stops slowed for the extruder "
        f"by {summary.slowed_s:.1f} s"
    )
    typer.echo(
        f"gcodectl: {options.source}: {summary.lines} lines, {summary.layers} layers, {summary.roads} roads, "
        f"{duration(summary.time_s)}{slow if slowed else ''}{where}", err=True,
    )  # fmt: skip
    for row in pace:
        typer.echo(f"gcodectl: {row}", err=True)
    if summary.heat is not None:
        from gcodectl.cli.heat import heat_rows

        for row in heat_rows(summary.heat):
            typer.echo(f"gcodectl: {row}", err=True)
