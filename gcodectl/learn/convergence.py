"""Will it converge? Asked of the nominal model before the first trial is run.

With plant P, law L and filter Q, the error of one trial follows from that of the one before, frequency by frequency:

      e_{j+1} = Q (1 - L P) e_j + (1 - Q) q_ref        shrinks at every trial where |Q (1 - L P)| < 1
      e_inf   = (1 - Q) / (1 - Q (1 - L P)) q_ref      what remains, however many trials

      |.|                 plain law, 0.2 s of dead time
     1.04 |......_____......................... the limit is 1
          |   _-'     '-_
     0.75 |--'           '-._____               at 0 Hz: 1 - k_p
          +-----------------------'---->  Hz

A causal Q passes the first test and fails the second: its phase lag makes 1 - Q large well below its bandwidth. That is
why the curve of what remains is part of the answer.

Source: Bristow, Tharayil and Alleyne, "A Survey of Iterative Learning Control", 2006, on monotonic convergence.
"""

from __future__ import annotations

import dataclasses

import control
import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Floats
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import Model


@dataclasses.dataclass(frozen=True)
class Convergence:
    """|Q (1 - L P)| over frequency, and its worst place."""

    frequency: Floats
    """Hz"""
    shrink: Floats
    """|Q (1 - L P)|: what a trial leaves of the error of the one before."""
    remains: Floats
    """|(1 - Q) / (1 - Q (1 - L P))|: what all trials leave of the reference."""

    @property
    def worst(self) -> float:
        """The largest |Q (1 - L P)|."""
        return float(self.shrink.max())

    @property
    def worst_frequency(self) -> float:
        """Where that is, Hz."""
        return float(self.frequency[self.shrink.argmax()])

    @property
    def converges(self) -> bool:
        """Whether the error shrinks at every frequency."""
        return self.worst < 1.0

    def sentence(self) -> str:
        """Say it."""
        verdict = "converges" if self.converges else "would diverge"
        return f"|Q(1 - LP)| is at most {self.worst:.3f}, at {self.worst_frequency:.2f} Hz: {verdict}"


def transfer_function(model: Model, dt: float) -> control.TransferFunction:
    """Return the model sampled every dt, its flow read at the end of each sample (see `learn.model`)."""
    held = control.sample_system(control.tf([model.K], [model.tau, 1]), dt, method="zoh")
    delay = model.delay_samples(dt)
    return held * control.tf([1, 0], [1], dt) * control.tf([1], [1] + [0] * delay, dt)


def convergence(law: Law, plant: Model | None = None, points: int = 600) -> Convergence:
    """Check `law` on `plant` (by default its own model) from 0.01 Hz to the Nyquist frequency, and at 0 Hz."""
    dt = law.dt
    frequency = np.concatenate([[0.0], np.geomspace(0.01, 0.5 / dt, points)])
    z = np.exp(2j * np.pi * frequency * dt)
    a, K = law.model.pole(dt), law.model.K
    P = _response(transfer_function(plant or law.model, dt), z)
    inverse = _response(control.tf([law.gain, -law.gain * a], [K * (1 - a), 0], dt), z)
    L = inverse * z ** law.model.delay_samples(dt)
    B = _response(control.tf(*law.butterworth(), dt), z)
    Q = B if law.causal else np.abs(B) ** 2
    factor = Q * (1 - L * P)
    return Convergence(frequency, np.abs(factor), np.abs((1 - Q) / (1 - factor)))


def _response(system: control.TransferFunction, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    return np.asarray(system(z), dtype=np.complex128).reshape(len(z))
