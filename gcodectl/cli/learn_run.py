"""`gcodectl learn run`: find basis signals by trials on a simulated plant."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from gcodectl.learn.model import Extruder
    from gcodectl.learn.training import Setup
    from gcodectl.learn.trials import Trial


def run(
    plant: Annotated[str, typer.Option(help="What to learn on: a built-in plant, or path/to/file.py:Attribute.")],
    material: Annotated[str, typer.Option(help="Name to store the signals by.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Library to add the set to (.npz); made if missing.")],
    nozzle: Annotated[float | None, typer.Option(help="Nozzle diameter, mm (default: the machine's).")] = None,
    machine: Annotated[str, typer.Option(help="Machine profile: a name or a .toml file.")] = "syringe",
    flow: Annotated[float | None, typer.Option(help="Nominal flow, mm^3/s (default: a fifth of max_flow).")] = None,
    trials: Annotated[int, typer.Option(min=1, help="The most trials to run.")] = 31,
    noise: Annotated[float, typer.Option(min=0, help="Camera noise, as a multiple of a measured one's; 0: none.")] = 0,
    seed: Annotated[int, typer.Option(help="Seed of all that is random.")] = 0,
    guess: Annotated[
        Path | None,
        typer.Option(help="Begin with what `calibrate suggest -o` wrote (default: with the flow asked for)."),
    ] = None,
    date: Annotated[str | None, typer.Option(help="Date for the record (default: today's).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the record as JSON.")] = False,
) -> None:
    """Run the training routine trial after trial on a plant, and store the basis signals it gives."""
    import datetime
    import json

    from gcodectl.config import load_machine
    from gcodectl.errors import UnsafeError, UsageError
    from gcodectl.flow.library import Library, load_library, save_library
    from gcodectl.learn.first_trial import first_trial
    from gcodectl.learn.training import finish, prepare
    from gcodectl.learn.trials import Stop

    profile = load_machine(machine)
    nozzle = profile.nozzle if nozzle is None else nozzle
    if not nozzle > 0 or (flow is not None and not flow > 0):
        raise UsageError("nozzle and flow must be positive")
    library = load_library(output) if output.exists() else Library(())  # a file that is none must fail before learning
    extruder, measured = _bind(plant, seed=seed, flow=flow or 0.2 * profile.max_flow, noise=noise)
    first = None if guess is None else first_trial(guess, profile)
    setup = prepare(extruder, profile, nozzle=nozzle, flow=flow, max_trials=trials, first=first)
    _say(before(setup))
    with _progress(trials) as show:
        _run(measured(setup), setup, show)
    if setup.learner.stop is Stop.DIVERGING and setup.learner.best.number == 0:
        raise UnsafeError(f"{setup.learner.notes[-1]}; no trial was better than the first, so nothing is stored")
    made_by = {"plant": plant, "seed": seed, "noise": noise, **({"guess": guess.name} if guess else {})}
    day = date or datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    one = finish(setup, material=material, nozzle=nozzle, made_by=made_by, date=day)
    save_library(library.add(one), output)
    if as_json:
        typer.echo(json.dumps({"material": material, "nozzle": nozzle, "file": str(output), **dict(one.training)}))
    else:
        typer.echo(_table(setup))
        typer.echo(f"{one.key} stored in {output}")


def _bind(plant: str, *, seed: int, flow: float, noise: float) -> tuple[Extruder, Callable[[Setup], Extruder]]:
    """Return the plant as it is, for identification, and what makes the noisy one that a camera sees."""
    from plant_models.trial import as_extruder, measured_by_camera

    extruder = as_extruder(plant, seed=seed, flow=flow)

    def measured(setup: Setup) -> Extruder:
        return measured_by_camera(extruder, setup.routine.v, noise=noise, seed=seed) if noise else extruder

    return extruder, measured


def _run(extruder: Extruder, setup: Setup, show: Callable[[Trial], None]) -> None:
    from gcodectl.learn.trials import run_trials

    for trial in run_trials(extruder, setup.learner):
        show(trial)
        if trial.note:
            _say(f"trial {trial.number}: {trial.note}")


def before(setup: Setup) -> str:
    """Return what is known before the first trial."""
    model, routine = setup.model, setup.routine
    return (
        f"downward step: gain {model.K:.3f}, lag {model.tau:.2f} s, dead time {model.delay:.2f} s\n"
        f"routine: {routine.duration:.1f} s at {routine.flow:g} mm^3/s and {routine.speed:.1f} mm/s, "
        f"corner of {routine.dip:.2f} s\n"
        f"law on the nominal model: {setup.check.sentence()}"
    )


def _table(setup: Setup) -> str:
    first = setup.learner.trials[0].rms
    lines = ["trial  rms mm^3/s  of trial 0"]
    for trial in setup.learner.trials:
        mark = "  best" if trial is setup.learner.best else ""
        lines.append(f"{trial.number:5}  {trial.rms:10.4f}  {trial.rms / first:10.3f}{mark}")
    return "\n".join(lines)


def _say(text: str) -> None:
    typer.echo(text, err=True)


@contextmanager
def _progress(trials: int) -> Iterator[Callable[[Any], None]]:
    """Give a function that shows a trial: a bar on a terminal, nothing elsewhere."""
    import sys

    if not sys.stderr.isatty():
        yield lambda _trial: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("learning"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rms]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("learning", total=trials, rms="")

        def show(trial: Any) -> None:
            bar.update(task, advance=1, rms=f"rms {trial.rms:.4f} mm^3/s")

        yield show
