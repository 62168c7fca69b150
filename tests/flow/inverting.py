"""An inversion's kernels by hand: what is asked of it, and the rates that it answers with."""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.asking import ask_kernel
from gcodectl.flow.course import LEVELS, RATE, WORK, goal_kernel
from gcodectl.flow.flow_model import STATE
from gcodectl.flow.inversion import Inversion
from gcodectl.flow.plungers import BARREL, LAST, block_kernel


def asked_of(inversion: Inversion, wanted: Floats) -> Floats:
    """What is asked for the flow wanted[n], nothing before and after it."""
    asked, goals = np.empty(len(wanted)), np.empty(len(wanted))
    ask_kernel(wanted, 0, len(wanted), 0, len(wanted), inversion.row, asked, goals)
    return asked


def goals_of(inversion: Inversion, asked: Floats) -> Floats:
    """What must be stored at the end of each sample."""
    return np.array([goal_kernel(one, inversion.row) for one in asked])


def spaces(samples: int) -> tuple[Floats, Floats]:
    """Working space for the kernels."""
    return np.zeros((WORK, samples + 8)), np.zeros((samples + 8, LEVELS))


def solve(inversion: Inversion, asked: Floats, decided: int, state: Floats, last: float) -> tuple[Floats, float]:
    """The first `decided` rates for what is asked, and the last; `state` is advanced in place."""
    barrel = np.zeros(BARREL)
    barrel[:STATE], barrel[LAST] = state, last
    work, cheapest = spaces(len(asked))
    goals = goals_of(inversion, np.append(asked, 0.0))
    block_kernel(
        asked, goals, 0, decided, len(asked), inversion.row, inversion.table, inversion.weights, barrel, work, cheapest
    )
    state[:] = barrel[:STATE]
    return work[RATE, :decided].copy(), float(barrel[LAST])
