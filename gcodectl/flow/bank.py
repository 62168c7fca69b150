r"""The signal bank: the basis sets of every tool as plain arrays, normalised to a flow of one, ready for the kernels.

A plunger conserves volume. In training a Start charges a barrel that has rested for seconds; in a part it follows a
Stop, and must put back just what that Stop took out, or every road leaves the barrel a little fuller than the last.
What a Stop takes out and a Start puts in, beyond the feed-forward, can be read off the learned signals; `put_back` is
their ratio, and scales every Start that follows a Stop (on a yield-stress paste 0.8, on a linear one 1).

Signals are learned of a plunger that may jump; firmware slows the whole machine down where E's speed steps. So what a
signal adds is averaged over as many samples as it takes to keep within what is followed, volume and middle kept:

    u |   _             __         A worse bead than the pulse itself would lay, and a better one than a machine
      |  | |   -->   __/  \__      does that all but stops at every line of it.
      |__| |___     /        \__
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.errors import UsageError
from gcodectl.flow.library import BasisSet, BasisSignal
from gcodectl.records import TaskKind

LEARNED_KINDS = (TaskKind.STOP, TaskKind.START, TaskKind.CORNER)
"""The tasks whose signals have a length of their own; also the order of the bank's second axis."""
LONGEST = 100
"""Samples on either side that a signal may be spread over."""


@dataclasses.dataclass(frozen=True)
class SignalBank:
    """Signals by [tool, task]; `values` in mm^3/s a mm^3/s of nominal flow, one sample every `dt` s."""

    dt: float
    values: Floats
    """Shape (tools, 3, longest)."""
    count: Ints
    """K: samples of each signal, shape (tools, 3); 0 where nothing was learned."""
    lead: Floats
    """Seconds by which each begins before its task, shape (tools, 3)."""
    margin: Floats
    """Seconds of the lead that let the flow reach beyond the road, shape (tools, 3)."""
    dip: Floats
    """Seconds of flow that the learned Corner left out, shape (tools,)."""
    steady: Floats
    """Plunger rate a unit of flow takes, 1 / K, shape (tools,)."""
    put_back: Floats
    """What a Stop takes out over what a Start from rest puts in, shape (tools,)."""

    @property
    def longest_lead(self) -> float:
        """The most that any signal begins ahead of its task, s."""
        return float(self.lead.max(initial=0.0))

    @property
    def tail(self) -> float:
        """The most that any Stop goes on after its road, s."""
        stop = LEARNED_KINDS.index(TaskKind.STOP)
        return max(0.0, float((self.count[:, stop] * self.dt - self.lead[:, stop]).max(initial=0.0)))

    @property
    def neutral(self) -> bool:
        """Whether nothing was learned at all: the plunger simply follows the file."""
        return not self.count.any() and bool((self.steady == 1.0).all())


def signal_bank(sets: Sequence[BasisSet | None], dt: float = 0.01, slew: float = math.inf) -> SignalBank:
    """Make the bank of the tools' basis sets, None for a tool whose extruder obeys at once.

    Signals are softened until none changes by more than `slew`, mm^3/s^2. Raises UsageError where the sets were learned
    at different sample times.
    """
    learned = [one for one in sets if one is not None]
    if learned:
        dt = learned[0].dt
        if any(abs(one.dt - dt) > 1e-9 for one in learned):
            raise UsageError("the libraries were learned at different sample times; learn them again at one dt")
    soft = [None if one is None else {kind: softened(one, kind, slew) for kind in LEARNED_KINDS} for one in sets]
    longest = max((len(signal.values) for one in soft if one for signal in one.values()), default=1)
    tools, kinds = len(sets), len(LEARNED_KINDS)
    values, count = np.zeros((tools, kinds, longest)), np.zeros((tools, kinds), dtype=np.int64)
    lead, margin, dip, steady = np.zeros((tools, kinds)), np.zeros((tools, kinds)), np.zeros(tools), np.ones(tools)
    for tool, (one, signals) in enumerate(zip(sets, soft, strict=True)):
        if one is None or signals is None:
            continue
        steady[tool], dip[tool] = one.steady, one.signals[TaskKind.CORNER].dip
        for index, kind in enumerate(LEARNED_KINDS):
            signal = signals[kind]
            count[tool, index], lead[tool, index] = len(signal.values), signal.lead
            margin[tool, index] = signal.margin
            values[tool, index, : len(signal.values)] = signal.values / one.flow
    put_back = np.array([1.0 if one is None else _put_back(one) for one in sets])
    return SignalBank(
        dt=dt, values=values, count=count, lead=lead, margin=margin, dip=dip, steady=steady, put_back=put_back
    )


def softened(one: BasisSet, kind: TaskKind, slew: float) -> BasisSignal:
    """Return a task's signal with what it adds to the feed-forward spread until it changes by `slew` at the most.

    Averages about each sample lose no volume, and none of it comes sooner on the whole. What changes faster than
    LONGEST samples can mend stays as fast as it is then.
    """
    signal, reach = one.signals[kind], 0
    added = signal.values - _base(one, kind, signal.lead, len(signal.values))
    most, ends = slew * one.dt, np.zeros(1)
    spread = added
    while reach < LONGEST and np.abs(np.diff(np.concatenate([ends, spread, ends]))).max() > most:
        reach += 1
        width = 2 * reach + 1
        spread = np.convolve(added, np.full(width, 1.0 / width))
    if not reach:
        return signal
    lead = signal.lead + reach * one.dt
    return dataclasses.replace(signal, values=spread + _base(one, kind, lead, len(spread)), lead=lead)


def _base(one: BasisSet, kind: TaskKind, lead: float, count: int) -> Floats:
    """The feed-forward beneath a signal of `count` samples, mm^3/s at nominal flow; `flow.sequencer` has it too."""
    after = (np.arange(count) + 0.5) - lead / one.dt  # samples since the task's moment
    if kind == TaskKind.CORNER:
        share = (np.abs(after) >= 0.5 * one.signals[kind].dip / one.dt).astype(np.float64)
    else:
        share = np.clip((after if kind == TaskKind.START else -after) + 0.5, 0.0, 1.0)
    return np.asarray(one.steady * one.flow * share, dtype=np.float64)


def added_volume(one: BasisSet, kind: TaskKind) -> float:
    """Volume that a Start puts in, or a Stop takes out (negative), beyond the feed-forward; mm^3 at nominal flow."""
    signal = one.signals[kind]
    sooner = 1 if kind == TaskKind.START else -1
    lead = signal.lead - sooner * signal.margin
    long = len(signal.values) * one.dt
    on_road = long - lead if kind == TaskKind.START else lead
    return float(signal.values.sum()) * one.dt - one.steady * one.flow * on_road


def _put_back(one: BasisSet) -> float:
    put_in, taken_out = added_volume(one, TaskKind.START), -added_volume(one, TaskKind.STOP)
    return taken_out / put_in if put_in > 0 and taken_out > 0 else 1.0
