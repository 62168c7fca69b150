"""The learning loop: begin, take, advance, drop, library, on the virtual printer."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from sessions import areas, learned, printed, session

from gcodectl.config import load_machine
from gcodectl.errors import InputError, UnsafeError, UsageError
from gcodectl.learn.trials import Stop
from gcodectl.session.measured import Series
from gcodectl.session.record import load, save
from gcodectl.session.replay import deviation, replay
from gcodectl.session.steps import advance, begin, drop, library, take


def test_a_session_learns_and_its_library_predicts():
    now = session()
    while True:
        now, setup = advance(take(now, None, [areas(now, noise=0.02, seed=len(now.trials))]))
        if setup.learner.stop is not None:
            break
    assert setup.learner.stop is Stop.SETTLED
    assert len(now.trials) <= 8
    assert all(one.prints for one in now.trials)
    assert setup.learner.best.rms < 0.35 * setup.learner.trials[0].rms
    one, _ = library(now)
    assert one.key == "clay@0.84"
    assert one.model is not None
    assert one.model.steady_rate(5.0) == pytest.approx(5.0, rel=0.04)
    assert one.training["prints"] == len(now.trials)
    assert one.training["plant"] == "a machine"


def test_a_session_goes_on_from_its_file_as_if_it_had_never_stopped(tmp_path):
    now = learned(1)
    save(now, tmp_path)
    again = load(tmp_path)
    series = [areas(now, noise=0.02, seed=5)]
    (one, first), (other, second) = (advance(take(each, None, series)) for each in (now, again))
    assert first.learner.trials[-1].rms == second.learner.trials[-1].rms
    assert one.trials[-1].u.tolist() == other.trials[-1].u.tolist()


def test_prints_of_one_trial_are_averaged_and_tell_how_sure_they_are():
    now = session()
    several = [areas(now, noise=0.1, seed=seed) for seed in range(4)]
    now = take(now, None, several)
    (trial,) = now.trials
    assert deviation(trial) is not None
    exact = take(session(), None, [areas(session())]).trials[0].q
    one_off = np.sqrt(np.mean((trial.prints[0].q - exact) ** 2))
    mean_off = np.sqrt(np.mean((trial.q - exact) ** 2))
    assert mean_off < one_off
    assert 0.3 < deviation(trial) / mean_off < 3.0
    assert deviation(dataclasses.replace(trial, prints=trial.prints[:1])) is None


def test_a_trial_printed_again_is_averaged_and_the_one_on_the_printer_stays_as_it_is():
    now = learned(1)
    waiting = now.trials[-1].u
    with pytest.raises(UsageError, match="no trial 7"):
        take(now, 7, [areas(now)])
    now, _ = advance(take(now, 0, [areas(now, 0, noise=0.3, seed=9)], anyway=True))
    assert [len(one.prints) for one in now.trials] == [2, 0]
    assert now.trials[-1].u.tolist() == waiting.tolist()


def test_a_dropped_trial_does_not_count_and_can_be_measured_again():
    now = learned(2)
    before = len(now.trials)
    now = drop(now, 1)
    assert now.trials[1].dropped == ("print 1",)
    with pytest.raises(UsageError, match="trial 1 has no measurement to drop"):
        drop(now, 1)
    now, setup = advance(now)
    assert [one.number for one in setup.learner.trials] == [0]
    assert len(now.trials) <= before
    now = drop(learned(2), 0)
    with pytest.raises(InputError, match="trial 0 is not measured, and all others build on it"):
        replay(now)
    now, setup = advance(take(now, None, [areas(now, 0, noise=0.02, seed=8)]))
    assert [one.number for one in setup.learner.trials] == [0, 1]


def test_one_print_of_a_trial_can_be_dropped_alone():
    now = learned(1)
    now = take(now, 0, [areas(now, 0, noise=0.3, seed=9)], anyway=True)
    first, second = now.trials[0].prints
    for place in (0, 3):
        with pytest.raises(UsageError, match=f"trial 0 has no print {place}: it has 2$"):
            drop(now, 0, place)
    left = drop(now, 0, 1)
    assert left.trials[0].prints == (second,)
    assert left.trials[0].dropped == (first.source,)
    assert drop(now, 0, 2).trials[0].prints == (first,)


def test_what_was_measured_already_is_not_taken_for_another_print():
    now = session()
    series = areas(now)
    now, _ = advance(take(now, None, [series]))
    with pytest.raises(InputError, match="is what print 0 was, trial 0's measurement: give trial 1's"):
        take(now, None, [series])


def test_a_fault_is_refused_and_taken_anyway_with_a_note():
    now = session()
    series = areas(now)
    half = dataclasses.replace(series, x=series.x[:800], y=series.y[:800])
    with pytest.raises(InputError, match=r"print 0: covers s .* measure the rest. --anyway takes it as it is"):
        take(now, None, [half])
    kept = take(now, None, [half], anyway=True)
    assert kept.trials[0].prints[0].faults[0].startswith("short: covers s")
    early = dataclasses.replace(series, x=series.x - 6.0)  # 0.6 s: within what is missed at the end
    more = np.arange(early.x[-1], 343.0, 0.25)
    with pytest.raises(InputError, match="before the plunger moves"):
        take(now, None, [dataclasses.replace(early, x=np.append(early.x, more), y=np.append(early.y, 0.0 * more))])


def test_what_looks_like_another_unit_is_taken_as_it_is_too():
    now = session()
    series = areas(now)
    long = dataclasses.replace(series, x=series.x / 10.0)
    with pytest.raises(
        InputError, match=r"it looks like another unit; say it in the heading, as in `s \[cm\]`"
    ) as caught:
        take(now, None, [long])
    assert str(caught.value).count("it looks like") == 1
    taken = take(now, None, [long], anyway=True).trials[0].prints[0]
    assert taken.q.max() == pytest.approx(series.y.max() * now.setup.printout.layout.speed, rel=0.2)
    assert [fault.split(":")[0] for fault in taken.faults] == ["scale"]


def test_a_sensor_without_its_zero_is_noted():
    now = session()
    series = areas(now)
    taken = take(now, None, [dataclasses.replace(series, y=series.y + 0.05)]).trials[0].prints[0]
    assert taken.faults == ()
    assert "before the plunger moves: see to the zero" in taken.notes[0]


def test_a_shift_mends_a_begin_that_was_off():
    now = session()
    series = areas(now)
    late = dataclasses.replace(series, x=series.x + 3.0)
    mended = take(now, None, [late], shift=-3.0 / now.setup.printout.layout.speed).trials[0]
    assert mended.q[50:-50] == pytest.approx(take(now, None, [series]).trials[0].q[50:-50], abs=1e-6)


def test_nothing_is_stored_where_nothing_was_learned():
    with pytest.raises(InputError, match="trial 0 is not measured"):
        library(session())
    now, _ = advance(take(session(), None, [areas(session())]))
    with pytest.raises(UnsafeError, match=r"no trial is better than the first one.*go on with `gcodectl learn next`"):
        library(now)


def test_an_extruder_that_needs_no_signals_is_said():
    now = session()
    routine = now.setup.routine
    for k in range(2):
        rng = np.random.default_rng(k)
        q = now.trials[0].u * (1.0 + (0.02 + 0.2 * k) * rng.normal(size=len(routine.t)))
        series = Series("t,q", routine.t + routine.dt / 2.0, q, source=str(k))
        now, _ = advance(take(now, None, [series]))
    with pytest.raises(UnsafeError, match=r"trial 0 is off by 1 % of the flow already, .* needs no signals"):
        library(now)


def test_a_session_ended_by_hand_says_so():
    one, setup = library(learned(2))
    assert setup.learner.stop in (Stop.ENDED, Stop.SETTLED)
    assert one.training["trials"] == 2


def test_a_blocked_extruder_is_said():
    now = session()
    series = areas(now)
    nothing = dataclasses.replace(series, y=series.y * 0.0)
    with pytest.raises(InputError, match="shows 0 % of the volume that was pushed: see that"):
        take(now, None, [nothing])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"flow": 0.0}, "--flow is 0; it must be a positive number"),
        ({"flow": 99.0}, "--flow is 99 mm^3/s, and the plunger of syringe does 25"),
        ({"height": -1.0}, "--height is -1"),
        ({"height": 588.0}, "--height is 588 mm, and a bead of a 0.84 mm nozzle is no taller than 2.52 mm"),
        ({"material": " "}, "--material needs a name"),
        ({"lag": float("nan")}, "--lag is nan"),
    ],
)
def test_what_cannot_be_is_refused(words, said):
    with pytest.raises(UsageError) as caught:
        session(**words)
    assert said in str(caught.value)


def test_a_guess_is_trial_0():
    machine = load_machine("syringe")
    words = {"material": "m", "gcode": ("G28", ""), "date": "2026-01-02", "flow": 5.0}
    flat, guessed = begin(machine, **words), begin(machine, **words, first=lambda routine: 1.2 * routine.q_ref)
    assert np.median(guessed.trials[0].u[700:900]) == pytest.approx(1.2 * np.median(flat.trials[0].u[700:900]))
    assert printed(guessed).q.sum() == pytest.approx(1.2 * printed(flat).q.sum(), rel=0.02)
