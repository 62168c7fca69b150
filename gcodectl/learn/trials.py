"""Trial after trial: what to run next, and when to stop.

A `Learner` does no input or output: it says which signal to run (`signal`), takes what was measured (`observe`), and
says when it is done (`stop`). A plant, a printer with a camera, or a folder of measured files can all feed it;
`run_trials` does so with an `Extruder`.

    signal -> [run it, measure q] -> observe(q) -> Trial;  stop? -> no: the next signal
                                                      |
         rms |\\              /  diverging             +-> settled: no new best for a few trials
             | \\          _/                          +-> diverging: the same, but the measured flow shows
             |  \\____..--'   best                     |   a dead time with which the law's |Q(1 - LP)|
             |      '--------- settled                |   exceeds 1, or the error runs away outright
             +---------------------> trial            +-> trials: enough of them

When it diverges, learning goes back to the best trial. Where a dead time explains it, the law's model is exchanged for
the one identified from the trials, its inversion advanced by the delay, and learning goes on from there, once.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from enum import StrEnum

import numpy as np

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.flow.limits import within_limits
from gcodectl.learn.convergence import convergence
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import Extruder, Model, identify
from gcodectl.learn.reference import Routine

PATIENCE = 4
"""Trials without a new best before learning stops, where nothing else is asked for."""
NOTICEABLE = 0.005
"""A new best is one that is lower by this share."""
FAINT = 0.05
"""An error of this share of the flow, or less, may be the measurement's own."""
RUNAWAY = 1.5
"""An error this many times the best, and above trial 0's, stops learning at once."""


class Stop(StrEnum):
    """Why learning stopped."""

    SETTLED = "settled"
    DIVERGING = "diverging"
    TRIALS = "trials"
    ENDED = "ended"
    """By whoever runs the trials."""


@dataclasses.dataclass(frozen=True)
class Trial:
    """One pass of the training routine."""

    number: int
    u: Floats
    """What the plunger was told, mm^3/s."""
    q: Floats
    """What was measured, mm^3/s."""
    error: Floats
    """q_ref - q, mm^3/s."""
    delay: float
    """Dead time in the law's model, s."""
    note: str = ""
    """What happened after this trial, where anything did."""

    @property
    def rms(self) -> float:
        """Root mean square of the error, mm^3/s."""
        return float(np.sqrt(np.mean(self.error**2)))


@dataclasses.dataclass(frozen=True)
class Limits:
    """What the plunger can do: mm^3/s and mm^3/s^2."""

    max_flow: float = np.inf
    max_flow_slew: float = np.inf


class Learner:
    """Learning on one routine; see the top of this file."""

    def __init__(
        self,
        routine: Routine,
        law: Law,
        limits: Limits,
        *,
        max_trials: int = 31,
        first: Floats | None = None,
        retry_with_delay: bool = True,
        patience: int = PATIENCE,
    ) -> None:
        assert law.dt == routine.dt, "the law and the routine have different samples"
        self.routine, self.law, self.limits = routine, law, limits
        self.max_trials, self.retry_with_delay, self.patience = max_trials, retry_with_delay, patience
        self.reference = routine.q_ref
        self.signal = self._limited(self.reference if first is None else first)
        self.trials: list[Trial] = []
        self.stop: Stop | None = None
        self.found: Model | None = None
        """The model identified from the trials, where it showed that the law would diverge."""
        self._phase = 0

    @property
    def best(self) -> Trial:
        """The trial with the smallest error so far."""
        return min(self.trials, key=lambda trial: trial.rms)

    @property
    def notes(self) -> list[str]:
        """What happened on the way, in order."""
        return [trial.note for trial in self.trials if trial.note]

    def observe(self, q: Floats, number: int | None = None) -> Trial:
        """Take the flow measured (n samples, mm^3/s) while `signal` ran; raises InputError where it does not fit.

        `number` is the trial's, where some before it do not count; 0 for the first.
        """
        assert self.stop is None, "learning has stopped"
        q = np.asarray(q, dtype=np.float64)
        if q.shape != self.reference.shape:
            raise InputError(f"the measured flow has shape {q.shape}; the routine has {len(self.reference)} samples")
        if not np.isfinite(q).all():
            raise InputError("the measured flow has samples that are no numbers")
        trial = Trial(
            len(self.trials) if number is None else number, self.signal, q, self.reference - q, self.law.model.delay
        )
        self.trials.append(trial)
        note = self._judge()
        if note:
            trial = dataclasses.replace(trial, note=note)
            self.trials[-1] = trial
        return trial

    def _judge(self) -> str:
        """Set `stop` or the next signal; return what there is to say."""
        phase = self.trials[self._phase :]
        last = phase[-1]
        diverging = self._runaway(phase)
        if diverging or self._stalled(phase):
            found = self._diagnosis(phase)
            if found is not None:
                return self._diverging(found)
            if diverging:
                self.stop = Stop.DIVERGING
                return f"diverging, and no dead time explains it; trial {self.best.number} is kept"
            self.stop = Stop.SETTLED
            return f"settled: the error no longer falls; trial {self.best.number} is the best and is kept"
        if len(self.trials) >= self.max_trials:
            self.stop = Stop.TRIALS
            return f"stopped after {len(self.trials)} trials; trial {self.best.number} is the best"
        self.signal = self._limited(self.law.update(last.u, last.error))
        return ""

    def _diverging(self, found: Model) -> str:
        check = convergence(self.law, found)
        self.found = found
        said = (
            f"the measured flow comes {found.delay - self.law.model.delay:.2f} s later than the model says; "
            f"with that, {check.sentence()}: back to trial {self.best.number}"
        )
        law = dataclasses.replace(self.law, model=found)
        if self.retry_with_delay and self._phase == 0 and len(self.trials) < self.max_trials:
            self.law, self._phase = law, len(self.trials)
            self.signal = self._limited(law.update(self.best.u, self.best.error))
            return f"{said}, and on with the delay in the model"
        self.stop = Stop.DIVERGING
        return said

    def _diagnosis(self, phase: list[Trial]) -> Model | None:
        """Return the model that the trials show, where the law would diverge on it for its delay; else None."""
        u, q = np.stack([trial.u for trial in phase]), np.stack([trial.q for trial in phase])
        found = identify(u, q, self.law.dt)
        late = found.delay_samples(self.law.dt) > self.law.model.delay_samples(self.law.dt)
        return found if late and not convergence(self.law, found).converges else None

    def _runaway(self, phase: list[Trial]) -> bool:
        best = min(trial.rms for trial in phase)
        return phase[-1].rms > max(RUNAWAY * best, self.trials[0].rms)

    def _stalled(self, phase: list[Trial]) -> bool:
        if len(phase) <= self.patience:
            return False
        before = min(trial.rms for trial in phase[: -self.patience])
        return min(trial.rms for trial in phase[-self.patience :]) > (1 - NOTICEABLE) * before

    def _limited(self, u: Floats) -> Floats:
        return within_limits(u, self.limits.max_flow, self.limits.max_flow_slew, self.routine.dt)


def run_trials(extruder: Extruder, learner: Learner) -> Iterator[Trial]:
    """Run `learner` on `extruder` until it stops, a Trial at a time."""
    while learner.stop is None:
        yield learner.observe(extruder(learner.signal, learner.routine.dt))
