"""Replay: the learner run over a session's trials, and what it makes of them.

    q: as measured, and corrected by what was weighed (`session.weighing`)

    trial 0: u, q --> nominal model --> law --+
                                              +--> learner: observe 0, 1, ... with the signals that were printed
    trials 0 .. n ----------------------------+         --> converged?  the next signal?

There is no step experiment on a machine: the nominal model is that of the first trial.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.flow.limits import within_limits
from gcodectl.gcode.bounds import KEEP
from gcodectl.learn.convergence import convergence
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import Model, identify
from gcodectl.learn.model_learner import ModelLearner
from gcodectl.learn.reference import Routine
from gcodectl.learn.training import Setup
from gcodectl.learn.trials import Limits
from gcodectl.session.printout import Printout
from gcodectl.session.record import Session, Trial
from gcodectl.session.weighing import counted


def limits_of(printout: Printout) -> Limits:
    """What the plunger can do behind the machine's firmware, which lays no thicker bead than it may along the path."""
    machine = printout.machine
    thickest = KEEP * machine.e_limits.max_bead
    return Limits(min(machine.max_flow, thickest * printout.layout.speed), machine.followed_slew)


def first_signal(routine: Routine, printout: Printout, wanted: Floats | None = None) -> Floats:
    """Return trial 0's signal: `wanted`, or the flow asked for, within what the plunger can do."""
    limits = limits_of(printout)
    return within_limits(routine.q_ref if wanted is None else wanted, limits.max_flow, limits.max_flow_slew, routine.dt)


def replay(session: Session) -> Setup:
    """Return the learner that has seen every measured trial, in order, and what it was set up with.

    Raises InputError where nothing was measured, or where what was measured does not follow the plunger.
    """
    setup, measured = session.setup, counted(session)
    if not measured or measured[0].number != 0:
        raise InputError(
            "trial 0 is not measured, and all others build on it: print trial-00.gcode, measure it, and call "
            "`gcodectl learn next --trial 0`"
        )
    machine, routine = setup.printout.machine, setup.routine
    model = nominal_model(measured[0], routine.dt)
    law = Law(dataclasses.replace(model, delay=0.0), routine.dt)
    learner = ModelLearner(routine, law, limits_of(setup.printout), max_trials=setup.max_trials, first=measured[0].u)
    for one in measured:
        learner.signal, learner.stop = one.u, None  # as printed, and although it had once been called settled
        learner.observe(one.q, one.number)
    return Setup(machine, model, routine, learner, convergence(law))


def nominal_model(trial: Trial, dt: float) -> Model:
    """Return the nominal model of one measured trial."""
    try:
        return identify(trial.u, trial.q, dt)
    except InputError as error:
        raise InputError(
            f"{error}; see that the extruder pushes at all, and that the places are counted as {trial.file} says"
        ) from error


def deviation(trial: Trial) -> float | None:
    """Return how sure a trial's flow is: the rms over time of the mean's standard error, mm^3/s; None for one print."""
    if len(trial.prints) < 2:
        return None
    rows = np.stack([one.q for one in trial.prints])
    return float(np.sqrt(np.mean(rows.var(axis=0, ddof=1)) / len(rows)))
