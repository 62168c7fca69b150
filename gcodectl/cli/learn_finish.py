"""`gcodectl learn finish`: a session's best trial, and the flow model of all, as a material to filter with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def finish(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="Folder of the session.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Library to add the set to (.npz); made if missing.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the record as JSON.")] = False,
) -> None:
    """Segment the best trial, store it, and say what was reached and how sure it is."""
    import json

    from gcodectl.cli.learn_table import slow, sure
    from gcodectl.flow.library import Library, load_library, save_library
    from gcodectl.session.record import load
    from gcodectl.session.steps import library

    now = load(session)
    known = load_library(output) if output.exists() else Library(())
    one, setup = library(now)
    save_library(known.add(one), output)
    if as_json:
        typer.echo(json.dumps({"material": one.material, "nozzle": one.nozzle, "file": str(output),
                               **dict(one.training)}))  # fmt: skip
        return
    for sentence in sure(now, setup):
        typer.echo(sentence)
    if note := slow(now, setup):
        typer.echo(f"note: {note}")
    typer.echo(f"{one.key} stored in {output}; use it with: gcodectl filter part.gcode --machine "
               f"{setup.machine.name} --material {output}")  # fmt: skip
