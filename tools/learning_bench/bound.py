"""What no learning can beat: the trial's signal with the least rms of the flow, found on the true plant.

    datum, rest --> the state in which a trial begins
    u    knots every KNOT s, straight in between, each within +-cap (and so far apart that no step is too steep)
    e    (q(u) - q_ref), all samples

    Gauss-Newton: de/du by moving one knot at a time (the plant is run on from its state at that knot), then the linear
    least squares within the bounds and a trust region around u; a step that does not help shrinks the region.

It reads the plant as no learner may, and finds a local optimum: what is near it is near the best. The firmware between
a signal and the plunger is left out.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.optimize import lsq_linear

from gcodectl.columns import Floats
from gcodectl.session.record import Session
from gcodectl.session.replay import limits_of
from plant_models.plant import Plant

KNOT = 0.06
"""s"""
ROUNDS = 10
NUDGE, CALM = 0.01, 1e-4
"""Share of the cap that a knot is moved by to see what it does; what a knot's change weighs."""


@dataclasses.dataclass(frozen=True)
class Problem:
    """A plant that has laid the datum and rested, a routine's flow, and knots."""

    plant: Plant
    reference: Floats
    dt: float
    cap: float
    every: int
    begin: Floats
    """The state."""

    @property
    def at(self) -> Floats:
        """Samples at which there are knots."""
        return np.arange(0, len(self.reference) + self.every, self.every, dtype=np.float64)

    def signal(self, knots: Floats) -> Floats:
        """Return u[n], mm^3/s."""
        return np.interp(np.arange(len(self.reference)), self.at, knots)

    def flow(self, u: Floats) -> Floats:
        """Return q[n], mm^3/s."""
        return np.asarray(self.plant.run(self.begin, u, self.dt)[1], dtype=np.float64)

    def slopes(self, knots: Floats) -> Floats:
        """Return dq/dknots, [sample, knot]."""
        u, nudge = self.signal(knots), NUDGE * self.cap
        q, n = self.flow(u), len(u)
        slopes = np.zeros((n, len(knots)))
        state, done = self.begin, 0
        for j, at in enumerate(self.at):
            first = min(max(int(at) - self.every, 0), n)
            if first > done:
                state, _ = self.plant.run(state, u[done:first], self.dt)
                done = first
            if first == n:
                continue
            moved = knots.copy()
            moved[j] += nudge
            row = np.interp(np.arange(first, n), self.at, moved)
            slopes[first:, j] = (self.plant.run(state, row, self.dt)[1] - q[first:]) / nudge
        return slopes


def problem_of(session: Session, plant: Plant) -> Problem:
    """Return the problem of a session's trials on a plant."""
    printout, dt = session.setup.printout, session.setup.routine.dt
    limits = limits_of(printout)
    state, _ = plant.run(plant.initial(), np.full(round(printout.layout.datum_lasts / dt), printout.flow), dt)
    state, _ = plant.run(state, np.zeros(round(printout.rest / dt)), dt)
    every = math.ceil(max(KNOT, 2.0 * limits.max_flow / limits.max_flow_slew) / dt - 1e-9)
    return Problem(plant, session.setup.routine.q_ref, dt, limits.max_flow, every, state)


def least_rms(problem: Problem, u: Floats) -> Floats:
    """Return the flow q[n], mm^3/s, of the best signal, searched for from u[n]."""
    cap = problem.cap
    knots = np.clip(np.interp(problem.at, np.arange(len(u)), u), -cap, cap)
    error, trust = problem.flow(problem.signal(knots)) - problem.reference, 0.5 * cap
    slopes: Floats | None = None
    for _ in range(ROUNDS):
        if slopes is None:
            slopes = problem.slopes(knots)
        rows = np.vstack([slopes, CALM * math.sqrt(len(error)) * np.eye(len(knots))])
        low, high = np.maximum(-cap - knots, -trust) - 1e-9, np.minimum(cap - knots, trust) + 1e-9
        step = lsq_linear(rows, np.append(-error, np.zeros(len(knots))), (low, high), max_iter=25).x
        found = problem.flow(problem.signal(knots + step)) - problem.reference
        if found @ found < 0.999 * error @ error:
            knots, error, slopes = knots + step, found, None
        elif trust < 0.01 * cap:
            break
        else:
            trust *= 0.35
    return error + problem.reference
