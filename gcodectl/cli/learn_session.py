"""`gcodectl learn start|next|drop|status`: learning on a machine, one print after another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from gcodectl.learn.training import Setup
    from gcodectl.session.record import Session

Folder = Annotated[Path, typer.Argument(metavar="SESSION", help="Folder of the session.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def start(
    session: Folder,
    machine: Annotated[str, typer.Option("--machine", "-m", help="Machine profile: a name, or a .toml file.")],
    material: Annotated[str, typer.Option(help="Name to store the signals by.")],
    nozzle: Annotated[float | None, typer.Option(help="Nozzle diameter, mm (default: the machine's).")] = None,
    flow: Annotated[float | None, typer.Option(help="Nominal flow, mm^3/s (default: a fifth of max_flow).")] = None,
    height: Annotated[
        float | None, typer.Option(help="Of the nozzle above the bed, mm (default: 0.7 nozzles).")
    ] = None,
    lag: Annotated[float, typer.Option(help="How late the flow may answer, s: longer lags, longer trials.")] = 3.0,
    trials: Annotated[int, typer.Option(min=2, help="The most trials to plan.")] = 10,
    guess: Annotated[
        Path | None, typer.Option(help="Begin with what `calibrate suggest -o` wrote (default: the flow asked for).")
    ] = None,
    begin: Annotated[
        Path | None, typer.Option(metavar="FILE", help="G-code before each trial: homing, heating (default: G28).")
    ] = None,
    end: Annotated[Path | None, typer.Option(metavar="FILE", help="G-code after each trial.")] = None,
    date: Annotated[str | None, typer.Option(help="Date for the record (default: today's).")] = None,
) -> None:
    """Begin a session: writes its first trial, to be printed and measured."""
    import dataclasses
    import datetime

    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.cli.learn_folder import gcode_of, keep
    from gcodectl.cli.learn_table import printing
    from gcodectl.config import load_machine
    from gcodectl.errors import UsageError
    from gcodectl.learn.first_trial import first_trial
    from gcodectl.session.held import held
    from gcodectl.session.printout import BEGIN
    from gcodectl.session.record import NAME
    from gcodectl.session.steps import begin as begin_session

    announce_compiling()
    profile = load_machine(machine)
    if nozzle is not None:
        profile = dataclasses.replace(profile, nozzle=nozzle)
    occupied = UsageError(f"{session} holds a session already: go on with `learn next`, or name another folder")
    if (session / NAME).exists():
        raise occupied
    made = begin_session(
        profile, material=material, flow=flow, height=height, lag=lag, max_trials=trials,
        gcode=(BEGIN if begin is None else gcode_of(begin, profile), "" if end is None else gcode_of(end, profile)),
        date=date or datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        first=None if guess is None else first_trial(guess, profile), guess=guess.name if guess else "",
    )  # fmt: skip
    session.mkdir(parents=True, exist_ok=True)
    with held(session):
        if (session / NAME).exists():  # since
            raise occupied
        keep(made, session)
    typer.echo(printing(made, made.trials[0], session))
    if begin is None:
        typer.echo(f"It begins with {BEGIN} and heats nothing: --begin FILE has other G-code before each trial.")


def next_trial(
    session: Folder,
    measured: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE.csv", help="Of one print: t,q or s,area or s,width. Once a print, where repeated."),
    ] = None,
    images: Annotated[
        list[Path] | None, typer.Option(metavar="PHOTO", help="Photographs of one print; once a photograph.")
    ] = None,
    scale: Annotated[
        float | None, typer.Option(help="Of photographs without a sheet, taken from straight above: pixels a mm.")
    ] = None,
    trial: Annotated[
        int | None, typer.Option(help="Which trial was printed (default: the one that waits); again: is averaged.")
    ] = None,
    weighed: Annotated[
        list[str] | None,
        typer.Option(metavar="GRAMS", help="Of all that a print laid, with all digits of the scale; once a print."),
    ] = None,
    density: Annotated[
        float | None, typer.Option(help="Of what is weighed, g/cm^3: once a session (default: as told before).")
    ] = None,
    shift: Annotated[float, typer.Option(help="Add to the measured times, s.")] = 0.0,
    anyway: Annotated[bool, typer.Option("--anyway", help="Take a measurement with faults as it is.")] = False,
    as_json: AsJson = False,
) -> None:
    """Take what was measured of a print, say how far learning is, and write the next trial."""
    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.cli.learn_folder import keep
    from gcodectl.cli.learn_table import tell
    from gcodectl.errors import UsageError
    from gcodectl.session.held import held
    from gcodectl.session.measured import read_measured
    from gcodectl.session.photographs import photographed
    from gcodectl.session.record import load
    from gcodectl.session.steps import advance, take
    from gcodectl.session.weights import read_weight
    from gcodectl.vision.photo import write_photograph

    announce_compiling()
    if bool(measured) == bool(images):
        also = "; --weighed goes with the measurement of the same print" if weighed else ""
        raise UsageError(f"say what was measured: --measured FILE.csv, or --images PHOTO{also}")
    weights = [read_weight(one) for one in weighed or []]
    series = [read_measured(path) for path in measured or []]
    drawn = None
    with held(session):
        now = load(session)
        if images:
            one, drawn = photographed(now, images, scale)
            series = [one]
        now, setup = advance(take(now, trial, series, shift, anyway, weights=weights, density=density))
        keep(now, session)
    if images and drawn is not None:
        seen = session / f"{images[0].stem}.seen.jpg"
        write_photograph(seen, drawn)
        typer.echo(f"{seen}: see whether the edges lie where the road ends", err=as_json)
    tell(now, setup, session, as_json)


def drop(
    session: Folder,
    trial: Annotated[int, typer.Argument(help="Its number.")],
    which: Annotated[
        int | None, typer.Option("--print", help="Forget only this print of it, the first being 1 (default: all).")
    ] = None,
) -> None:
    """Forget the measurement of a trial, which can be measured again; what was planned with it stays as it is."""
    from gcodectl.cli.learn_folder import keep
    from gcodectl.cli.learn_table import printing, tell
    from gcodectl.session.held import held
    from gcodectl.session.record import load
    from gcodectl.session.steps import advance
    from gcodectl.session.steps import drop as dropped

    with held(session):
        now, setup = dropped(load(session), trial, which), None
        if now.measured and now.measured[0].number == 0:
            now, setup = advance(now)
        keep(now, session)
    if which is not None:
        typer.echo(f"forgotten: {now.trials[trial].dropped[-1]}")
    if trial > 0 and not now.trials[trial].prints:  # of the first, what follows says so
        again = session / now.trials[trial].file
        typer.echo(f"print {again} again, and give its measurement with --trial {trial}, or go on without it")
    if setup is None:
        typer.echo(printing(now, now.trials[0], session))
    else:
        tell(now, setup, session, as_json=False)


def status(
    session: Folder,
    plot: Annotated[Path | None, typer.Option(metavar="PNG", help="Draw the flow, and the error by trial.")] = None,
    as_json: AsJson = False,
) -> None:
    """Say how far a session is and what it waits for; writes files of it that are missing."""
    import json

    from gcodectl.cli.learn_folder import complete
    from gcodectl.cli.learn_table import plan, printing, tell
    from gcodectl.errors import UsageError
    from gcodectl.session.held import held
    from gcodectl.session.record import load
    from gcodectl.session.replay import replay

    with held(session):
        now = load(session)
        complete(now, session)
    if not now.measured or now.measured[0].number != 0:
        if plot is not None:
            raise UsageError("trial 0 is not measured, so there is nothing to draw")
        typer.echo(json.dumps(plan(now)) if as_json else printing(now, now.trials[0], session))
        return
    setup = replay(now)
    if plot is not None:
        _draw(now, setup, plot)
    tell(now, setup, session, as_json)


def _draw(session: Session, setup: Setup, path: Path) -> None:
    import numpy as np

    from gcodectl.report.session import plot_session
    from gcodectl.session.weighing import counted

    seen = counted(session)
    learner, routine = setup.learner, session.setup.routine
    plot_session(
        routine.t, routine.q_ref, [one.number for one in seen], [one.q for one in seen],
        np.array([one.rms for one in learner.trials]), learner.trials.index(learner.best), path,
        f"{session.setup.material} on {setup.machine.name}",
        (f"simulated on {session.setup.plant}; " if session.setup.plant else "")
        + f"{len(learner.trials)} trials measured; stop: {learner.stop or 'not yet'}",
    )  # fmt: skip
