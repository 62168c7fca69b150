"""The nominal extruder: one gain, one lag, one dead time; and how it is identified from what was measured.

    Q(s)   K e^(-delay s)                          dq/dt                    K (1 - a) z^(1 - d)
    ---- = --------------     sampled every dt:    a = e^(-dt / tau),       -------------------,   d = delay / dt
    U(s)     tau s + 1                                                            z - a

u[k] holds during sample k, and q[k] is the flow at its end: hence the z in the numerator, which is also the "fast zero"
(the fastest there is, at z = 0) that makes the inversion proper. A flow averaged over its sample is half a sample
earlier than that, one read at its beginning is a sample later; neither matters to a law that learns below 3 Hz.

Identification is least squares on the output error. For a given lag and delay the best gain, and an offset a trial
(a camera reads one print a little wider than another), follow in closed form; the lag is then found by a bounded search
within a search over whole samples of delay. The experiment is the paper's: a downward step, from steady flow.

Source: Hoelzle et al., "Iterative Learning Control Using a Basis Signal Library", eq. (1) and Table I.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from gcodectl.columns import Floats
from gcodectl.errors import InputError

Extruder: TypeAlias = Callable[[Floats, float], Floats]
"""One trial from rest: the plunger rate u (mm^3/s, n samples) and dt (s) in, the measured flow q (mm^3/s) out."""


@dataclasses.dataclass(frozen=True)
class Model:
    """Q/U = K e^(-delay s) / (tau s + 1): nominal, found from trials, and no more than that."""

    K: float
    tau: float
    """s"""
    delay: float = 0.0
    """s"""

    def pole(self, dt: float) -> float:
        """Return the discrete pole, exp(-dt / tau)."""
        return math.exp(-dt / self.tau)

    def delay_samples(self, dt: float) -> int:
        """Return the dead time in whole samples."""
        return round(self.delay / dt)

    def predict(self, u: Floats, dt: float) -> Floats:
        """Return the flow (mm^3/s) that `u` would give from rest; the time axis is the last."""
        a, d = self.pole(dt), self.delay_samples(dt)
        late = np.concatenate([np.zeros((*u.shape[:-1], d)), u[..., : u.shape[-1] - d]], axis=-1)
        return np.asarray(lfilter([self.K * (1 - a)], [1, -a], late), dtype=np.float64)


def identify(u: Floats, q: Floats, dt: float, max_delay: float = 0.6) -> Model:
    """Fit a Model to trials that began at rest; `u` and `q` are (n,) or (trials, n), mm^3/s.

    Raises InputError where the measured flow does not follow the plunger at all.
    """
    u, q = np.atleast_2d(u), np.atleast_2d(q)
    assert u.shape == q.shape, f"u is {u.shape}, q is {q.shape}"
    if not np.isfinite(q).all():
        raise InputError("the measured flow has samples that are no numbers")
    longest = min(round(max_delay / dt), u.shape[1] // 2)
    coarse = max(1, longest // 15)
    first = min((_fit(u, q, dt, d) for d in range(0, longest + 1, coarse)), key=lambda fit: fit[0])
    middle = first[1].delay_samples(dt)
    near = range(max(0, middle - coarse + 1), min(longest, middle + coarse - 1) + 1)
    best = min((_fit(u, q, dt, d) for d in near), key=lambda fit: fit[0])[1]
    if not best.K > 0:
        raise InputError(f"the measured flow does not follow the plunger (gain {best.K:.3g}): nothing to learn from")
    return best


def _fit(u: Floats, q: Floats, dt: float, delay: int) -> tuple[float, Model]:
    """Return the squared error and the Model that fits best with a delay of so many samples."""
    duration = u.shape[1] * dt
    centred = q - q.mean(axis=1, keepdims=True)

    def cost(log_tau: float) -> tuple[float, float]:
        x = Model(1.0, math.exp(log_tau), delay * dt).predict(u, dt)
        x -= x.mean(axis=1, keepdims=True)
        power = float(np.sum(x * x))
        K = float(np.sum(x * centred)) / power if power > 0 else 0.0
        return float(np.sum((centred - K * x) ** 2)), K

    bounds = (math.log(dt / 10), math.log(10 * duration))
    found = minimize_scalar(lambda log_tau: cost(log_tau)[0], bounds=bounds, method="bounded", options={"xatol": 1e-5})
    log_tau = float(found.x)
    error, K = cost(log_tau)
    return error, Model(K, math.exp(log_tau), delay * dt)


def identify_by_step(extruder: Extruder, flow: float, dt: float, durations: Iterable[float] = (20, 60, 180)) -> Model:
    """Identify the model from a downward step: `flow` (mm^3/s) is held, then nothing.

    The step is repeated, longer, until each half of it lasts three lags.
    """
    model = Model(1.0, math.inf)
    for duration in durations:
        half = round(duration / 2 / dt)
        u = np.concatenate([np.full(half, flow), np.zeros(half)])
        model = identify(u, extruder(u, dt), dt)
        if model.tau * 3 < duration / 2:
            break
    return model
