"""The virtual printer: G-code moves in, a timed execution out, and from it what the plunger is told to do.

    Moves --cut--> Segments --plan--> Phases --command--> u[channel, n]

u holds from n dt until (n + 1) dt and is the mean over that time, so that no volume is lost or made by sampling.

Pressure advance as Klipper does it (kinematics/extruder.py, chelper/kin_extruder.c): while a move has XY motion and
E > 0, E is ahead by K times the E speed; the whole E position is then weighted by a triangle `smooth_time` wide.

        E(t)  +  K dE/dt   -->   * /\\      K = 0: no smoothing either
                                  /__\\  smooth_time

Before its first sample and after its last the machine stands still.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from functools import cached_property

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.config import Machine
from gcodectl.errors import InputError, UsageError
from gcodectl.jit import jit
from gcodectl.records import Moves, Signal
from plant_models.gantry import E_ONLY, PATH, Firmware, Segments, cut
from plant_models.planner import Phases, plan

SMOOTH_TIME = 0.04
"""s, Klipper's default."""


@jit
def volume_kernel(
    segment: Ints,
    t: Floats,
    duration: Floats,
    v: Floats,
    a: Floats,
    ratio: Floats,
    channel: Ints,
    dt: float,
    rate: Floats,
) -> None:
    """Add the volume rate (mm^3/s) of all phases to `rate[channel, n]`, each sample the mean over its dt."""
    last = rate.shape[1] - 1
    for i in range(len(t)):
        j = segment[i]
        if ratio[j] == 0.0:
            continue
        begin, end = t[i], t[i] + duration[i]
        n = min(int(begin / dt), last)
        low = begin
        while low < end:
            high = end if n == last else min(end, (n + 1) * dt)
            if high > low:
                x0, x1 = low - begin, high - begin
                rate[channel[j], n] += ratio[j] * (v[i] * (x1 - x0) + 0.5 * a[i] * (x1 * x1 - x0 * x0)) / dt
                low = high
            n += 1


@jit
def edge_kernel(
    segment: Ints,
    t: Floats,
    duration: Floats,
    v: Floats,
    a: Floats,
    ratio: Floats,
    channel: Ints,
    dt: float,
    edge: Floats,
) -> None:
    """Set `edge[channel, n]` to the volume rate at the very time n dt, for segments whose ratio is not 0."""
    for i in range(len(t)):
        j = segment[i]
        if ratio[j] == 0.0:
            continue
        for n in range(math.ceil(t[i] / dt), min(math.ceil((t[i] + duration[i]) / dt), edge.shape[1])):
            edge[channel[j], n] = ratio[j] * (v[i] + a[i] * (n * dt - t[i]))


@dataclasses.dataclass(frozen=True)
class Execution:
    """What the machine does and when; ask it for the plunger's command, the position, the move at any time."""

    segments: Segments
    phases: Phases
    pressure_advance: float = 0.0
    """s"""
    smooth_time: float = SMOOTH_TIME
    gain: float = 1.0
    """Flow multiplier, as M221."""
    advanced: Floats | None = None
    """Share of the pressure advance that each segment gets; None: all of it."""

    @cached_property
    def duration(self) -> float:
        """Seconds the whole file takes."""
        return float(self.phases.t[-1] + self.phases.duration[-1]) if len(self.phases) else 0.0

    @cached_property
    def tools(self) -> tuple[int, ...]:
        """Tools that are used, in ascending order; the channels of `command`."""
        return tuple(int(tool) for tool in np.unique(self.segments.tool)) or (0,)

    @property
    def channel(self) -> Ints:
        """Index into `tools` of each segment."""
        return np.searchsorted(self.tools, self.segments.tool).astype(np.int64)

    @property
    def ratio(self) -> Floats:
        """mm^3 of E a mm of each segment's `length`."""
        return np.divide(
            self.segments.volume, self.segments.length, out=np.zeros(len(self.segments)), where=self.segments.length > 0
        )

    def samples(self, dt: float, tail: float = 0.0) -> int:
        """Return how many samples of `dt` cover the file and `tail` seconds after it."""
        return max(1, math.ceil((self.duration + tail) / dt - 1e-9))

    def command(self, dt: float, tail: float = 0.0) -> Signal:
        """Return u, mm^3/s, a channel a tool, before the plunger's limits."""
        if not dt > 0:
            raise UsageError(f"the sampling time is {dt}; it must be positive")
        n = self.samples(dt, tail)
        phases, ratio, channel = self.phases, self.ratio, self.channel
        timed = (phases.segment, phases.t, phases.duration, phases.v, phases.a)
        rate = np.zeros((len(self.tools), n))
        volume_kernel(*timed, ratio, channel, dt, rate)
        if self.pressure_advance > 0:
            run = self.segments
            advanced = (run.kind == PATH) & (run.volume > 0) & (run.p1 != run.p0)[:, :2].any(axis=1)
            edge = np.zeros((len(self.tools), n + 1))
            share = 1.0 if self.advanced is None else self.advanced
            edge_kernel(*timed, np.where(advanced, share * ratio, 0.0), channel, dt, edge)
            rate = smooth(rate + self.pressure_advance * np.diff(edge, axis=1) / dt, dt, self.smooth_time)
        return Signal(0.0, dt, self.gain * rate, self.tools)

    def at(self, times: Floats) -> tuple[Ints, Floats]:
        """Return the phase of each time (beyond the ends: the first, the last), and how far along its segment, mm."""
        if not len(self.phases):
            raise InputError("nothing moves in this file")
        index = np.clip(np.searchsorted(self.phases.t, times, side="right") - 1, 0, len(self.phases) - 1)
        since = np.clip(times - self.phases.t[index], 0.0, self.phases.duration[index])
        return index, self.phases.s[index] + since * (self.phases.v[index] + 0.5 * self.phases.a[index] * since)

    def position(self, times: Floats) -> Floats:
        """Return X, Y, Z at each time, mm, shape (n, 3)."""
        index, s = self.at(times)
        segment = self.phases.segment[index]
        run = self.segments[segment]
        part = np.where(run.kind == PATH, s / np.where(run.length > 0, run.length, 1.0), 0.0)
        return run.p0 + part[:, None] * (run.p1 - run.p0)

    def speed(self, times: Floats) -> Floats:
        """Return the speed along the path at each time, mm/s; 0 where only E moves."""
        index, _ = self.at(times)
        since = np.clip(times - self.phases.t[index], 0.0, self.phases.duration[index])
        moving = self.segments.kind[self.phases.segment[index]] == PATH
        return np.where(moving, self.phases.v[index] + self.phases.a[index] * since, 0.0)

    def rows(self, times: Floats) -> Ints:
        """Return the row of the move that runs at each time."""
        index, _ = self.at(times)
        return self.segments.row[self.phases.segment[index]]

    def begins(self) -> Floats:
        """Return when each segment begins, s."""
        first = np.searchsorted(self.phases.segment, np.arange(len(self.segments)))
        return np.append(self.phases.t, self.duration)[first]


def smooth(rate: Floats, dt: float, smooth_time: float) -> Floats:
    """Weight `rate` by a triangle `smooth_time` wide about each sample, as Klipper smooths the E position."""
    half = smooth_time / 2
    reach = math.ceil(half / dt) - 1 if half > 0 else 0
    if reach < 1:
        return rate
    weights = half - np.abs(np.arange(-reach, reach + 1) * dt)
    weights /= weights.sum()
    padded = np.pad(rate, ((0, 0), (reach, reach)))
    return np.stack([np.convolve(channel, weights, mode="valid") for channel in padded])


def execute(
    moves: Iterable[Moves],
    machine: Machine,
    *,
    pressure_advance: float = 0.0,
    smooth_time: float = SMOOTH_TIME,
    firmware: Firmware | None = None,
) -> Execution:
    """Run a file's moves on the virtual machine; raises UsageError for a negative pressure advance."""
    if pressure_advance < 0 or smooth_time < 0:
        raise UsageError("pressure advance and its smoothing time cannot be negative")
    settings = firmware or Firmware()
    return run(cut(Moves.concat(list(moves)), machine, settings), settings, pressure_advance, smooth_time)


def run(
    segments: Segments, firmware: Firmware, pressure_advance: float = 0.0, smooth_time: float = SMOOTH_TIME
) -> Execution:
    """Plan segments that are cut already, and time them."""
    return Execution(segments, plan(segments, firmware), pressure_advance, smooth_time)


def standing(execution: Execution) -> float:
    """Return the seconds in which the file moves nothing but E, or nothing at all."""
    still = execution.segments.kind[execution.phases.segment] != PATH
    return float(execution.phases.duration[still].sum())


__all__ = ["E_ONLY", "Execution", "Firmware", "execute", "run", "smooth", "standing"]
