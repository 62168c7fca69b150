"""`gcodectl library`: look at basis signals, and carry them in and out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcodectl.cli.options import group

if TYPE_CHECKING:
    from gcodectl.flow.library import BasisSet, Library

app = group("List, show, export and import basis signals.")

Source = Annotated[Path | None, typer.Option("--library", help="Library file (.npz); without it, the built-in ones.")]
Nozzle = Annotated[float | None, typer.Option(help="Nozzle diameter, mm: the set that is nearest to it.")]


@app.command("list")
def list_sets(
    file: Annotated[Path | None, typer.Argument(help="Library file (.npz); without it, the built-in ones.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the basis sets of a library file, or the built-in ones."""
    import json

    from gcodectl.flow.library import open_library

    library = open_library(file)
    if as_json:
        typer.echo(json.dumps([_facts(one) for one in library.sets]))
        return
    head = f"{'flow mm^3/s':>11} {'u per flow':>10} {'trials':>6} {'rms ratio':>9}"
    typer.echo(f"{'material@nozzle':24} {head}  learned on")
    for one in library.sets:
        made = one.training
        numbers = f"{one.flow:11g} {one.steady:10.3f} {made.get('trials', '-')!s:>6} {made.get('ratio', '-')!s:>9}"
        typer.echo(f"{one.key:24} {numbers}  {made.get('plant', '-')} ({made.get('date', '-')})")


@app.command()
def show(
    material: Annotated[str, typer.Argument(help="Material's name.")],
    library: Source = None,
    nozzle: Nozzle = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the signals into this PNG file.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show one basis set: its leads and lengths, what made it, and its signals."""
    import json

    from gcodectl.flow.library import open_library
    from gcodectl.records import TaskKind
    from gcodectl.report.ascii import draw

    one = open_library(library).find(material, nozzle)
    if plot is not None:
        from gcodectl.report.learning import plot_set

        plot_set(one, plot)
    if as_json:
        typer.echo(json.dumps(_facts(one)))
        return
    typer.echo(f"{one.key}: learned at {one.flow:g} mm^3/s, a sample every {one.dt:g} s, u = {one.steady:.4f} flow")
    typer.echo(
        f"flow model: {one.model.sentence()}" if one.model else "no flow model: no structure predicted its trials"
    )
    typer.echo(f"{'task':14} {'lead s':>7} {'K':>5} {'least':>9} {'most':>9} {'volume mm^3':>12} {'dip s':>6}")
    for kind in TaskKind:
        signal = one.signals[kind]
        values = signal.values
        span = f"{values.min():9.3f} {values.max():9.3f} {values.sum() * one.dt:12.3f}"
        typer.echo(f"{kind.label:14} {signal.lead:7.2f} {len(values):5} {span} {signal.dip:6.2f}")
    for kind in (TaskKind.START, TaskKind.CORNER, TaskKind.STOP):
        signal = one.signals[kind]
        typer.echo(f"\n{kind.label}, u in mm^3/s over seconds from the task")
        typer.echo("\n".join(draw(signal.values, one.dt, -signal.lead)))
    typer.echo("\nwhat made it")
    for name, value in one.training.items():
        typer.echo(f"  {name}: {value if isinstance(value, str) else json.dumps(value)}")


@app.command()
def export(
    materials: Annotated[list[str] | None, typer.Argument(help="Which materials (default: all).")] = None,
    library: Source = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Where to (default: standard output).")] = None,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="CSV instead of JSON; implied by an output named .csv.")
    ] = False,
) -> None:
    """Write basis sets as JSON or CSV."""
    from gcodectl.flow.exchange import to_csv, to_json

    chosen = _choose(library, materials or [])
    as_csv = as_csv or (output is not None and output.suffix == ".csv")
    text = to_csv(chosen) if as_csv else to_json(chosen)
    if output is None:
        typer.echo(text, nl=False)
    else:
        output.write_text(text, encoding="utf-8")
        typer.echo(f"{len(chosen.sets)} set{'s' * (len(chosen.sets) != 1)} written to {output}", err=True)


@app.command("import")
def import_sets(
    file: Annotated[Path, typer.Argument(help="What `export` wrote: JSON, or CSV if it is named .csv.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Library to add the sets to (.npz); made if missing.")],
) -> None:
    """Add exported basis sets to a library; a set of the same material and nozzle is replaced."""
    from gcodectl.errors import InputError
    from gcodectl.flow.exchange import from_csv, from_json
    from gcodectl.flow.library import Library, load_library, save_library

    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", source=str(file)) from error
    read = from_csv if file.suffix == ".csv" else from_json
    found = read(text, str(file))
    library = load_library(output) if output.exists() else Library(())
    for one in found.sets:
        library = library.add(one)
    save_library(library, output)
    typer.echo(f"{', '.join(one.key for one in found.sets)} stored in {output}", err=True)


def _choose(path: Path | None, materials: list[str]) -> Library:
    from gcodectl.flow.library import Library, open_library

    library = open_library(path)
    if not materials:
        return library
    for material in materials:
        library.find(material)  # an unknown one is a UsageError
    return Library(tuple(one for one in library.sets if one.material in materials))


def _facts(one: BasisSet) -> dict[str, object]:
    signals = {
        kind.label: {"lead": signal.lead, "K": len(signal.values), "dip": signal.dip}
        for kind, signal in one.signals.items()
    }
    return {
        "material": one.material,
        "nozzle": one.nozzle,
        "dt": one.dt,
        "flow": one.flow,
        "steady": one.steady,
        "signals": signals,
        "training": dict(one.training),
    }
