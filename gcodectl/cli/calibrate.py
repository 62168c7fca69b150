"""`gcodectl calibrate`: keep what is known of materials, and guess for a new one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gcodectl.calibrate.calibration import Attributes, Calibration
    from gcodectl.calibrate.evaluation import Errors
    from gcodectl.calibrate.suggestion import Suggestion
    from gcodectl.flow.flow_model import FlowModel

app = typer.Typer(
    help="Known calibrations, and a first guess for a new material.",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
)

Store = Annotated[Path, typer.Argument(help="File of the store (SQLite).")]
Words = Annotated[
    list[str], typer.Argument(metavar="NAME=VALUE...", help="material=NAME and what else is known, units as in `list`.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@app.command()
def add(
    store: Store,
    words: Words,
    source: Annotated[str, typer.Option(help="What tells it from another one of the same numbers.")] = "",
) -> None:
    """Add one calibration: its attributes and control parameters as name=value."""
    from gcodectl.calibrate.calibration import PARAMETERS, from_words
    from gcodectl.calibrate.store import add as put
    from gcodectl.errors import UsageError

    one = from_words(_split(words), source)
    if all(getattr(one.parameters, name) is None for name in PARAMETERS):
        raise UsageError(f"a calibration has at least one control parameter: {', '.join(PARAMETERS)}")
    new = put(store, [one])
    typer.echo(f"{one.material} {'added to' if new else 'was in already:'} {store}", err=True)


@app.command("list")
def list_calibrations(store: Store, as_json: AsJson = False) -> None:
    """List the calibrations of a store, and the units of everything."""
    import dataclasses
    import json

    from gcodectl.calibrate.calibration import UNITS
    from gcodectl.calibrate.store import read

    known = read(store)
    if as_json:
        typer.echo(json.dumps([dataclasses.asdict(one) for one in known]))
        return
    for one in known:
        told = {**dataclasses.asdict(one.attributes), **dataclasses.asdict(one.parameters)}
        said = [f"{name}={_number(value)}" for name, value in told.items() if value is not None and name != "material"]
        typer.echo(f"{one.material} ({one.source or 'by hand'}): {' '.join(said)}")
    materials = {one.material for one in known}
    typer.echo(f"{len(known)} calibrations of {len(materials)} materials", err=True)
    typer.echo(f"units: {', '.join(f'{name} {unit}' for name, unit in UNITS.items())}", err=True)


@app.command("import")
def import_tools(
    store: Store,
    files: Annotated[list[Path], typer.Argument(help="Fab@Home tool files (.tool).")],
    material: Annotated[str | None, typer.Option(help="Their material, where their names do not tell it.")] = None,
) -> None:
    """Import Fab@Home tool files; one that is odd is said by name, one that cannot be used is left out."""
    from gcodectl.calibrate.store import add as put
    from gcodectl.calibrate.toolfile import read_tool
    from gcodectl.errors import InputError

    found, refused = [], []
    for file in files:
        try:
            tool = read_tool(file, material)
        except InputError as error:
            refused.append(str(error))
            continue
        found.append(tool.calibration)
        for odd in tool.odd:
            typer.echo(f"{file.name}: {odd}", err=True)
    for reason in refused:
        typer.echo(f"left out: {reason}", err=True)
    if not found:
        raise InputError("none of these files could be used", source=str(store))
    new = put(store, found)
    materials = len({one.material for one in found})
    typer.echo(f"{new} of {len(files)} files added to {store}: {materials} materials", err=True)


@app.command()
def suggest(
    store: Store,
    words: Words,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write it as JSON too.")] = None,
    learned: Annotated[
        Path | None,
        typer.Option(help="Library (.npz): guess a flow model too, from its materials that the store describes."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Suggest the control parameters of a material, each with a range, and the nearest known materials."""
    import json

    from gcodectl.calibrate.calibration import PARAMETERS, from_words
    from gcodectl.calibrate.store import read
    from gcodectl.calibrate.suggestion import suggest as guess
    from gcodectl.cli.common import write_whole
    from gcodectl.errors import UsageError

    asked = from_words(_split(words))
    told = [name for name in PARAMETERS if getattr(asked.parameters, name) is not None]
    if told:
        raise UsageError(f"{', '.join(told)}: that is what is suggested; give attributes only")
    known = read(store)
    found = guess(known, asked.attributes)
    model = None if learned is None else _model(learned, known, asked.attributes)
    text = json.dumps(_facts(found) | ({"model": model.table()} if model else {}))
    if output is not None:
        write_whole(output, [text.encode()])
    typer.echo(text if as_json else _table(found))
    if model is not None and not as_json:
        typer.echo(f"flow model: {model.sentence()}")


@app.command()
def evaluate(store: Store, as_json: AsJson = False) -> None:
    """Say how good guesses are: every learner, one sample left out and one material left out, beside the mean."""
    import json

    from gcodectl.calibrate.evaluation import evaluate as judge
    from gcodectl.calibrate.store import read

    found = judge(read(store))
    if as_json:
        typer.echo(json.dumps([_judged(one) for one in found]))
        return
    typer.echo("median error: a factor; of acceldelay and deceldelay, the difference as a share of their time")
    typer.echo(f"{'parameter':14} {'learner':16} {'one out':>8} {'material out':>13} {'a material':>11} {'n':>4}")
    for one in found:
        row = _judged(one)
        numbers = f"{row['one_out']:8.3f} {row['material_out']:13.3f} {row['over_materials']:11.3f} {row['samples']:4}"
        typer.echo(f"{one.parameter:14} {one.learner:16} {numbers}")
    typer.echo("chosen: what `suggest` does; for each material its learner was chosen on the others", err=True)


def _model(learned: Path, known: Sequence[Calibration], attributes: Attributes) -> FlowModel:
    from gcodectl.errors import InputError
    from gcodectl.flow.library import load_library
    from gcodectl.learn.model_guess import guess_model, learned_models

    models = learned_models(load_library(learned), known)
    if not models:
        raise InputError("has no learned material that the store describes under the same name", source=str(learned))
    return guess_model(models, attributes, models[-1][1].flow).model


def _split(words: list[str]) -> dict[str, str]:
    from gcodectl.errors import UsageError

    found: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals:
            raise UsageError(f"{word!r} is no name=value")
        if name in found:
            raise UsageError(f"{name} is given twice")
        found[name] = value
    return found


def _judged(one: Errors) -> dict[str, Any]:
    return {
        "parameter": one.parameter, "learner": one.learner, "factor": one.is_factor,
        "one_out": one.median(one.one_out), "material_out": one.median(one.material_out),
        "over_materials": one.over_materials(one.material_out), "samples": len(one.one_out),
    }  # fmt: skip


def _facts(found: Suggestion) -> dict[str, Any]:
    import dataclasses

    told = dataclasses.asdict(found.attributes)
    return {
        "attributes": {name: value for name, value in told.items() if value is not None},
        "parameters": dataclasses.asdict(found.parameters), "low": dataclasses.asdict(found.low),
        "high": dataclasses.asdict(found.high), "learners": found.learners,
        "nearest": [{"material": name, "distance": far} for name, far in found.nearest], "notes": list(found.notes),
    }  # fmt: skip


def _table(found: Suggestion) -> str:
    from gcodectl.calibrate.calibration import PARAMETERS, UNITS

    lines = [f"{'parameter':14} {'guess':>9} {'from':>9} {'to':>9}  unit       by"]
    for name in PARAMETERS:
        value, low, high = (getattr(one, name) for one in (found.parameters, found.low, found.high))
        ends = f"{_number(low):>9} {_number(high):>9}" if low is not None and high is not None else f"{'?':>9} {'?':>9}"
        if value is not None:
            lines.append(f"{name:14} {_number(value):>9} {ends}  {UNITS[name]:9}  {found.learners.get(name, '')}")
    near = ", ".join(f"{name} ({far:.2f})" for name, far in found.nearest)
    lines.append(f"nearest known materials, in ranges of the attributes: {near}")
    return "\n".join([*lines, *found.notes])


def _number(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "?" if value is None else str(value)
