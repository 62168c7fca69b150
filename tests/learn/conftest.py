"""A tiny linear plant, by its impulse response and on purpose not `learn.model`'s own code."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import fftconvolve


def linear_plant(K: float, tau: float, delay: float = 0.0, noise: float = 0.0, seed: int = 0):
    """Return an extruder: q' = (K u(t - delay) - q) / tau, read at the end of each sample."""
    rng = np.random.default_rng(seed)

    def extruder(u, dt):
        late = np.concatenate([np.zeros(round(delay / dt)), u])[: len(u)]
        decay = np.exp(-dt / tau)
        # q[k] = decay q[k-1] + (1 - decay) K u[k], summed from the plant's answer to one sample
        answer = (1 - decay) * K * decay ** np.arange(len(u))
        return fftconvolve(late, answer)[: len(u)] + noise * rng.normal(size=len(u))

    return extruder


@pytest.fixture
def plant() -> Callable[..., Callable]:
    return linear_plant
