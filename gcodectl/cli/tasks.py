"""`gcodectl tasks`: the basis tasks that a file is made of."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcodectl.cli.options import AsJson, File, MachineName, PassUnknown, Thermal
from gcodectl.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterator

COLUMNS = ("kind", "first_line", "last_line", "road", "layer", "tool", "t_start", "t_end", "x", "y", "flow")


def command(
    file: File = "-",
    machine: MachineName = "syringe",
    thermal: Thermal = None,
    pass_unknown: PassUnknown = False,
    as_json: AsJson = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV.")] = False,
) -> None:
    """Print the basis tasks of FILE in order: No-Flow, Start, Steady-State, Corner, Stop. mm, s, mm^3/s.

    With --thermal, their times and flows are those that `filter --thermal` would plan.
    """
    from gcodectl.cli.common import open_input, reading_options
    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.gcode.lines import read_chunks

    if as_json and as_csv:
        raise UsageError("--json or --csv, not both")
    options = reading_options(file, machine, pass_unknown, thermal)
    announce_compiling()
    with open_input(file) as stream:
        rows = _rows(read_chunks(stream), options)
        (_print_json if as_json else _print_csv if as_csv else _print_table)(rows)


def _rows(chunks: Any, options: Any) -> Iterator[tuple[Any, ...]]:
    """One tuple a task, in the order of COLUMNS."""
    from math import isnan

    from gcodectl.pipeline import find_tasks, heed_heat, read_moves
    from gcodectl.records import TaskKind

    moves = heed_heat(read_moves(chunks, options), options)
    for _moves, _speeds, _profile, tasks, _known in find_tasks(moves, options):
        kinds = [TaskKind(kind).label for kind in tasks.kind]
        numbers = (tasks.first_line, tasks.last_line, tasks.road, tasks.layer, tasks.tool)
        places = (tasks.t0, tasks.t1, tasks.x, tasks.y, tasks.flow)
        whole = [column.tolist() for column in numbers]
        real = [[None if isnan(value) else round(value, 4) for value in column.tolist()] for column in places]
        yield from zip(kinds, *whole, *real, strict=True)


def _print_json(rows: Iterator[tuple[Any, ...]]) -> None:
    import json

    opening = "["
    for row in rows:
        sys.stdout.write(opening + json.dumps(dict(zip(COLUMNS, row, strict=True))))
        opening = ",\n"
    sys.stdout.write("]\n" if opening != "[" else "[]\n")


def _print_csv(rows: Iterator[tuple[Any, ...]]) -> None:
    import csv

    writer = csv.writer(sys.stdout)
    writer.writerow(COLUMNS)
    writer.writerows(rows)


WIDTHS = (13, 15, 7, 7, 6, 11, 11, 10, 10, 9)


def _print_table(rows: Iterator[tuple[Any, ...]]) -> None:
    def put(cells: tuple[str, ...]) -> None:
        padded = (cell.rjust(width) for cell, width in zip(cells[1:], WIDTHS[1:], strict=True))
        sys.stdout.write(cells[0].ljust(WIDTHS[0]) + "".join(padded) + "\n")

    put(("task", "lines", "road", "layer", "tool", "t_start", "t_end", "x", "y", "flow"))
    for kind, first, last, road, layer, tool, *places in rows:
        numbers = ("-" if place is None else f"{place:.3f}" for place in places)
        put((kind, f"{first}-{last}", str(road), str(layer), str(tool), *numbers))
