"""Steps: what each command does to a session; no files, no output.

begin --> trial 0 --> take (measured) --> advance --> trial 1 --> take --> advance --> ... --> library
                          ^                  |
                          +---- drop --------+      what is dropped may be measured again
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.errors import InputError, UnsafeError, UsageError
from gcodectl.flow.library import BasisSet
from gcodectl.learn import training
from gcodectl.learn.reference import Routine, training_routine, with_levels
from gcodectl.learn.trials import FAINT, Stop
from gcodectl.session.checking import Fault, alignment, delay_of, extent, resample, resting, saturation, scale, tallness
from gcodectl.session.layout import lay_out
from gcodectl.session.measured import Series
from gcodectl.session.printout import Printout
from gcodectl.session.record import Print, Session, Setup, Trial, Weight, rounded
from gcodectl.session.replay import first_signal, replay
from gcodectl.session.weighing import told, with_weight
from gcodectl.session.weights import with_density

HEIGHT = 0.7
"""Nozzles above the bed, where nothing else is said."""
TALLEST = 3.0
"""Nozzles above the bed at the most; from there a strand falls, and is no road."""
PAUSE = 0.2
"""s; of the routine's corner."""
SAME = 1e-6
"""Share of the flow that two measurements differ by at the most where they are one."""


def begin(
    machine: Machine,
    *,
    material: str,
    flow: float | None = None,
    height: float | None = None,
    lag: float = 3.0,
    max_trials: int = 10,
    gcode: tuple[str, str],
    date: str,
    first: Callable[[Routine], Floats] | None = None,
    guess: str = "",
) -> Session:
    """Lay out a session on `machine`, whose nozzle is the one in use, and its first trial.

    `flow` is the nominal flow (mm^3/s; None: a fifth of the plunger's cap), `height` the nozzle's above the bed (mm),
    `lag` what the extruder's may be (s), `gcode` what goes before and after a trial. Raises UsageError where the
    routine cannot be, or does not fit on the bed.
    """
    nozzle = machine.nozzle
    flow = training.SHARE_OF_CAP * machine.max_flow if flow is None else flow
    height = HEIGHT * nozzle if height is None else height
    for name, value in (("flow", flow), ("height", height), ("lag", lag)):
        if not (np.isfinite(value) and value > 0):
            raise UsageError(f"--{name} is {value:g}; it must be a positive number")
    if height > TALLEST * nozzle:
        raise UsageError(
            f"--height is {height:g} mm, and a bead of a {nozzle:g} mm nozzle is no taller than {TALLEST * nozzle:g} mm"
        )
    if not material.strip():
        raise UsageError("--material needs a name, to store the signals by")
    if flow > machine.max_flow:
        raise UsageError(f"--flow is {flow:g} mm^3/s, and the plunger of {machine.name} does {machine.max_flow:g}")
    speed = flow / (nozzle * height)
    routine = with_levels(
        training_routine(flow, lag=lag, speed=speed, accel=machine.accel, pause=PAUSE, dt=training.DT)
    )
    layout = lay_out(machine, nozzle=nozzle, duration=routine.duration, speed=speed, lag=lag)
    printout = Printout(machine, layout, flow, height, lag, *gcode)
    setup = Setup(material, nozzle, routine, printout, max_trials, date, guess)
    u = first_signal(routine, printout, None if first is None else first(routine))
    return Session(setup, (Trial(0, rounded(u, flow)),))


def take(
    session: Session, number: int | None, series: Sequence[Series], shift: float = 0.0, anyway: bool = False,
    *, weights: Sequence[Weight] = (), density: float | None = None,
) -> Session:  # fmt: skip
    """Return the session with measured prints of a trial (None: the one that waits) added to it.

    Raises InputError for the first print with a fault, of all its faults; `anyway` makes them notes. `shift` (s) is
    added to the times of all. `weights` are of all that each print laid, in the same order, `density` (g/cm^3) is what
    it is made of; UsageError where either is missing.
    """
    if weights and len(weights) != len(series):
        raise UsageError(
            f"--weighed is given {len(weights)} times for {len(series)} prints: give it once a print, in their order, "
            "and prints that were not weighed in a call of their own"
        )
    session = with_density(session, density, len(weights), anyway)
    trial = _waiting(session) if number is None else session.trial(number)
    for k, one in enumerate(series):
        made, faults = _print(session, trial, one, shift)
        if weights:
            made, more = _weighed(session.setup, trial, made, weights[k])
            faults = faults or more  # a measurement that is off says little of its weight
        if faults and not anyway:
            raise InputError(
                f"{'; it '.join(fault.sentence for fault in faults)}. --anyway takes it as it is; the session is as it "
                "was", source=one.source,
            )  # fmt: skip
        trial = dataclasses.replace(trial, prints=(*trial.prints, made))
        session = session.with_trial(trial)
    return session


def advance(session: Session) -> tuple[Session, training.Setup]:
    """Plan the trial to come from all that is measured; the session gets none where learning has stopped.

    A number stands for the same signal for ever: a trial that waits may be on the printer, and stays as it is.
    """
    setup = replay(session)
    if setup.learner.stop is None and session.trials[-1].prints:
        u = rounded(setup.learner.signal, session.setup.routine.flow)
        session = session.with_trial(Trial(len(session.trials), u))
    return session, setup


def drop(session: Session, number: int, place: int | None = None) -> Session:
    """Return the session without a print of a trial, the first being 1, or (None) without all its prints.

    They may be measured again. Raises UsageError where there is no such print.
    """
    trial = session.trial(number)
    if not trial.prints:
        raise UsageError(f"trial {number} has no measurement to drop")
    if place is not None and not 1 <= place <= len(trial.prints):
        raise UsageError(f"trial {number} has no print {place}: it has {len(trial.prints)}")
    gone = trial.prints if place is None else (trial.prints[place - 1],)
    kept = tuple(one for one in trial.prints if not any(one is other for other in gone))
    sources = tuple(one.source for one in gone)
    return session.with_trial(dataclasses.replace(trial, prints=kept, dropped=(*trial.dropped, *sources)))


def library(session: Session) -> tuple[BasisSet, training.Setup]:
    """Segment the best trial; UnsafeError where none was better than the first."""
    setup = replay(session)
    learner, prints = setup.learner, sum(len(one.prints) for one in session.measured)
    flow, error = session.setup.routine.flow, learner.trials[0].rms
    if learner.best.number == 0 and len(learner.trials) > 1 and error < FAINT * flow:
        raise UnsafeError(
            f"trial 0 is off by {100 * error / flow:.0f} % of the flow already, and no trial was better: as far as "
            "these measurements show, this extruder needs no signals"
        )
    if learner.best.number == 0:
        raise UnsafeError(
            "no trial is better than the first one, so there is nothing to store"
            + (f": {learner.notes[-1]}" if len(learner.trials) > 1 else ": go on with `gcodectl learn next`")
        )
    learner.stop = learner.stop or Stop.ENDED
    own = session.setup
    made_by = {
        "plant": own.plant or "a machine", "prints": prints, **({"guess": own.guess} if own.guess else {}),
        **({"weighed": weighed} if (weighed := told(session)) else {}),
    }  # fmt: skip
    one = training.finish(setup, material=own.material, nozzle=own.nozzle, made_by=made_by, date=own.date)
    return one, setup


def _weighed(setup: Setup, trial: Trial, one: Print, weight: Weight) -> tuple[Print, list[Fault]]:
    """Return a print with its weight, and what is wrong with that."""
    one, faults, notes = with_weight(setup, trial.u, one, weight)
    said = tuple(f"{fault.what}: {fault.sentence}" for fault in faults)
    return dataclasses.replace(one, faults=(*one.faults, *said), notes=(*one.notes, *notes)), faults


def _waiting(session: Session) -> Trial:
    """Return the trial that waits for its measurement; UsageError where none does."""
    if session.waiting is None:
        raise UsageError(
            "no trial waits for a measurement, learning has stopped: call `gcodectl learn finish`, or name a trial "
            "that was printed again with --trial"
        )
    return session.waiting


def _print(session: Session, trial: Trial, series: Series, shift: float) -> tuple[Print, list[Fault]]:
    """Return one print as measured, and what is wrong with it."""
    setup = session.setup
    routine, speed = setup.routine, setup.printout.layout.speed
    faults = [*extent(series, routine, speed, shift), *saturation(series), *tallness(series, setup.printout.height)]
    q = rounded(resample(series, routine, speed, setup.printout.height, shift), routine.flow)
    others = [(one.number, other) for one in session.trials for other in one.prints]
    for number, other in others:
        if float(np.abs(other.q - q).max()) < SAME * routine.flow:
            raise InputError(
                f"is what {other.source} was, trial {number}'s measurement: give trial {trial.number}'s",
                source=series.source,
            )
    if not any(fault.what == "scale" for fault in faults):  # one unit at a time
        faults += scale(q, trial.u)
    delay = 0.0
    if not faults:  # else it would not tell much
        delay = delay_of(trial.u, q, routine.dt)
        faults += alignment(delay, [other.delay for _, other in others if not other.faults], shift)
    said = tuple(f"{fault.what}: {fault.sentence}" for fault in faults)
    notes = (*series.notes, *resting(q, trial.u, routine.dt, routine.flow))
    return Print(series.source, q, delay, said, notes, series.way), faults
