"""What is said of a session: its trials as a table, as JSON, and how sure what it found is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from pathlib import Path

    from gcodectl.columns import Floats
    from gcodectl.learn.model_learner import ModelLearner
    from gcodectl.learn.training import Setup
    from gcodectl.session.record import Session, Trial

LONGER = 1.5
"""A lag that many times the one that the routine was laid out for is said."""


def table(session: Session, setup: Setup) -> str:
    """Return the trials, one a line: prints, error with its standard error where it was printed again, share."""
    from gcodectl.cli.learn_weighed import lines_of
    from gcodectl.session.replay import deviation
    from gcodectl.session.weighing import counted

    learner, said = setup.learner, lines_of(session)
    errors = [trial.rms for trial in learner.trials]
    lines = [f"law on trial 0's model: {setup.check.sentence()}", "trial  prints  rms mm^3/s             of trial 0"]
    first = learner.trials[0].rms
    for trial, one in zip(learner.trials, counted(session), strict=True):
        sure = deviation(one)
        about = "" if sure is None else f"+- {sure:.3g}"
        mark = "  best" if trial is learner.best else ""
        lines.append(
            f"{one.number:5}  {len(one.prints):6}  {trial.rms:10.4g} {about:12}  {trial.rms / first:8.3f}{mark}"
        )
        many = len(one.prints) > 1
        lines += [f"       print {k}: {each.source}" for k, each in enumerate(one.prints, 1) if many]
        lines += [f"       taken although {fault}" for each in one.prints for fault in each.faults]
        lines += [f"       {sentence}" for sentence in said.get(one.number, [])]
    if learner.best.rms > min(errors):
        lines.append("best: the smallest error when each print's own factor, as a camera's, is taken out")
    return "\n".join(lines)


def plan(session: Session) -> dict[str, Any]:
    """Return the facts of a session whose trial 0 is not measured, as JSON values."""
    own = session.setup
    return {
        "material": own.material, "nozzle": own.nozzle, "machine": own.printout.machine.name, "flow": own.routine.flow,
        "model": None, "trials": [], "best": None, "stop": None,
        "waiting": None if session.waiting is None else session.waiting.file, "weighed": [],
    }  # fmt: skip


def facts(session: Session, setup: Setup) -> dict[str, Any]:
    """Return the same as the table as JSON values."""
    from gcodectl.cli.learn_weighed import tables_of
    from gcodectl.session.replay import deviation
    from gcodectl.session.weighing import counted, told

    weighed = tables_of(session)
    learner = setup.learner
    return {
        **plan(session),
        "model": {"K": setup.model.K, "tau": setup.model.tau, "delay": setup.model.delay},
        "trials": [
            {"number": one.number, "prints": [each.source for each in one.prints], "rms": trial.rms,
             "standard_error": deviation(one), "of_first": trial.rms / learner.trials[0].rms, "note": trial.note,
             "weighed": weighed[one.number], "faults": [fault for each in one.prints for fault in each.faults],
             "notes": [note for each in one.prints for note in each.notes], "dropped": list(one.dropped)}
            for trial, one in zip(learner.trials, counted(session), strict=True)
        ],
        "weighed": told(session),
        "best": learner.best.number,
        "stop": None if learner.stop is None else str(learner.stop),
        **({} if learner.stop is None else {"waiting": None}),
    }  # fmt: skip


def slow(session: Session, setup: Setup) -> str:
    """Return what there is to say where the extruder is slower than the routine was laid out for; else nothing."""
    lag, told = setup.model.tau, session.setup.printout.lag
    if lag < LONGER * told:
        return ""
    return (
        f"this extruder lags by {lag:.1f} s, and the trials were laid out for {told:g} s, so that one task's signal "
        f"runs into the next one's: for basis signals as good as the flow model, start again with --lag {lag:.1f}"
    )


def sure(session: Session, setup: Setup) -> list[str]:
    """Return sentences about what was reached and how sure it is."""
    from gcodectl.cli.learn_weighed import amount
    from gcodectl.learn.trials import FAINT
    from gcodectl.session.replay import deviation
    from gcodectl.session.weighing import counted

    learner = setup.learner
    best, first = learner.best, learner.trials[0]
    (one,) = (each for each in counted(session) if each.number == best.number)
    flow = session.setup.routine.flow
    off = deviation(one)
    said = [
        f"trial {best.number} of {len(learner.trials)}: rms {best.rms:.4g} mm^3/s, {best.rms / first.rms:.3f} of trial "
        f"{first.number}"
        + (f", +- {off:.3g} over {len(one.prints)} prints" if off is not None else ", printed once: no spread is known")
    ]
    if learner.fitted is not None:
        serves = "serves" if learner.model is not None else "does not predict well enough to serve"
        said.append(
            f"flow model ({learner.fitted.model.structure}) {serves}: it predicted the last trial, unseen, to "
            f"{100 * learner.missed:.1f} % of the flow"
        )
    factors = _factors(session, learner)
    if len(factors) > 1:
        spread = float(factors.std(ddof=1) / factors.mean())
        said.append(
            f"prints differ by {100 * spread:.1f} % in what they show of the same flow, so their mean is sure to "
            f"{100 * spread / len(factors) ** 0.5:.1f} %, what all prints share aside"
        )
    if best.rms < FAINT * flow and off is None:
        said.append("an error this small may be the measurement's own: print the best trial again to see")
    return said + amount(session)


def _factors(session: Session, learner: ModelLearner) -> Floats:
    """Return by how much more than the model says each print shows; none where there is no model."""
    import numpy as np

    from gcodectl.session.weighing import counted

    found = []
    for one in counted(session) if learner.fitted is not None else ():
        assert learner.fitted is not None, "asked above"
        predicted = learner.fitted.model.predict(one.u, session.setup.routine.dt)
        found += [float(predicted @ each.q) / float(predicted @ predicted) for each in one.prints]
    return np.array(found)


def printing(session: Session, trial: Trial, folder: Path) -> str:
    """Return what is to be done with a trial that waits."""
    from gcodectl.cli.learn_weighed import how_to_weigh

    setup = session.setup
    layout = setup.printout.layout
    return (
        f"print {folder / trial.file}, and measure along its path: {layout.length:.0f} mm from "
        f"X{layout.path[0, 0]:.1f} Y{layout.path[0, 1]:.1f}, {setup.routine.duration:.1f} s at {layout.speed:.2f} "
        f"mm/s.\nThen: gcodectl learn next {folder} --measured {trial.file.removesuffix('.gcode')}.csv   (columns t,q "
        f"or s,area or s,width; or --images of it on sheet.svg){how_to_weigh(session, trial)}"
    )


def tell(session: Session, setup: Setup, folder: Path, as_json: bool) -> None:
    """Say what is known so far, and what to do now."""
    import json

    if as_json:
        typer.echo(json.dumps(facts(session, setup)))
        return
    typer.echo(table(session, setup))
    if note := slow(session, setup):
        typer.echo(f"note: {note}")
    last = session.measured[-1]
    for each in last.prints:
        for sentence in each.notes:
            typer.echo(f"trial {last.number}: {each.source}: {sentence.removeprefix(f'{each.source}: ')}")
    learner = setup.learner
    if learner.trials[-1].note:
        typer.echo(f"trial {learner.trials[-1].number}: {learner.trials[-1].note}")
    if learner.stop is None and session.waiting is not None:
        typer.echo(printing(session, session.waiting, folder))
    else:
        typer.echo(f"Now: gcodectl learn finish {folder} -o {session.setup.material}.npz")
