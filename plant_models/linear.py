"""linear: the nominal plant, a first-order lag, Q(s)/U(s) = K / (tau s + 1).

    u  ___|-----------|__________        over a sample u is constant, so the answer is exact:
    q  ___.-'`````````'`-.._____         x(t) = K u + (x0 - K u) exp(-t / tau)

It is the model that controllers invert, not a paste: a linear plant may draw q < 0, and has no yield and no limit.

Source: Hoelzle, Alleyne, Wagoner Johnson, "Iterative Learning Control Using a Basis Signal Library", eq. (1), with u
read as the plunger's rate, and Table I: material A K 1.08, tau 2.7 s; material B K 0.89, tau 4.5 s.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.jit import jit
from plant_models.plant import checked, require


@jit
def first_order_kernel(x: float, u: Floats, K: float, decay: float, share: float, q: Floats) -> float:
    """Fill q with the sample averages of the lag's answer to u, from x; return x after it.

    `decay` is exp(-dt / tau), `share` the mean of exp(-t / tau) over a sample.
    """
    for k in range(len(u)):
        goal = K * u[k]
        q[k] = goal + (x - goal) * share
        x = goal + (x - goal) * decay
    return x


def first_order(x: float, u: Floats, dt: float, K: float, tau: float) -> tuple[float, Floats]:
    """Return x after `u`, and the sample averages, of the lag K / (tau s + 1); tau 0 is no lag."""
    ratio = dt / tau if tau > 0 else math.inf
    q = np.empty(len(u))
    x = first_order_kernel(x, u, K, math.exp(-ratio), -math.expm1(-ratio) / ratio, q)
    return x, q


class Linear:
    """K / (tau s + 1), discretised exactly; `gain` and `lag` are factors on K and tau."""

    def __init__(self, K: float = 1.0, tau: float = 1.0, *, gain: float = 1.0, lag: float = 1.0):
        require("linear", positive={"K": K, "tau": tau, "gain": gain, "lag": lag})
        self.K, self.tau = K * gain, tau * lag

    def initial(self) -> Floats:
        """Return the state [x], mm^3/s: at rest."""
        return np.zeros(1)

    def run(self, state: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state after u[n] and the flow q[n]."""
        x, q = first_order(float(state[0]), checked(u, dt), dt, self.K, self.tau)
        return np.array([x]), q
