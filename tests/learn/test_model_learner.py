"""Learning with a flow model: few trials where one predicts, plain learning and no model where none does."""

from __future__ import annotations

import numpy as np
import pytest
from flow_models import LINEAR

from gcodectl.columns import Floats
from gcodectl.config import load_machine
from gcodectl.errors import InputError
from gcodectl.learn.ilc import Law
from gcodectl.learn.model import Extruder, Model
from gcodectl.learn.model_learner import EXACT, ModelLearner
from gcodectl.learn.reference import Routine, training_routine, with_levels
from gcodectl.learn.training import Setup, finish, prepare
from gcodectl.learn.trials import Learner, Limits, Stop, run_trials
from plant_models.plant import load_plant
from plant_models.trial import as_trial, measured_by_camera

FLOW = 5.0
DT = 0.02


def routine() -> Routine:
    return with_levels(training_routine(FLOW, lag=1.0, dt=DT, lengths=(2.0, 4.0, 4.0, 2.0)))


def learn(
    extruder: Extruder, model: Model | None = None, kind: type[Learner] = ModelLearner, trials: int = 9
) -> Learner:
    law = Law(model or Model(1.0, 1.0), DT)
    learner = kind(routine(), law, Limits(25.0, 2000.0), max_trials=trials)
    list(run_trials(extruder, learner))
    return learner


def plant(name: str) -> Extruder:
    return as_trial(load_plant(name, flow=FLOW))


def ratio(learner: Learner) -> float:
    return learner.best.rms / learner.trials[0].rms


@pytest.mark.parametrize(
    ("name", "structures", "most"),
    [
        ("linear", ("linear",), 4),
        ("syringe-dead", ("plunger", "backlash"), 9),
        ("pneumatic", ("pressure",), 9),
        ("pellet", ("screw",), 9),
    ],
)
def test_a_few_trials_teach_what_plain_learning_takes_long_for(
    name: str, structures: tuple[str, ...], most: int
) -> None:
    learner = learn(plant(name))
    assert isinstance(learner, ModelLearner)
    assert learner.model is not None
    assert learner.model.structure in structures
    assert len(learner.trials) <= most
    plain = learn(plant(name), kind=Learner, trials=len(learner.trials))
    assert ratio(learner) < 0.9 * ratio(plain)
    assert all(np.abs(trial.u).max() <= 25.0 for trial in learner.trials)
    assert "planned with it" in learner.notes[0]


def test_it_settles_when_the_model_is_exact() -> None:
    learner = learn(lambda u, dt: LINEAR.predict(u, dt))
    assert isinstance(learner, ModelLearner)
    assert learner.stop is Stop.SETTLED
    assert learner.missed < EXACT
    assert learner.notes[-1].startswith("settled: the linear model")
    assert learner.model is not None
    assert pytest.approx(LINEAR.K, rel=0.01) == learner.model.K
    assert learner.model.delay == pytest.approx(LINEAR.delay, abs=0.01)


def test_noise_is_no_reason_to_stop_early_or_to_mistrust() -> None:
    r = routine()
    learner = learn(measured_by_camera(plant("syringe"), r.v, noise=1.0, seed=3))
    assert isinstance(learner, ModelLearner)
    assert learner.model is not None
    assert len(learner.trials) > 3
    assert ratio(learner) < 0.6


class Wild:
    """An extruder that does, in pieces of half a second, what it likes: of no structure, and another in every trial."""

    def __init__(self, share: float, growth: float = 1.0) -> None:
        self.share, self.growth, self.runs = share, growth, 0

    def __call__(self, u: Floats, dt: float) -> Floats:
        rng = np.random.default_rng(self.runs)
        q = LINEAR.predict(u, dt)
        wild = np.abs(rng.normal(scale=FLOW, size=len(u) * 2)).repeat(round(0.5 / dt))[: len(u)]
        factor = self.growth**self.runs
        self.runs += 1
        return np.asarray(factor * ((1.0 - self.share) * q + self.share * wild), dtype=np.float64)


def test_where_no_model_predicts_plain_learning_goes_on_and_none_is_kept() -> None:
    learner = learn(Wild(0.9), trials=5)
    assert isinstance(learner, ModelLearner)
    assert learner.model is None
    assert learner.fitted is not None
    assert any("no model predicts" in note for note in learner.notes)
    # and the signals were the plain law's
    first = learner.trials[0]
    assert np.array_equal(learner.trials[1].u, learner._limited(learner.law.update(first.u, first.error)))


def test_what_only_gets_worse_diverges() -> None:
    learner = learn(Wild(0.9, growth=2.0))
    assert learner.stop is Stop.DIVERGING
    assert learner.best.number == 0
    assert len(learner.trials) < 9
    assert isinstance(learner, ModelLearner)
    assert learner.model is None


def test_an_extruder_that_obeys_at_once_needs_no_model() -> None:
    learner = learn(lambda u, _dt: np.maximum(u, 0.0))
    assert learner.stop is not None
    assert learner.best.rms <= learner.trials[0].rms


def test_it_takes_measured_data_as_any_learner_does() -> None:
    learner = ModelLearner(routine(), Law(Model(1.0, 1.0), DT), Limits())
    assert learner.model is None
    with pytest.raises(InputError, match="shape"):
        learner.observe(np.zeros(3))
    learner.observe(LINEAR.predict(learner.signal, DT))
    assert learner.fitted is not None
    assert learner.model is None  # one trial is not yet a plan that was tried
    assert not np.array_equal(learner.signal, learner.reference)


def test_the_best_trial_is_the_one_that_flowed_best_not_the_one_that_was_read_narrow() -> None:
    learner = ModelLearner(routine(), Law(Model(1.0, 1.0), DT), Limits(25.0, 2000.0))
    read = iter((1.0, 1.15, 1.0, 0.98))  # a camera's factor for each print
    truth = []
    while learner.stop is None and len(truth) < 4:
        # planned well, planned well, and then as nobody would plan
        u = learner.signal if len(truth) != 3 else 0.5 * (learner.signal + learner.reference)
        learner.signal = u
        q = LINEAR.predict(u, DT)
        own = float(q @ learner.reference) / float(q @ q)  # how much flows, a camera that reads so cannot tell
        truth.append(float(np.sqrt(np.mean((learner.reference - own * q) ** 2))))
        learner.observe(next(read) * q, number=2 * len(truth) - 2)
    assert [trial.number for trial in learner.trials] == [0, 2, 4, 6][: len(truth)]
    best = learner.trials.index(learner.best)
    assert truth[best] == pytest.approx(min(truth), rel=0.05)
    assert learner.trials[1].rms > learner.trials[2].rms  # by its factor alone


def taught(extruder: Extruder, trials: int = 9) -> tuple[Setup, list[int]]:
    setup = prepare(extruder, load_machine("syringe"), nozzle=0.84, flow=FLOW, max_trials=trials)
    return setup, [trial.number for trial in run_trials(extruder, setup.learner)]


def test_what_is_finished_ships_the_model_and_says_so() -> None:
    setup, numbers = taught(plant("syringe"))
    assert 1 < len(numbers) <= 9
    assert setup.routine.more
    one = finish(setup, material="m", nozzle=0.84, made_by={"plant": "syringe"})
    assert one.model == setup.learner.model is not None
    said = one.training["flow_model"]
    assert said["serves"]
    assert said["structure"] in ("plunger", "backlash")
    assert said["prediction_off"] == pytest.approx(setup.learner.missed, abs=1e-6)
    assert one.training["safe"]
    # the paper's signals are cut from the routine's first part
    assert max(len(signal.values) for signal in one.signals.values()) < len(setup.routine.first.t)


def test_what_nothing_predicts_ships_signals_alone() -> None:
    wild = Wild(0.6)
    calls = []

    def extruder(u: Floats, dt: float) -> Floats:
        calls.append(len(u))
        return LINEAR.predict(u, dt) if len(calls) == 1 else wild(u, dt)  # the step is as it should be

    setup, _ = taught(extruder, 4)
    one = finish(setup, material="m", nozzle=0.84, made_by={})
    assert one.model is None
    assert not one.training["flow_model"]["serves"]


def test_an_extruder_that_obeys_at_once_and_is_measured_with_noise_does_not_diverge() -> None:
    rng = np.random.default_rng(3)

    def extruder(u, _dt):
        return np.maximum(u, 0.0) * (1.0 + rng.normal(0.0, 0.06))  # as a camera reads one print and the next

    learner = ModelLearner(routine(), Law(Model(1.0, 1.0), DT), Limits(25.0, 2000.0))
    learner.observe(routine().q_ref)
    while learner.stop is None:
        learner.observe(extruder(learner.signal, DT))
    assert learner.stop == Stop.SETTLED
    assert not any("diverging" in note for note in learner.notes)


def test_what_flows_a_thousand_times_as_much_as_is_pushed_is_not_planned_with() -> None:
    """A measurement in another unit, taken all the same: its model says that all flows with nothing pushed."""
    barrel = plant("linear")
    law = Law(Model(1.0, 1.0), DT)
    learner = ModelLearner(routine(), law, Limits(25.0, 2000.0))
    trial = learner.observe(1000.0 * barrel(learner.signal, DT))
    assert learner.fitted is not None
    assert learner.fitted.model.steady_rate(FLOW) <= 0.0
    assert learner.model is None
    assert "plain learning goes on" in trial.note
