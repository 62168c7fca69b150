from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gcodectl.calibrate.calibration import Parameters
from gcodectl.calibrate.profile import first_signal, path_course, plunger_course, scaled
from gcodectl.errors import UnsafeError, UsageError
from gcodectl.flow.limits import within_limits
from gcodectl.learn.reference import training_routine, with_levels
from plant_models.plant import load_plant
from plant_models.trial import as_trial

TABLE = Parameters(
    acceldelay=0.2, inputaccel=400.0, pushoutspeed=20.0, pushouttime=0.4, inputspeed=5.0, outputaccel=500.0,
    outputdecel=500.0, outputspeed=10.0, deceldelay=0.25, inputdecel=400.0, pullbackspeed=20.0, pullbacktime=0.4,
)  # fmt: skip
ROAD = (2.0, 8.0, 1.0)


def finely(parameters, road=ROAD, dt=1e-3, until=12.0):
    edges = np.arange(round(until / dt) + 1, dtype=np.float64) * dt
    return edges[:-1], plunger_course(parameters, road).means(edges), path_course(parameters, road).means(edges)


def test_a_profile_has_its_rates_at_its_times():
    t, u, v = finely(TABLE)

    def at(when):
        return u[np.searchsorted(t, when)]

    assert at(1.79) == 0.0  # the plunger sets off acceldelay before the path does
    assert at(1.825) == pytest.approx(10.0, abs=0.5)  # half way up: 400 mm^3/s^2
    assert at(2.1) == pytest.approx(20.0)
    assert at(2.3) == pytest.approx(5.0)
    assert at(7.7) == pytest.approx(5.0)  # the path brakes at 7.98, the plunger 0.25 s before
    assert at(7.85) == pytest.approx(-20.0)
    assert at(8.3) == 0.0
    assert v[np.searchsorted(t, 2.03)] == pytest.approx(10.0)
    assert v.sum() * 1e-3 == pytest.approx(10.0 * (6.0 - 0.02))


def test_the_volume_is_that_of_the_pieces():
    steps = dataclasses.replace(TABLE, inputaccel=None, inputdecel=None)
    _, u, _ = finely(steps)
    steady = (8.0 - 0.02 - 0.25) - (2.0 - 0.2 + 0.4)
    assert u.sum() * 1e-3 == pytest.approx(0.4 * 20.0 + steady * 5.0 - 0.4 * 20.0, rel=1e-6)
    coarse = plunger_course(steps, ROAD).means(np.arange(0.0, 12.01, 0.25))
    assert coarse.sum() * 0.25 == pytest.approx(u.sum() * 1e-3)


def test_no_pushout_and_no_pull_back_is_the_plain_flow():
    _, u, _ = finely(dataclasses.replace(TABLE, pushouttime=0.0, pullbacktime=0.0, acceldelay=0.0, deceldelay=0.0))
    assert u.max() == pytest.approx(5.0)
    assert u.min() == 0.0


def test_a_short_road_pulls_back_after_it_has_pushed_out():
    t, u, _ = finely(TABLE, (2.0, 2.1, 1.0), until=5.0)
    assert u.max() == pytest.approx(20.0)
    assert np.flatnonzero(u < 0)[0] > np.flatnonzero(u > 19.9)[-1]
    assert u[t > 3.0].max() == 0.0


def test_what_a_profile_lacks_is_said():
    with pytest.raises(UsageError, match="needs inputspeed, pullbacktime"):
        plunger_course(dataclasses.replace(TABLE, inputspeed=None, pullbacktime=None), ROAD)
    with pytest.raises(UsageError, match="too short"):
        path_course(TABLE, (0.0, 0.01, 1.0))


def test_another_flow_keeps_the_times():
    half = scaled(TABLE, 0.5)
    assert (half.inputspeed, half.pushoutspeed, half.inputaccel) == (2.5, 10.0, 200.0)
    assert (half.pushouttime, half.outputspeed, half.acceldelay) == (0.4, 10.0, 0.2)


def test_the_first_trial_is_better_than_the_flat_one_where_the_guess_fits():
    routine = with_levels(training_routine(5.0, lag=1.0, speed=10.0))
    fits = Parameters(
        acceldelay=0.15, pushoutspeed=20.0, pushouttime=0.28, inputspeed=5.0, outputspeed=10.0,
        deceldelay=0.12, pullbackspeed=20.0, pullbacktime=0.22,
    )  # fmt: skip
    u = first_signal(fits, 5.0, routine.roads, routine.q_ref, routine.dt, routine.flow)
    extruder = as_trial(load_plant("linear", flow=5.0, tau=1.0))

    def error(signal):
        q = extruder(within_limits(signal, 25.0, 2000.0, routine.dt), routine.dt)
        return float(np.sqrt(np.mean((q - routine.q_ref) ** 2)))

    assert error(u) < 0.5 * error(routine.q_ref)
    corner = round(routine.corner_middle / routine.dt)
    assert u[corner] == pytest.approx(0.0, abs=1e-9)  # the head stands still
    more = first_signal(fits, 4.0, routine.roads, routine.q_ref, routine.dt, routine.flow)
    assert np.allclose(more[: round(routine.corner[0] / routine.dt)], 1.25 * u[: round(routine.corner[0] / routine.dt)])


@pytest.mark.parametrize(
    ("push", "pull", "said"),
    [
        ((390.0, 0.26), (390.0, 0.25), "would push .* times what its roads hold"),
        ((20.0, 0.1), (20.0, 2.0), "would leave .* on roads that hold"),
        ((20.0, 1.8), (20.0, 0.1), "would leave .* on roads that hold"),
    ],
)
def test_a_first_trial_that_floods_or_starves_the_roads_is_refused(push, pull, said):
    routine = with_levels(training_routine(5.0, lag=1.0, speed=10.0))
    other = Parameters(
        acceldelay=push[1], pushoutspeed=push[0], pushouttime=push[1], inputspeed=5.0, outputspeed=10.0,
        deceldelay=pull[1], pullbackspeed=pull[0], pullbacktime=pull[1],
    )  # fmt: skip
    with pytest.raises(UnsafeError, match=said):
        first_signal(other, 5.0, routine.roads, routine.q_ref, routine.dt, routine.flow)


def test_what_a_slow_paste_needs_is_not_refused():
    routine = with_levels(training_routine(5.0, lag=3.0, speed=10.0))
    slow = Parameters(
        acceldelay=0.5, pushoutspeed=20.0, pushouttime=1.0, inputspeed=5.0, outputspeed=10.0,
        deceldelay=0.3, pullbackspeed=20.0, pullbacktime=0.6,
    )  # fmt: skip
    first_signal(slow, 5.0, routine.roads, routine.q_ref, routine.dt, routine.flow)  # stores 15 mm^3 of a road of 60
