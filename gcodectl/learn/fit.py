"""Fit flow models to trials, and choose among their structures by what they predict.

    trials:  u_0, q_0   u_1, q_1   ...   u_n, q_n
             \\_______ fit _______/       predicted by each structure; the best one is kept, fitted to all

Least squares on the output: each structure is run from rest with the rates of the trials, its parameters moved until
the measured flows come out (so noise in them does not pile up, as it would in a stored volume read off by integration).
A camera reads one print a little wider than another: each trial may have a gain of its own, held near 1 by a ridge; the
model keeps what all of them share. Scales (gains, volumes, times) are fitted by their logarithms, within bounds wide
enough for any extruder. What a trial does not show (the backlash, while the plunger never turned back) stays where a
weak pull towards its smallest value leaves it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from gcodectl.columns import Floats
from gcodectl.flow.flow_model import STRUCTURES, FlowModel, delayed, predict_kernel

PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "linear": ("K", "store", "delay"),
    "plunger": ("K", "store", "power", "threshold", "delay"),
    "pressure": ("K", "store", "power", "threshold", "lag", "delay", "pull"),
    "backlash": ("K", "store", "power", "threshold", "delay", "gap"),
    "screw": ("K", "store", "power", "leak", "delay", "swing", "damping"),
}
UNITS = {"store": "flow", "threshold": "flow", "gap": "flow", "pull": "flow"}
"""Parameters that are given here as seconds of nominal flow, or as a share of it."""
BOUNDS: Mapping[str, tuple[float, float]] = {
    "K": (0.05, 20.0), "store": (0.002, 50.0), "power": (0.5, 6.0), "threshold": (-2.0, 20.0), "lag": (0.01, 20.0),
    "delay": (1e-3, 0.8), "gap": (1e-4, 0.5), "pull": (1e-3, 5.0), "leak": (1e-3, 3.0), "swing": (0.01, 1.0),
    "damping": (0.2, 2.0),
}  # fmt: skip
GUESS: Mapping[str, float] = {
    "K": 1.0, "store": 0.5, "power": 1.5, "threshold": 0.01, "lag": 0.3, "delay": 0.05, "gap": 0.01, "pull": 0.3,
    "leak": 0.1, "swing": 0.2, "damping": 0.6,
}  # fmt: skip
WEAK = {"gap": 1e-3, "leak": 1e-3, "power": 1e-3, "threshold": 1e-3}
"""How strongly what the trials do not show is pulled to its least (power, threshold: to 1 and 0)."""
RIDGE = 0.05
"""How strongly a trial's own gain is held at 1, as a share of its power."""
STARTS = tuple((delay, store) for delay in (0.02, 0.2) for store in (0.1, 0.5, 2.0))
STEP = 1e-3
MOST, MOST_AGAIN = 30, 10
"""Steps of a fit from a guess, and of one that goes on from the fit to all trials but the last."""
SURELY, TIE = 2.0, 0.005
"""A simpler structure (they are in order) is preferred unless what it misses beyond the best one's miss is more than
TIE of the flow, and more than so many standard errors."""
BLOCK = 0.5
"""s; squared misses are compared in pieces so long: longer than what a camera's noise remembers."""
COARSE = 0.02
"""s: finer samples than this are averaged before anything is fitted; extruders do not move so fast."""


@dataclasses.dataclass(frozen=True)
class Record:
    """One trial: what the plunger was told and what came out, n samples each, mm^3/s."""

    u: Floats
    q: Floats


@dataclasses.dataclass(frozen=True)
class Fit:
    """A fitted model and how far off it is, as a share of the nominal flow (rms over all samples)."""

    model: FlowModel
    rms: float
    trials: int = 0
    """How many it was fitted to."""


def fit(structure: str, trials: Sequence[Record], dt: float, flow: float, start: FlowModel | None = None) -> Fit:
    """Fit one structure to trials at a nominal flow (mm^3/s), from a grid of guesses or from the model given."""
    names = PARAMETERS[structure]
    low, high = (np.array([_coded(name, BOUNDS[name][side]) for name in names]) for side in (0, 1))

    step = [STEP] * len(names)

    def residuals(x: Floats) -> Floats:
        model = _decoded(structure, names, x, flow)
        weak = [weight * (x[names.index(name)] - _least(name)) for name, weight in WEAK.items() if name in names]
        parts = [_misses(model, trial, dt)[0] for trial in trials]
        return np.concatenate([*parts, np.array(weak)])

    if start is not None and start.structure == structure:
        guesses, most = [_encoded(names, start)], MOST_AGAIN
    else:
        most = MOST
        guesses = [_guess(names, delay, store) for delay, store in STARTS]
        guesses.sort(key=lambda x: float(np.sum(residuals(x) ** 2)))
    found = min(
        (
            least_squares(residuals, np.clip(x, low + 1e-9, high - 1e-9), bounds=(low, high), diff_step=step,
                          max_nfev=most, ftol=1e-5, xtol=1e-5)
            for x in guesses[:2]
        ),
        key=lambda one: float(one.cost),
    )  # fmt: skip
    model = _decoded(structure, names, found.x, flow)
    return Fit(model, miss(model, trials, dt), len(trials))


def miss(model: FlowModel, trials: Sequence[Record], dt: float) -> float:
    """Return the rms of what a model gets wrong about trials, their own gains aside, as a share of its flow."""
    total = sum(_misses(model, trial, dt)[1] for trial in trials)
    return math.sqrt(total / sum(len(trial.u) for trial in trials))


def choose(
    trials: Sequence[Record], dt: float, flow: float, known: Sequence[Fit] = (), structures: Sequence[str] = STRUCTURES
) -> tuple[Fit, float, list[Fit]]:
    """Fit structures to all trials but the last, take the one that predicts the last best, and fit it to all.

    A single trial is cut: the structures are fitted to its first two thirds. Returns the fit, the miss of its
    prediction (a share of the flow), and the fits of all structures, to go on from.
    """
    trials, dt = _coarser(trials, dt)
    before = {one.model.structure: one for one in known}
    if len(trials) > 1:
        seen, held = list(trials[:-1]), trials[-1:]
        fits = []
        for name in structures:
            there = before.get(name)
            up_to_date = there is not None and there.trials == len(seen)
            fits.append(there if there and up_to_date else fit(name, seen, dt, flow, there.model if there else None))
    else:
        end = 2 * len(trials[0].u) // 3
        fits, held = (
            [fit(name, [Record(trials[0].u[:end], trials[0].q[:end])], dt, flow) for name in structures],
            trials,
        )
    misses = [miss(one.model, held, dt) for one in fits]
    best = _simplest(misses, [_blocks(one.model, held[0], dt) for one in fits])
    final = fit(structures[best], trials, dt, flow, fits[best].model)
    fits[best] = final
    return final, misses[best], fits


def _simplest(misses: Sequence[float], blocks: Sequence[Floats]) -> int:
    """Return the first structure that is not surely worse than the best one."""
    best = int(np.argmin(misses))
    for k, wrong in enumerate(misses):
        worse = blocks[k] - blocks[best]
        if wrong**2 <= misses[best] ** 2 + TIE**2 or worse.mean() <= SURELY * worse.std() / math.sqrt(len(worse)):
            return k
    return best


def _blocks(model: FlowModel, trial: Record, dt: float) -> Floats:
    """Return the mean squared misses of a trial in pieces of BLOCK."""
    wrong = _misses(model, trial, dt)[0][:-1] ** 2
    length = max(1, min(round(BLOCK / dt), len(wrong) // 4))
    n = len(wrong) // length * length
    return np.asarray(wrong[:n].reshape(-1, length).mean(axis=1), dtype=np.float64)


def own_gain(predicted: Floats, measured: Floats, flow: float) -> float:
    """Return by how much more than predicted (n samples, mm^3/s) a print shows; held near 1 by the ridge."""
    power = float(predicted @ predicted)
    ridge = RIDGE * power + 1e-9 * flow**2
    return (float(predicted @ measured) + ridge) / (power + ridge)


def _coarser(trials: Sequence[Record], dt: float) -> tuple[list[Record], float]:
    times = max(1, round(COARSE / dt))

    def mean(row: Floats) -> Floats:
        n = len(row) // times * times
        return np.asarray(row[:n].reshape(-1, times).mean(axis=1), dtype=np.float64)

    return [Record(mean(one.u), mean(one.q)) for one in trials], dt * times


def _misses(model: FlowModel, trial: Record, dt: float) -> tuple[Floats, float]:
    """Return the residuals of a trial (its gain's ridge last), over the flow, and the sum of their squares."""
    predicted = np.empty(len(trial.u))
    predict_kernel(model.at_rest, delayed(trial.u, model.delay / dt), dt, model.parameters, predicted)
    ridge = RIDGE * float(predicted @ predicted) + 1e-9 * model.flow**2
    gain = own_gain(predicted, trial.q, model.flow)
    wrong = np.append(gain * predicted - trial.q, math.sqrt(ridge) * (gain - 1.0)) / model.flow
    return wrong, float(wrong @ wrong)


def _least(name: str) -> float:
    return {"power": 0.0, "threshold": 0.0}.get(name, _coded(name, BOUNDS[name][0]))


def _coded(name: str, value: float) -> float:
    return value if name == "threshold" else math.log(value)


def _guess(names: Sequence[str], delay: float, store: float) -> Floats:
    return np.array([_coded(name, {"delay": delay, "store": store}.get(name, GUESS[name])) for name in names])


def _encoded(names: Sequence[str], model: FlowModel) -> Floats:
    values = dataclasses.asdict(model)
    share = {name: values[name] / (model.flow if name in UNITS else 1.0) for name in names}
    return np.array([_coded(name, share[name]) for name in names])


def _decoded(structure: str, names: Sequence[str], x: Floats, flow: float) -> FlowModel:
    values = {
        name: (float(coded) if name == "threshold" else math.exp(coded)) * (flow if name in UNITS else 1.0)
        for name, coded in zip(names, x, strict=True)
    }
    return FlowModel(structure=structure, flow=flow, **values)
