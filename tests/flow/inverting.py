"""An inversion's kernels by hand: what is asked of it, and the rates that it answers with."""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.asking import ask_kernel
from gcodectl.flow.course import LEVELS, RATE, WORK, goal_kernel
from gcodectl.flow.flow_model import STATE
from gcodectl.flow.inversion import Inversion
from gcodectl.flow.plungers import BARREL, LAST, block_kernel
from gcodectl.flow.slewing import needed_kernel


def asked_of(inversion: Inversion, wanted: Floats) -> Floats:
    """What is asked for the flow wanted[n], nothing before and after it."""
    asked, goals, rates = np.empty((3, len(wanted)))
    work, _ = spaces(len(wanted))
    ask_kernel(wanted, 0, len(wanted), 0, len(wanted), inversion.row, asked, goals, rates, work)
    return asked


def goals_of(inversion: Inversion, asked: Floats) -> Floats:
    """What must be stored at the end of each sample."""
    return np.array([goal_kernel(one, inversion.row) for one in asked])


def rates_of(inversion: Inversion, asked: Floats) -> Floats:
    """The rates from each goal to the next, the first from the pre-charge."""
    p, goals = inversion.row, goals_of(inversion, asked)
    flows = np.where(asked > 0.0, asked, 0.0)
    stored, flow = np.append(inversion.rest, goals), np.append(0.0, flows)
    return np.array([needed_kernel(*one, p) for one in zip(stored, flow, goals, strict=False)])


def spaces(samples: int) -> tuple[Floats, Floats]:
    """Working space for the kernels."""
    return np.zeros((WORK, samples + 8)), np.zeros((samples + 8, LEVELS))


def solve(inversion: Inversion, asked: Floats, decided: int, state: Floats, last: float) -> tuple[Floats, float]:
    """The first `decided` rates for what is asked, and the last; `state` is advanced in place."""
    barrel = np.zeros(BARREL)
    barrel[:STATE], barrel[LAST] = state, last
    work, cheapest = spaces(len(asked))
    ends = np.append(asked, 0.0)
    goals, rates = goals_of(inversion, ends), rates_of(inversion, ends)
    block_kernel(
        asked,
        goals,
        rates,
        decided,
        len(asked),
        inversion.row,
        inversion.table,
        inversion.weights,
        barrel,
        work,
        cheapest,
    )
    state[:] = barrel[:STATE]
    return work[RATE, :decided].copy(), float(barrel[LAST])
