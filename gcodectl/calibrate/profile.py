"""Control profile: the twelve parameters as plunger rate and path speed over time, and as the first trial's signal.

     pushoutspeed  .----.
                  /      \\
     inputspeed  /        '--------------.
               _/                         \\        ____
                                           \\______/        -pullbackspeed
               |<-pushout->|               |<-back->|
               |time       |               |time    |
     path speed ________________.----------------.______
               |<-- acceldelay ->|               |<- begins to brake deceldelay after the plunger did

The plunger's rate is piecewise linear with the accelerations as slopes; a slope that is not known is a step (the
plunger's own limits round it, `flow.limits`). A pushout includes its rise, a pull-back its fall. Where a road is so
short that it would end before the pushout does, the pull-back waits for it.

First trial. A training routine has roads at several shares of one nominal flow, and a corner. A road at half the flow
gets half the pushout and half the pull-back: as much less is stored behind the nozzle (exactly so for a first-order
lag).
In a corner the rate follows the flow that is asked for; the twelve parameters say nothing of corners.

Before it is run: a barrel that stores as much as the routine's roads hold is one that the routine was not
made for, and a plunger that draws back most of what it pushed lays nothing. Such a first trial is refused
(`check_volume`). Fab@Home's syringes are of that kind: they are pressed 97 mm^3 ahead, some 160 mm of road.

Source: Malone and Purwin, tables I and Fig. 3 (see `calibration`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from gcodectl.calibrate.calibration import Parameters
from gcodectl.columns import Floats
from gcodectl.errors import UnsafeError, UsageError

Road: TypeAlias = tuple[float, float, float]
"""When the path sets off and when it rests again, s, and the road's flow as a share of the nominal one."""
PUSHED, MOST, LEAST = 3.0, 2.0, 0.5
"""Times what a routine's roads hold: the most that a first trial may push (the slowest built-in clay, whose store is
filled anew for every road, takes 2.2), and the most and the least that it may leave there once it has drawn back."""
NEEDED = ("inputspeed", "outputspeed", "pushoutspeed", "pushouttime", "pullbackspeed", "pullbacktime")


@dataclasses.dataclass(frozen=True)
class Course:
    """A piecewise-linear course: values at times that never fall; 0 outside, a step where a time comes twice."""

    t: Floats
    value: Floats

    def means(self, edges: Floats) -> Floats:
        """Return the mean between each two of `edges` (s, rising)."""
        gone = np.concatenate([[0.0], np.cumsum(np.diff(self.t) * (self.value[1:] + self.value[:-1]) / 2)])
        k = np.clip(np.searchsorted(self.t, edges, side="right") - 1, 0, len(self.t) - 2)
        long = self.t[k + 1] - self.t[k]
        since = np.clip(edges - self.t[k], 0.0, long)
        slope = np.divide(self.value[k + 1] - self.value[k], long, out=np.zeros(len(k)), where=long > 0)
        total = gone[k] + since * (self.value[k] + slope * since / 2)
        return np.asarray(np.diff(total) / np.diff(edges), dtype=np.float64)


def plunger_course(parameters: Parameters, road: Road) -> Course:
    """Return the plunger's rate for one road, mm^3/s; UsageError says which parameters it lacks."""
    told = _told(parameters)
    begin, end, share = road
    steady, push, back = told["inputspeed"] * share, told["pushoutspeed"], told["pullbackspeed"]
    rise, fall = parameters.inputaccel, parameters.inputdecel
    push = max(push, steady)
    pushed = told["pushouttime"] * share
    pulled = told["pullbacktime"] * share
    first = begin - _delay(parameters.acceldelay, pushed, share)
    up = min(_ramp(push, rise), pushed)
    after = first + pushed
    settled = after + _ramp(push - steady, rise)
    brake = end - _ramp(told["outputspeed"] * share, parameters.outputdecel)
    turn = max(brake - _delay(parameters.deceldelay, pulled, share), settled)
    down = turn + _ramp(steady + back, fall)
    rest = max(turn + pulled, down)
    times = [first, first + up, after, settled, turn, down, rest, rest + _ramp(back, fall)]
    values = [0.0, push, push, steady, steady, -back, -back, 0.0]
    if pulled == 0.0:
        times, values = [*times[:5], turn + _ramp(steady, fall)], [*values[:5], 0.0]
    if pushed == 0.0:
        times[1:4], values[1:4] = [first + _ramp(steady, rise)], [steady]
    return _ended(times, values)


def path_course(parameters: Parameters, road: Road) -> Course:
    """Return the path's speed for one road, mm/s."""
    begin, end, share = road
    speed = _told(parameters)["outputspeed"] * share
    up, down = _ramp(speed, parameters.outputaccel), _ramp(speed, parameters.outputdecel)
    if up + down > end - begin:
        raise UsageError(f"a road of {end - begin:.3g} s is too short for {speed:g} mm/s at these accelerations")
    return _ended([begin, begin + up, end - down, end], [0.0, speed, speed, 0.0])


def first_signal(
    parameters: Parameters, asked: float, roads: Sequence[Road], q_ref: Floats, dt: float, flow: float
) -> Floats:
    """Return u (mm^3/s) for the first trial of a routine: its roads, its flow q_ref[n], dt and its nominal flow.

    `asked` is what the calibrated road asked for, mm^3/s: width x height x speed (`features.asked_flow`). The
    parameters are brought to the routine's flow first; the plunger's limits are the learner's to keep. Raises
    UnsafeError where that pushes far more, or leaves far less, than the roads hold.
    """
    own = scaled(parameters, flow / asked)
    steady = _told(own)["inputspeed"]
    edges = np.arange(len(q_ref) + 1, dtype=np.float64) * dt
    u = np.zeros(len(q_ref))
    for road in roads:
        begin, end, share = road
        u += plunger_course(own, road).means(edges)
        inside = slice(max(round(begin / dt), 0), min(round(end / dt), len(q_ref)))
        full = np.flatnonzero(q_ref[inside] > 0.999 * share * flow) + inside.start
        if len(full):
            there = slice(full[0], full[-1] + 1)
            u[there] -= steady * (share - q_ref[there] / flow)
    check_volume(u, q_ref, dt)
    return u


def check_volume(u: Floats, q_ref: Floats, dt: float) -> None:
    """Check a plunger's rates u[n] against the flow that a routine asks for, q_ref[n], mm^3/s.

    Raises UnsafeError where they push more than PUSHED times the volume of its roads, or leave more than MOST or less
    than LEAST times it.
    """
    holds, pushed, left = (float(one.sum()) * dt for one in (q_ref, np.maximum(u, 0.0), u))
    why = "the guess is of another kind of extruder; learn without it"
    if pushed > PUSHED * holds:
        times = f"{pushed / holds:.2g} times what its roads hold"
        raise UnsafeError(f"the first trial would push {pushed:.4g} mm^3, {times} ({holds:.4g} mm^3): {why}")
    if not LEAST * holds <= left <= MOST * holds:
        raise UnsafeError(f"the first trial would leave {left:.4g} mm^3 on roads that hold {holds:.4g} mm^3: {why}")


def scaled(parameters: Parameters, factor: float) -> Parameters:
    """Return parameters for another flow: what the plunger does times `factor`, the path and the times as they are."""
    rates = ("inputaccel", "pushoutspeed", "inputdecel", "pullbackspeed", "inputspeed")
    return dataclasses.replace(
        parameters, **{name: value * factor for name in rates if (value := getattr(parameters, name)) is not None}
    )


def _told(parameters: Parameters) -> dict[str, float]:
    missing = [name for name in NEEDED if getattr(parameters, name) is None]
    if missing:
        raise UsageError(f"a control profile needs {', '.join(missing)}: add calibrations that tell them")
    return {name: getattr(parameters, name) for name in NEEDED}


def _delay(delay: float | None, time: float, share: float) -> float:
    """Return a delay for a road at `share` of the flow; not known: as long as the pushout or pull-back takes."""
    return time if delay is None else delay * share


def _ramp(change: float, slope: float | None) -> float:
    return change / slope if slope is not None else 0.0


def _ended(times: list[float], values: list[float]) -> Course:
    t = np.maximum.accumulate(np.array([times[0], *times, times[-1]]))
    return Course(t, np.array([0.0, *values, 0.0]))
