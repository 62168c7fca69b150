"""A compact model of an extruder: what it stores, and what flow that gives; found from trials, and no more than that.

    u --> dead time --> drive (w) --> backlash --> [ stored volume S ] --> q = f(S)
                                                        | h(S)

    dS/dt = K w - h(S)          f(S) = F ((S - S_y) / S_F)^p  above the threshold S_y, 0 below it

A plunger conserves volume: what went in and has not come out is stored (in the paste, in air, in a soft drive), and the
more is stored the faster it flows. That one picture, with h chosen, covers what is known of extruders:

    structure    h(S)           also                            for
    linear       f, p = 1       dead time                       Hoelzle's nominal plant: S_F / F is its lag
    plunger      f              dead time                       compressible paste: S_y its yield, p = 1/n its thinning
    backlash     f              dead time, a gap in the drive   the same behind a worn drive
    pressure     S / lag        dead time, the least pull       u sets a pressure: flow is no multiple of u
    screw        f + leak S     dead time, a drive that swings  pellet screws: back flow, a speed loop that overshoots

The state is [S, place in the backlash's gap, w, dw/dt]. At rest S = 0, the gap is closed, the drive stands still.

Sources: the conservation of volume and the pressure-flow law of a yield-stress paste are those of Hoelzle et al., eq.
(1) and ref. 14 (Bellini et al., 2004), with the Herschel-Bulkley power law in place of their linear one.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cached_property
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.flow.power import power_kernel
from gcodectl.jit import jit

STRUCTURES = ("linear", "plunger", "pressure", "backlash", "screw")
# Places in the row of parameters that the kernels take
K, THRESHOLD, STORE, POWER, F, LEAK, LAG, GAP, PULL, SWING, DAMPING, PRESSURE, PARAMETERS = range(13)
# Places in the state
STORED, PLACE, DRIVE, DRIVE_RATE, STATE = range(5)
SUBSTEPS, STEEP = 4, 20.0
"""The most steps a sample, and steps for every lag that it is long."""


@jit
def flow_kernel(stored: float, p: Floats) -> float:
    """Return f(S): the flow (mm^3/s) that a stored volume (mm^3) gives."""
    over = (stored - p[THRESHOLD]) / p[STORE]
    return p[F] * power_kernel(over, p[POWER]) if over > 0.0 else 0.0


@jit
def stored_kernel(flow: float, p: Floats) -> float:
    """Return the volume that must be stored for a flow > 0: f inverted."""
    return float(p[THRESHOLD] + p[STORE] * power_kernel(flow / p[F], 1.0 / p[POWER]))


@jit
def slope_kernel(stored: float, p: Floats) -> float:
    """Return df/dS, 1/s."""
    over = (stored - p[THRESHOLD]) / p[STORE]
    return p[F] * p[POWER] / p[STORE] * over ** (p[POWER] - 1.0) if over > 0.0 else 0.0


@jit
def drive_kernel(state: Floats, u: float, dt: float, p: Floats) -> float:
    """Advance the drive and the gap by one sample of u; returns the mean rate that reaches the store, before K."""
    moved = max(u, -p[PULL])
    if p[SWING] > 0.0:
        steps = max(1, math.ceil(dt / (0.1 * p[SWING])))
        h = dt / steps
        gone = 0.0
        for _ in range(steps):
            state[DRIVE_RATE] += (
                h * ((moved - state[DRIVE]) / p[SWING] - 2.0 * p[DAMPING] * state[DRIVE_RATE]) / p[SWING]
            )
            state[DRIVE] += h * state[DRIVE_RATE]
            gone += h * state[DRIVE]
        moved = gone / dt
    if p[GAP] > 0.0:
        goal = state[PLACE] + moved * dt
        state[PLACE] = min(max(goal, 0.0), p[GAP])
        moved = (goal - state[PLACE]) / dt
    return float(moved)


@jit
def store_kernel(state: Floats, w: float, dt: float, p: Floats) -> float:
    """Advance the store by one sample of the rate w that reaches it; returns the mean flow, mm^3/s.

    Linearly implicit (Rosenbrock) steps: stable however short the lag is against dt; one of them where it is long.
    """
    inside = p[K] * w
    steps = 1
    if p[PRESSURE] == 0.0:
        fullest = state[STORED] + max(0.0, inside * dt)
        steps += int(min(SUBSTEPS - 1.0, STEEP * slope_kernel(fullest, p) * dt))
    h = dt / steps
    out = 0.0
    for _ in range(steps):
        stored = state[STORED]
        over = (stored - p[THRESHOLD]) / p[STORE]
        flow, slope = 0.0, p[LEAK]
        if over > 0.0:
            flow = p[F] * over ** p[POWER]
            slope += p[POWER] * flow / (over * p[STORE])
        if p[PRESSURE] > 0.0:
            rate = (inside - stored / p[LAG]) / (1.0 + 0.5 * h / p[LAG])
        else:
            rate = (inside - flow - p[LEAK] * stored) / (1.0 + 0.5 * h * slope)
        out += flow_kernel(stored + 0.5 * h * rate, p) * h
        state[STORED] = stored + h * rate
    return max(0.0, out / dt)


@jit
def predict_kernel(state: Floats, u: Floats, dt: float, p: Floats, q: Floats) -> None:
    """Advance `state` in place by u[n], dead time apart, and fill q[n] with mean flows."""
    for k in range(len(u)):
        q[k] = store_kernel(state, drive_kernel(state, u[k], dt, p), dt, p)


@dataclasses.dataclass(frozen=True)
class FlowModel:
    """Parameters of the model; mm^3, mm^3/s, s. Those that a structure does not have keep their defaults."""

    structure: str
    K: float
    """What reaches the store of what the plunger is told."""
    flow: float
    """F, mm^3/s: the nominal flow that `store` belongs to."""
    store: float
    """S_F, mm^3: what is stored above the threshold at the flow F."""
    threshold: float = 0.0
    """S_y, mm^3, from rest."""
    power: float = 1.0
    """p"""
    delay: float = 0.0
    """Dead time, s."""
    gap: float = 0.0
    """Backlash, mm^3."""
    leak: float = 0.0
    """1/s"""
    lag: float = 1.0
    """s, of the structure `pressure`."""
    pull: float = 1e9
    """The most that pulling back counts for, mm^3/s: a vacuum has its limit."""
    swing: float = 0.0
    """1 / natural frequency of the drive's speed loop, s; 0: it follows at once."""
    damping: float = 1.0

    def __post_init__(self) -> None:
        if self.structure not in STRUCTURES:
            raise InputError(f"a flow model of structure {self.structure!r}; there are {', '.join(STRUCTURES)}")
        positive = (self.K, self.flow, self.store, self.power, self.lag, self.pull, self.damping)
        others = (self.threshold, self.delay, self.gap, self.leak, self.swing)
        if not all(math.isfinite(one) for one in (*positive, *others)) or min(positive) <= 0 or min(others[1:]) < 0:
            raise InputError("a flow model's parameters must be finite, its gains, volumes and times positive")

    @cached_property
    def parameters(self) -> Floats:
        """The row that the kernels take."""
        row = np.zeros(PARAMETERS)
        row[[K, THRESHOLD, STORE, POWER, F]] = self.K, self.threshold, self.store, self.power, self.flow
        row[[LEAK, LAG, GAP, PULL]] = self.leak, self.lag, self.gap, self.pull
        row[[SWING, DAMPING, PRESSURE]] = self.swing, self.damping, float(self.structure == "pressure")
        return row

    @property
    def at_rest(self) -> Floats:
        """The state before anything moved."""
        state = np.zeros(STATE)
        state[PLACE] = self.gap
        return state

    def predict(self, u: Floats, dt: float) -> Floats:
        """Return the flow q[n], mm^3/s, that the plunger rate u[n] gives from rest, sample means of `dt` s."""
        q = np.empty(len(u))
        predict_kernel(self.at_rest, delayed(u, self.delay / dt), dt, self.parameters, q)
        return q

    def steady_rate(self, flow: float) -> float:
        """Return the plunger rate that holds a flow > 0, mm^3/s."""
        return float(self.outflow(np.array([self.stored(flow)]))[2][0]) / self.K

    def stored(self, flow: float) -> float:
        """Return the volume that must be stored for a flow > 0, mm^3: f inverted."""
        return float(self.threshold + self.store * (flow / self.flow) ** (1.0 / self.power))

    def outflow(self, stored: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the flow f(S), mm^3/s, the slope of the loss, h'(S), 1/s, and the loss h(S), mm^3/s."""
        over = np.maximum((stored - self.threshold) / self.store, 0.0)
        flow = self.flow * over**self.power
        if self.structure == "pressure":
            return flow, np.full(len(stored), 1.0 / self.lag), stored / self.lag
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(over > 0.0, self.power * flow / (over * self.store), 0.0)
        return flow, slope + self.leak, flow + self.leak * stored

    @property
    def quickness(self) -> float:
        """The lag about the nominal flow, s."""
        return self.lag if self.structure == "pressure" else self.store / (self.power * self.flow)

    def sentence(self) -> str:
        """Say it: what it is and what sets it apart."""
        said = [f"{self.structure}, K {self.K:.3f}, {self.store:.4g} mm^3 stored at {self.flow:g} mm^3/s"]
        said += [f"lag {self.quickness:.3g} s there", f"power {self.power:.2f}"]
        said += [f"yield {self.threshold:.3g} mm^3"] if abs(self.threshold) > 0.005 * self.store else []
        said += [f"dead time {self.delay:.3f} s"] if self.delay > 0.002 else []
        said += [f"backlash {self.gap:.3g} mm^3"] if self.gap else []
        said += [f"a drive that swings at {1 / self.swing:.2g} rad/s, damped {self.damping:.2f}"] if self.swing else []
        return ", ".join(said)

    def table(self) -> dict[str, Any]:
        """Return the parameters as JSON values."""
        return {
            name: value if isinstance(value, str) else float(f"{value:.9g}")
            for name, value in dataclasses.asdict(self).items()
        }


def delayed(u: Floats, samples: float) -> Floats:
    """Return u, `samples` (any number >= 0) later; before the first sample nothing moved."""
    whole = int(samples)
    part = samples - whole
    late = np.concatenate([np.zeros(whole + 1), u])[: len(u) + 1]
    return (1.0 - part) * late[1:] + part * late[:-1]
