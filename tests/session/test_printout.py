"""What is printed is the signal, at the right time, on every machine that comes with gcodectl."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from sessions import session

from gcodectl.config import load_machine, machine_names
from gcodectl.errors import InputError
from gcodectl.flow.limits import within_limits
from gcodectl.session.checking import resample
from gcodectl.session.measured import Series
from gcodectl.session.printout import LIFT, _xy
from gcodectl.session.replay import limits_of
from plant_models.recorded import record

FLOWS = {"syringe": 5.0, "syringe-klipper": 5.0, "filament": 8.0, "filament-klipper": 8.0, "pellet": 1400.0}


class Obedient:
    """A plant that obeys at once."""

    def initial(self):
        return np.zeros(1)

    def run(self, state, u, _dt):
        return state, u.copy()


@pytest.mark.parametrize("name", machine_names())
def test_the_firmware_carries_out_the_signal(name):
    flow = FLOWS[name]
    now = session(name, flow=flow)
    routine, printout = now.setup.routine, now.setup.printout
    wanted = routine.q_ref.copy()
    wanted[380:410] += 2.0 * flow  # a push ahead of the first road, and a pull behind it
    wanted[round(routine.stop / routine.dt) : round(routine.stop / routine.dt) + 25] -= 2.0 * flow
    machine = printout.machine
    u = within_limits(wanted, machine.max_flow, machine.followed_slew, routine.dt)
    done = record(printout.gcode("t", u, routine.dt), machine, Obedient(), printout.layout.path)
    assert done.t[-1] == pytest.approx(routine.duration, rel=2e-3)
    assert np.diff(done.s[:-1]) / np.diff(done.t[:-1]) == pytest.approx(printout.layout.speed, rel=5e-3)
    middles = (done.t[1:] + done.t[:-1]) / 2.0
    got = resample(Series("t,q", middles, done.q), routine, 1.0, 1.0)
    assert got.sum() == pytest.approx(u.sum(), rel=2e-3)
    smooth = np.ones(5) / 5.0  # a line lasts 10 ms or more
    off = np.convolve(got - u, smooth, mode="same")
    assert np.sqrt(np.mean(off**2)) < 0.04 * flow


@pytest.mark.parametrize("name", machine_names())
def test_the_most_that_is_planned_is_what_the_firmware_lays(name):
    now = session(name, flow=FLOWS[name])
    routine, printout = now.setup.routine, now.setup.printout
    limits = limits_of(printout)
    wanted = routine.q_ref.copy()
    wanted[380:480] = limits.max_flow
    u = within_limits(wanted, limits.max_flow, limits.max_flow_slew, routine.dt)
    done = record(printout.gcode("t", u, routine.dt), printout.machine, Obedient(), printout.layout.path)
    got = resample(Series("t,q", (done.t[1:] + done.t[:-1]) / 2.0, done.q), routine, 1.0, 1.0)
    late = np.abs(np.cumsum(got - u)) * routine.dt
    assert late.max() < 0.02 * u[380:480].sum() * routine.dt


def test_begin_and_end_stand_where_they_belong():
    now = session(gcode=("M190 S60\nG28\nG29", "M84"))
    lines = now.setup.printout.gcode("one\ntwo", now.trials[0].u, 0.01).decode().splitlines()
    assert lines[:5] == ["; one", "; two", "M190 S60", "G28", "G29"]
    assert lines[-1] == "M84"
    assert any(line.startswith("G4 P15000") for line in lines)


def test_the_nozzle_is_lifted_wherever_it_travels_over_the_bed():
    printout = session().setup.printout
    lines = printout.base("t")[0].decode().splitlines()
    z, travels = 0.0, []
    for line in lines:
        if found := re.search(r"Z(\S+)", line):
            z = float(found[1])
        elif line.startswith("G1 X") and "F6000" in line:
            travels.append(z)
    assert len(travels) == 2
    assert min(travels) >= printout.height + LIFT - 1e-3
    first = next(k for k, line in enumerate(lines) if line == f"G1 {_xy(printout.layout.path[0])} F607.386")
    assert lines[first - 1].startswith(f"G1 Z{printout.height:.3f} ")


def test_a_begin_that_changes_the_speed_is_refused():
    now = session(gcode=("G28\nM220 S50", ""))
    with pytest.raises(InputError, match=r"takes 2\.00 times as long"):
        now.setup.printout.gcode("t", now.trials[0].u, 0.01)


def test_a_begin_that_changes_the_flow_is_refused():
    now = session(gcode=("G28\nM221 S50", ""))
    with pytest.raises(InputError, match=r"sets the flow to 50 % \(M221\)"):
        now.setup.printout.gcode("t", now.trials[0].u, 0.01)
    back = session(gcode=("G28\nM221 S50\nM221 S100", ""))
    assert back.setup.printout.gcode("t", back.trials[0].u, 0.01)


def test_a_slow_extruder_rests_longer_behind_the_datum():
    rests = [session(lag=lag).setup.printout.base("t")[0] for lag in (1.0, 6.0)]
    assert b"G4 P15000" in rests[0]
    assert b"G4 P30000" in rests[1]


def test_a_trial_that_is_not_the_sessions_is_not_taken_for_it():
    now, other = session(), session(dataclasses.replace(load_machine("syringe"), bed=(50.0, 50.0, 250.0, 250.0)))
    data = other.setup.printout.gcode("t", other.trials[0].u, 0.01)
    with pytest.raises(InputError, match="not the file that the session wrote"):
        record(data, now.setup.printout.machine, Obedient(), now.setup.printout.layout.path)
