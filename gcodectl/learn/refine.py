"""Refine: the plunger signal that a flow model says comes nearest to the flow wanted, within the plunger's limits.

`flow.inversion` plans for prints: a little at a time, by the price of flow beside a road. A trial is planned whole, and
judged by the rms of its flow. So the inversion's plan is only where the search begins:

    least  sum_k (q_k - q_ref_k)^2 + VOID void_k^2 + CALM step_k^2      q = model(u)

           u straight between knots, step_k from one to the next, |u| <= cap, and at first what a sample allows

    forwards     s_k+1, q_k = step(s_k, u_k)           each step's slopes A = ds'/ds, B = ds'/du, C = dq/ds, D = dq/du
    backwards    l_k = A^T l_k+1 + C g_k + dvoid_k     g_k = 2 (q_k - q_ref_k)
    gradient     d cost / d u_k = B l_k+1 + D g_k      one pass each way, however many knots

A model says that nothing flows below its threshold, however far back the plunger goes; a nozzle then draws in air, or
the paste back. So a void, what is missing from the store at rest or at its pre-charge, is dear: VOID times what flow
of its size costs, so that it is left only where the plunger cannot help it.

Only where the inversion's plan changes, and BESIDE that, is it looked for: what is gained elsewhere is next to nothing,
and would be ringing all along the roads, where a task's signal should end (`learn.segmentation`): three times as long.

Knots lie as far apart as the plunger needs from one cap to the other, so that no signal between them is too steep; a
trial begins at rest, so that the first one is as near to it as one sample can come.

Sources: norm-optimal learning control, Amann, Owens and Rogers (1996), of which this is the step with a model of the
plant and a hard limit in place of a price on u; L-BFGS-B, Byrd et al. (1995), scipy's.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.optimize import minimize

from gcodectl.columns import Floats
from gcodectl.flow.flow_model import (
    DRIVE,
    DRIVE_RATE,
    PLACE,
    STATE,
    STORED,
    FlowModel,
    delayed,
    drive_kernel,
    store_kernel,
)
from gcodectl.flow.inversion import Inversion
from gcodectl.jit import jit

KNOT = 0.03
"""s between knots at the least."""
VOID = 30.0
"""What a void costs beside flow of its size."""
CALM = 1e-4
"""What a step from knot to knot costs beside an error of its size: too little to be missed, enough to end ringing."""
ROUNDS, ENOUGH = 200, 1e-5
"""Steps of the search at the most, and the share of the cost that one must gain."""
BESIDE, CHANGE = 0.1, 0.02
"""s; share of the nominal flow that a sample changes by at least."""
NUDGE = 1e-5
"""Share of its scale that a state or a rate is moved by for its slope."""


@jit
def slopes_kernel(
    state: Floats, moved: Floats, scale: Floats, u: Floats, dt: float, p: Floats,
    q: Floats, stored: Floats, slopes: Floats,
) -> None:  # fmt: skip
    """Run u[n] from `state`, in place; fill the flow q[n], what is stored[n] then, slopes[n, STATE + 1, STATE + 1].

    Row i of a sample's slopes is what moving state i (the last one: u) does to the next state, and (last column) to
    the flow. `moved` is room for a state, `scale` what each is moved by; 0: it plays no part.
    """
    for k in range(len(u)):
        for i in range(STATE + 1):
            if scale[i] == 0.0:
                continue
            for j in range(STATE):
                moved[j] = state[j]
            told = u[k]
            if i < STATE:
                moved[i] += scale[i]
            else:
                told += scale[i]
            flow = store_kernel(moved, drive_kernel(moved, told, dt, p), dt, p)
            for j in range(STATE):
                slopes[k, i, j] = moved[j]
            slopes[k, i, STATE] = flow
        q[k] = store_kernel(state, drive_kernel(state, u[k], dt, p), dt, p)
        stored[k] = state[STORED]
        for i in range(STATE + 1):
            played = scale[i] > 0.0
            for j in range(STATE):
                slopes[k, i, j] = (slopes[k, i, j] - state[j]) / scale[i] if played else 0.0
            slopes[k, i, STATE] = (slopes[k, i, STATE] - q[k]) / scale[i] if played else 0.0


@jit
def adjoint_kernel(price: Floats, worth: Floats, slopes: Floats, now: Floats, later: Floats, gradient: Floats) -> None:
    """Fill gradient[n] of a cost by u from its gradient by the flow, price[n], and by what is stored then, worth[n].

    `now` and `later` are room for a state each.
    """
    for j in range(STATE):
        later[j] = 0.0
    for k in range(len(price) - 1, -1, -1):
        later[STORED] += worth[k]
        for i in range(STATE + 1):
            total = slopes[k, i, STATE] * price[k]
            for j in range(STATE):
                total += slopes[k, i, j] * later[j]
            if i < STATE:
                now[i] = total
            else:
                gradient[k] = total
        for j in range(STATE):
            later[j] = now[j]


@dataclasses.dataclass(frozen=True)
class Refinement:
    """A model and a flow wanted, q_ref[n], mm^3/s, at dt s a sample."""

    model: FlowModel
    reference: Floats
    dt: float
    rest: float = 0.0
    """What is stored between roads, mm^3: less than that and than nothing is a void."""

    def cost(self, u: Floats) -> tuple[float, Floats]:
        """Return the mean squared error of the flow, voids included, (mm^3/s)^2, and its gradient by u[n]."""
        model, n = self.model, len(self.reference)
        samples = model.delay / self.dt
        q, stored, gradient = np.empty((3, n))
        slopes = np.empty((n, STATE + 1, STATE + 1))
        scale = np.zeros(STATE + 1)
        scale[[STORED, PLACE, STATE]] = model.store, model.gap, model.flow
        if model.swing > 0.0:
            scale[[DRIVE, DRIVE_RATE]] = model.flow, model.flow / model.swing
        slopes_kernel(
            model.at_rest, np.empty(STATE), NUDGE * scale, delayed(u, samples), self.dt, model.parameters,
            q, stored, slopes,
        )  # fmt: skip
        error, rate = q - self.reference, model.flow / model.store
        void = np.minimum(stored - min(0.0, self.rest), 0.0) * rate
        adjoint_kernel(
            2.0 / n * error, 2.0 * VOID / n * rate * void, slopes, np.empty(STATE), np.empty(STATE), gradient
        )
        cost = float(np.mean(error**2) + VOID * np.mean(void**2))
        return cost, delayed(gradient[::-1], samples)[::-1]  # a delay's adjoint is an advance


def refined(inversion: Inversion, reference: Floats) -> Floats:
    """Return the signal that brings the model's flow nearest to reference[n], within the plunger's limits; mm^3/s.

    The search begins with the inversion's plan, and returns that where it finds none better.
    """
    model, dt, cap = inversion.model, inversion.dt, inversion.max_flow
    u = inversion.along(reference)
    problem = Refinement(model, reference, dt, inversion.rest)
    worst = problem.cost(u)[0]
    if not worst > 0.0 or not math.isfinite(cap):
        return u
    every = math.ceil(max(KNOT, 2.0 * cap / inversion.max_flow_slew) / dt - 1e-9)
    at = np.arange(0, len(u) + every, every)
    place = np.arange(len(u)) / every
    left = place.astype(np.int64)
    right = place - left

    def between(knots: Floats) -> Floats:
        return np.asarray(knots[left] * (1.0 - right) + knots[left + 1] * right, dtype=np.float64)

    def cost(knots: Floats) -> tuple[float, Floats]:
        value, slope = problem.cost(between(knots * cap))
        steps = cap * np.diff(knots)
        there = np.bincount(left, slope * (1.0 - right), len(at)) + np.bincount(left + 1, slope * right, len(at))
        rough = 2.0 * CALM / len(steps) * (np.append(0.0, steps) - np.append(steps, 0.0))
        value += CALM * float(np.mean(steps**2))
        return value / worst, np.asarray((there + rough) * cap / worst, dtype=np.float64)

    most = np.ones(len(at))
    most[0] = min(1.0, inversion.max_flow_slew * dt / cap)  # a sample after rest
    begin = np.clip(np.interp(at, np.arange(len(u)), u) / cap, -most, most)
    free = np.interp(at, np.arange(len(u)), near_changes(u, model.flow, dt)) > 0.0
    low, high = np.where(free, -most, begin), np.where(free, most, begin)
    search = minimize(
        cost, begin, jac=True, method="L-BFGS-B", bounds=list(zip(low, high, strict=True)),
        options={"maxiter": ROUNDS, "maxcor": 20, "ftol": ENOUGH, "gtol": 0.0},
    )  # fmt: skip
    found = between(search.x * cap)
    return found if problem.cost(found)[0] < worst else u


def near_changes(u: Floats, flow: float, dt: float) -> Floats:
    """Return 1 for samples of u[n] within BESIDE of where it changes, at a nominal flow (mm^3/s), and 0 elsewhere."""
    changes = np.abs(np.diff(u, prepend=u[:1])) > CHANGE * flow
    reach = round(BESIDE / dt)
    return np.convolve(changes, np.ones(2 * reach + 1), "same").clip(0.0, 1.0)
