"""Learning with a flow model: fit, plan, try, and fit again; plain learning control where no model predicts.

    trial 0: the reference itself --> q --> fit every structure --> the one that predicts what was held back
                 ^                                                        |
                 |   next trial: the signal that comes nearest by the model, under the plunger's limits (`learn.refine`)
                 +--------------------------------------------------------+

A model is trusted only as far as it predicts: while its prediction of a trial that was held back misses by more than
TRUST of trial 0's error, the next signal is the plain law's. Learning has settled when a prediction misses by less than
EXACT of the nominal flow, when the model's own plan promises no more than the last trial reached (it is not sent), when
no trial was better for a while, when the error of trial 0 was FAINT and a later one's ran away, or when predictions no
longer get better: what is left is noise in the measurement.

The model that is kept is the one fitted to all trials, if the best trial is one that was planned and it predicts.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats
from gcodectl.flow.flow_model import STRUCTURES, FlowModel
from gcodectl.flow.inversion import Inversion
from gcodectl.learn.fit import TIE, Fit, Record, choose, own_gain
from gcodectl.learn.refine import refined
from gcodectl.learn.trials import FAINT, Learner, Stop, Trial

TRUST = 0.5
"""Share of trial 0's error that a prediction may miss by."""
EXACT = 0.01
"""Share of the nominal flow: a prediction this good needs no further trial."""
NOISE_TRIALS = 5
"""After so many trials, three predictions in a row that are no better than those before say that noise is left."""
NEAR = 1.5
"""Structures that are off by more than this many times the best one, and by TIE, are not tried again: what an exact
measurement leaves is no reason to prefer one. The one in use always is: it alone was fitted to the last trial."""


class ModelLearner(Learner):
    """Learning on one routine, by a flow model where one predicts; see the top of this file and `learn.trials`."""

    fitted: Fit | None = None
    """The model fitted to all trials so far, trusted or not."""
    missed = np.inf
    """What its prediction of the last trial missed by, a share of the nominal flow."""
    _known: tuple[Fit, ...] = ()
    _misses: tuple[float, ...] = ()

    @property
    def model(self) -> FlowModel | None:
        """The model that may be used: it predicts, and what was planned with it was better than the reference."""
        planned = len(self.trials) > 1 and self.best.number > 0
        return self.fitted.model if self.fitted and self._trusted and planned else None

    @property
    def best(self) -> Trial:
        """The trial with the smallest error, each print's own factor taken out where a model tells what it is."""
        if not self._trusted:
            return super().best
        return min(self.trials, key=self._shape_error)

    def _shape_error(self, trial: Trial) -> float:
        assert self.fitted is not None, "a trial has been observed"
        model = self.fitted.model
        gain = own_gain(model.predict(trial.u, self.routine.dt), trial.q, model.flow)
        return float(np.sqrt(np.mean((self.reference - trial.q / gain) ** 2)))

    @property
    def _trusted(self) -> bool:
        """Whether the model predicts; not one that flows as much as is wanted, or more, with nothing pushed."""
        if self.fitted is None or not self.fitted.model.steady_rate(self.routine.flow) > 0.0:
            return False
        return bool(self.missed * self.routine.flow < TRUST * self.trials[0].rms)

    def _judge(self) -> str:
        """Set `stop` or the next signal; return what there is to say."""
        trials = [Record(trial.u, trial.q) for trial in self.trials]
        least = min((one.rms for one in self._known), default=0.0)
        near = [
            one.model.structure for one in self._known if one is self.fitted or one.rms < max(NEAR * least, least + TIE)
        ]
        self.fitted, self.missed, known = choose(
            trials, self.routine.dt, self.routine.flow, self._known, near or STRUCTURES
        )
        self._known = tuple(known)
        best = self.best.number
        self._misses = (*self._misses, self.missed)
        if len(self._misses) > NOISE_TRIALS and min(self._misses[-3:]) > 0.9 * min(self._misses[:-3]) and self._trusted:
            self.stop = Stop.SETTLED
            return f"settled: predictions stay off by {100 * self.missed:.1f} % of the flow, as much as is measured"
        if self.missed < EXACT and len(self.trials) > 2:
            self.stop = Stop.SETTLED
            return f"settled: the {self.fitted.model.structure} model predicts to {100 * self.missed:.1f} % of the flow"
        if len(self.trials) >= self.max_trials:
            self.stop = Stop.TRIALS
            return f"stopped after {len(self.trials)} trials; trial {best} is the best"
        if self._runaway(self.trials) and best == 0 and self.trials[0].rms < FAINT * self.routine.flow:
            self.stop = Stop.SETTLED
            return "settled: trial 0 is as near as these measurements can tell, and no trial was better"
        if self._runaway(self.trials) and best == 0:
            self.stop = Stop.DIVERGING
            return "diverging, and no model predicts what comes out"
        if self._runaway(self.trials) or self._stalled(self.trials):
            self.stop = Stop.SETTLED
            return f"settled: the error no longer falls; trial {best} is the best and is kept"
        return self._next()

    def _next(self) -> str:
        """Set the next signal: the model's plan where it may be trusted, else what the law makes of the best trial."""
        assert self.fitted is not None, "a trial has been observed"
        model, off = self.fitted.model, f"{100 * self.missed:.1f} % of the flow"
        if self._trusted:
            plan = self._plan(model)
            promised = float(np.sqrt(np.mean((self.reference - model.predict(plan, self.routine.dt)) ** 2)))
            if promised < self.trials[-1].rms:
                self.signal = plan
                return f"{model.structure} model, its prediction off by {off}: planned with it"
            if len(self.trials) > 1:
                self.stop = Stop.SETTLED
                return f"settled: the {model.structure} model has no better plan; trial {self.best.number} is the best"
        best = self.best
        self.signal = self._limited(self.law.update(best.u, best.error))
        return f"no model predicts (off by {off}): plain learning goes on"

    def _plan(self, model: FlowModel) -> Floats:
        """Return the signal with which the model comes nearest to the routine's flow."""
        inversion = Inversion(model, self.limits.max_flow, self.limits.max_flow_slew, self.routine.dt)
        return refined(inversion, self.reference)
