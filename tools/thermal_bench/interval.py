"""Intervals over seeds."""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats


def interval(values: Floats) -> list[float]:
    """Return the 95 % interval of the median, over seeds drawn again."""
    drawn = np.random.default_rng(0).choice(values, (1000, len(values)))
    low, high = np.quantile(np.median(drawn, axis=1), [0.025, 0.975])
    return [float(low), float(high)]
