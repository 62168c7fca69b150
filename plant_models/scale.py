"""A scale: what it shows of what was laid on the bed.

Two readings, of the sheet before it is printed on and after: each is off by half a step (standard deviation), as
scales of that readability are told to be, and rounded to whole steps.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.errors import UsageError

REPEATS = 0.5
"""Standard deviation of a reading, in steps."""
SHEET = 5.0
"""g; about what is tared."""


def weigh(volume: float, density: float, readability: float, rng: np.random.Generator) -> str:
    """Return what a scale shows of a volume (mm^3) at a density (g/cm^3), g, with all its digits.

    `readability` (g) is its finest step. Raises UsageError where one of them is no positive number.
    """
    for name, value in (("density", density), ("readability", readability)):
        if not (math.isfinite(value) and value > 0):
            raise UsageError(f"the scale's {name} is {value:g}; it must be a positive number")
    empty = SHEET + float(rng.uniform(0.0, readability))
    before, after = (
        round(grams / readability + REPEATS * float(rng.normal())) for grams in (empty, empty + density * volume / 1e3)
    )
    digits = max(0, -math.floor(math.log10(readability) + 1e-9))
    return f"{(after - before) * readability:.{digits}f}"
