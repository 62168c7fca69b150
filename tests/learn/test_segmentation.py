from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gcodectl.errors import InputError
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import Model
from gcodectl.learn.reference import training_routine
from gcodectl.learn.segmentation import basis_set, find_segments
from gcodectl.learn.trials import Learner, Limits, run_trials
from gcodectl.records import TaskKind

ROUTINE = training_routine(5.0)


def synthetic(noise=0.0, seed=0):
    """A signal whose tasks lie where we put them: triangles on a pulse."""
    t = ROUTINE.t + 1e-9
    brake, again = ROUTINE.corner
    u = np.where((t >= ROUTINE.start - 0.5) & (t < ROUTINE.stop - 0.3), 4.0, 0.0)
    u += np.clip(1 - np.abs(t - ROUTINE.start) / 0.5, 0, None) * 20
    u -= np.clip(1 - np.abs(t - ROUTINE.stop) / 0.6, 0, None) * 20
    u[(t >= brake - 0.4) & (t < again + 0.7)] = -3.0
    return u + noise * np.random.default_rng(seed).normal(size=len(t))


@pytest.mark.parametrize(("noise", "slack"), [(0.0, 0.02), (0.1, 0.12)])
def test_demarcation_points_are_where_the_signal_leaves_its_level(noise, slack):
    segments = find_segments(synthetic(noise), ROUTINE)
    dt = ROUTINE.dt
    brake, again = ROUTINE.corner
    assert segments.steady == pytest.approx(4.0, abs=0.02)
    assert segments.start[0] * dt == pytest.approx(ROUTINE.start - 0.5, abs=slack)
    assert segments.start[1] * dt == pytest.approx(ROUTINE.start + 0.5, abs=slack)
    assert segments.corner[0] * dt == pytest.approx(brake - 0.4, abs=slack)
    assert segments.corner[1] * dt == pytest.approx(again + 0.7, abs=slack)
    assert segments.stop[0] * dt == pytest.approx(ROUTINE.stop - 0.6, abs=slack)
    assert segments.stop[1] * dt == pytest.approx(ROUTINE.stop + 0.6, abs=slack)


def test_segments_cover_the_signal_in_the_papers_order():
    pieces = find_segments(synthetic(), ROUTINE).in_order(len(ROUTINE.t))
    assert [kind.label for kind, _, _ in pieces] == [
        "No-Flow", "Start", "Steady-State", "Corner", "Steady-State", "Stop", "No-Flow",
    ]  # fmt: skip
    assert pieces[0][1] == 0
    assert pieces[-1][2] == len(ROUTINE.t)
    assert all(before[2] == after[1] for before, after in pairwise(pieces))


@pytest.mark.parametrize("cap", [np.inf, 25.0])
@pytest.mark.parametrize("model", [Model(1.08, 2.7), Model(0.89, 4.5), Model(1.0, 0.05)])
def test_a_learned_signal_becomes_a_basis_set(plant, model, cap):
    routine = training_routine(5.0, lag=model.tau)
    learner = Learner(routine, Law(model, routine.dt), Limits(cap))
    list(run_trials(plant(model.K, model.tau), learner))
    u = learner.best.u
    found = basis_set(u, routine, material="paste", nozzle=0.84, training={"plant": "test"})
    start, corner, stop = (found.signals[kind] for kind in (TaskKind.START, TaskKind.CORNER, TaskKind.STOP))
    assert found.steady == pytest.approx(1 / model.K, rel=0.01)
    assert found.signals[TaskKind.NO_FLOW].values.tolist() == [0.0]
    assert corner.dip == pytest.approx(routine.dip)
    for signal in (start, corner, stop):
        assert 0.05 < signal.lead < 2.0
        assert signal.lead < len(signal.values) * routine.dt
    assert abs(start.values[0]) < 0.02 * u.max()
    assert start.values[-1] == pytest.approx(5.0 / model.K, rel=0.03)
    assert stop.values[0] == pytest.approx(5.0 / model.K, rel=0.03)
    first = round((routine.start - start.lead) / routine.dt)
    np.testing.assert_allclose(u[first : first + len(start.values)], start.values, atol=1e-5)


def test_a_set_played_back_lays_the_volume_that_was_asked_for(plant):
    """What segmentation leaves out (below the threshold) must not matter."""
    model = Model(1.08, 2.7)
    learner = Learner(ROUTINE, Law(model, ROUTINE.dt), Limits(25.0))
    list(run_trials(plant(1.08, 2.7), learner))
    segments = find_segments(learner.best.u, ROUTINE)
    u = np.zeros(len(ROUTINE.t))
    for kind, first, last in segments.in_order(len(u)):
        if kind is TaskKind.STEADY:
            u[first:last] = segments.steady
        elif kind is not TaskKind.NO_FLOW:
            u[first:last] = learner.best.u[first:last]
    error = ROUTINE.q_ref - plant(1.08, 2.7)(u, ROUTINE.dt)
    assert np.sqrt(np.mean(error**2)) == pytest.approx(learner.best.rms, rel=0.05)


def test_tasks_that_never_come_to_rest_meet_half_way():
    t = ROUTINE.t
    u = np.where((t > 4) & (t < ROUTINE.stop), 5 + 3 * np.sin(t * 9), np.sin(t * 9))
    segments = find_segments(u, ROUTINE)
    assert segments.start[1] <= segments.corner[0]
    assert segments.corner[1] <= segments.stop[0]


def test_nothing_learned_is_an_input_error():
    with pytest.raises(InputError, match="no steady level"):
        find_segments(np.zeros(len(ROUTINE.t)), ROUTINE)
