"""Iterative learning control: the same routine again and again, the signal a little better each time.

       u_j --->[ extruder ]---> q_j        e_j = q_ref - q_j
        ^                        |
        |       u_{j+1} = Q( u_j + L e_j ), within the plunger's limits
        +------------------------+

- L = k_p / P: the nominal model inverted, times k_p (0.25). P = K (1 - a) z^(1 - d) / (z - a), so that

      (L e)[k] = k_p ( e[k + d] - a e[k + d - 1] ) / ( K (1 - a) )

  The zero at z = 0 (a dead-beat one, faster than any other) is what makes the inverse proper: without dead time
  (d = 0) it needs no sample from the future. With a dead time of d samples in the model the inversion is advanced by
  d, which is no trouble, as the whole trial has been recorded; past its end the error is held at its last value.
- Q: a second-order Butterworth low-pass at 3 Hz, run forward and then backward, so that it shifts nothing. Twice
  through makes its gain |B|^2, 1/2 at 3 Hz (effectively fourth order), and its phase zero.
- Run forward only (`causal`), Q delays the signal by 75 ms at every trial while L pulls back a quarter of what is left:
  it settles where the signal is some 0.3 s late and stays there.
- The limits: see `flow.limits`. What the cap cuts off is handed to the samples beside it.

Source: Hoelzle et al., "Iterative Learning Control Using a Basis Signal Library", eq. (2); Bristow, Tharayil and
Alleyne, "A Survey of Iterative Learning Control", 2006, for zero-phase Q filters.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.signal import butter, filtfilt, lfilter

from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.learn.model import Model


@dataclasses.dataclass(frozen=True)
class Law:
    """u_{j+1} = Q(u_j + L e_j), for one nominal model and one sample time."""

    model: Model
    dt: float
    """s"""
    gain: float = 0.25
    """k_p"""
    bandwidth: float = 3.0
    """Where Q's Butterworth filter is down by half its power, Hz."""
    causal: bool = False
    """Run Q forward only: kept to show why one should not."""

    def __post_init__(self) -> None:
        if not 0 < self.bandwidth < 0.5 / self.dt:
            raise UsageError(f"a bandwidth of {self.bandwidth:g} Hz does not fit samples of {self.dt:g} s")
        if not 0 < self.gain < 2:
            raise UsageError(f"a learning gain of {self.gain:g} cannot converge; 0.25 is a good one")

    def with_delay(self, delay: float) -> Law:
        """Return the same law with `delay` seconds of dead time in its model."""
        return dataclasses.replace(self, model=dataclasses.replace(self.model, delay=delay))

    def butterworth(self) -> tuple[Floats, Floats]:
        """Return the numerator and denominator of Q's filter, one way through."""
        b, a = butter(2, self.bandwidth, fs=1 / self.dt)
        return np.asarray(b, dtype=np.float64), np.asarray(a, dtype=np.float64)

    def learn(self, error: Floats) -> Floats:
        """Return L e, mm^3/s, for an error of shape (n,), mm^3/s."""
        a, d = self.model.pole(self.dt), self.model.delay_samples(self.dt)
        ahead = np.concatenate([error[d:], np.full(min(d, len(error)), error[-1])])
        before = np.concatenate([[error[d - 1] if d else 0.0], ahead[:-1]])
        return np.asarray(self.gain * (ahead - a * before) / (self.model.K * (1 - a)), dtype=np.float64)

    def smooth(self, signal: Floats) -> Floats:
        """Return Q applied to a signal of shape (n,)."""
        b, a = self.butterworth()
        if self.causal:
            return np.asarray(lfilter(b, a, signal), dtype=np.float64)
        pad = min(len(signal) - 1, round(3 / self.bandwidth / self.dt))
        return np.asarray(filtfilt(b, a, signal, padtype="constant", padlen=pad), dtype=np.float64)

    def update(self, u: Floats, error: Floats) -> Floats:
        """Return the next trial's signal, before the plunger's limits."""
        return self.smooth(u + self.learn(error))
