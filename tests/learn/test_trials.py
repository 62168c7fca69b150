from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gcodectl.errors import InputError
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import Model
from gcodectl.learn.reference import training_routine
from gcodectl.learn.trials import Learner, Limits, Stop, run_trials

A, B = Model(1.08, 2.7), Model(0.89, 4.5)


def learn(plant, model, *, delay=0.0, noise=0.0, causal=False, limits=None, **options):
    routine = training_routine(5.0, lag=model.tau)
    law = Law(model, routine.dt, causal=causal)
    learner = Learner(routine, law, limits or Limits(), **options)
    list(run_trials(plant(model.K, model.tau, delay, noise=noise), learner))
    return learner


def ratio(learner):
    return learner.best.rms / learner.trials[0].rms


@pytest.mark.parametrize("model", [A, B])
def test_the_papers_figure_a_fifth_of_the_first_error_within_31_trials(plant, model):
    learner = learn(plant, model)
    assert learner.stop is Stop.SETTLED
    assert len(learner.trials) <= 31
    assert ratio(learner) <= 0.20
    assert "settled" in learner.notes[-1]
    causal = learn(plant, model, causal=True)
    assert ratio(causal) > 0.30


@pytest.mark.parametrize(("model", "optimum"), [(A, 0.232), (B, 0.247)])
def test_under_the_plungers_cap_learning_reaches_what_can_be_reached(plant, model, optimum):
    learner = learn(plant, model, limits=Limits(25.0, 2000.0))
    assert max(np.abs(trial.u).max() for trial in learner.trials) <= 25.0
    assert ratio(learner) == pytest.approx(optimum, rel=0.03)


@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("model", [A, B])
def test_dead_time_is_found_and_learning_goes_on_with_it(plant, model, noise):
    learner = learn(plant, model, delay=0.2, noise=noise)
    assert learner.found is not None
    assert learner.found.delay == pytest.approx(0.2, rel=0.2)
    assert "would diverge" in learner.notes[0]
    assert learner.trials[-1].delay == pytest.approx(0.2, rel=0.2)
    assert learner.stop is Stop.SETTLED
    assert ratio(learner) <= 0.20


def test_dead_time_stops_learning_at_the_best_trial_where_no_retry_is_wanted(plant):
    learner = learn(plant, A, delay=0.2, retry_with_delay=False)
    assert learner.stop is Stop.DIVERGING
    assert learner.found.delay == pytest.approx(0.2, rel=0.2)
    assert learner.best.number < len(learner.trials) - 1
    assert max(trial.rms for trial in learner.trials) == learner.trials[0].rms


def test_the_plain_law_on_dead_time_does_diverge_if_nobody_stops_it(plant):
    routine = training_routine(5.0)
    law, extruder, u = Law(A, routine.dt), plant(1.08, 2.7, 0.2), routine.q_ref
    errors = []
    for _ in range(60):
        error = routine.q_ref - extruder(u, routine.dt)
        errors.append(np.sqrt(np.mean(error**2)))
        u = law.update(u, error)
    assert errors[-1] > 2.5 * min(errors)


def test_an_error_that_runs_away_for_another_reason_stops_learning(plant):
    routine = training_routine(5.0)
    learner = Learner(routine, Law(dataclasses.replace(A, K=0.1), routine.dt), Limits())
    list(run_trials(plant(1.08, 2.7), learner))
    assert learner.stop is Stop.DIVERGING
    assert len(learner.trials) < 10
    assert "no dead time explains it" in learner.notes[-1]


def test_learning_ends_with_the_trials_it_may_run(plant):
    learner = learn(plant, A, max_trials=5)
    assert learner.stop is Stop.TRIALS
    assert len(learner.trials) == 5
    assert learner.best.number == 4


def test_noise_settles_too(plant):
    learner = learn(plant, A, noise=0.1)
    assert learner.stop is Stop.SETTLED
    assert ratio(learner) < 0.20


def test_a_learner_takes_measured_data_and_checks_it(plant):
    routine = training_routine(5.0)
    learner = Learner(routine, Law(A, routine.dt), Limits())
    with pytest.raises(InputError, match="shape"):
        learner.observe(np.zeros(3))
    with pytest.raises(InputError, match="no numbers"):
        learner.observe(np.full(len(routine.t), np.nan))
    trial = learner.observe(plant(1.08, 2.7)(learner.signal, routine.dt))
    assert trial.number == 0
    assert learner.stop is None
    np.testing.assert_allclose(trial.error, routine.q_ref - trial.q)


def test_learning_may_begin_where_it_left_off(plant):
    first = learn(plant, A)
    again = learn(plant, A, first=first.best.u)
    assert again.trials[0].rms == pytest.approx(first.best.rms)
    assert len(again.trials) < len(first.trials)


def test_more_dead_time_than_can_be_identified_still_stops_no_worse_than_it_began(plant):
    learner = learn(plant, A, delay=1.5)
    assert learner.stop is not None
    assert learner.best.rms <= learner.trials[0].rms
    assert max(trial.rms for trial in learner.trials) < 2 * learner.trials[0].rms


def test_more_patience_learns_all_trials(plant):
    learner = learn(plant, A, patience=31)
    assert learner.stop is Stop.TRIALS
    assert len(learner.trials) == 31
