"""Feasible: which lines the firmware would refuse, slow down or blur, by which of its own rules, and by how much.

A firmware takes a line apart into a path and a share of E, r = dE/ds, and looks at E on its own:

    E speed |        ____              step |dr| v at the junction: more than e_corner_speed, and the firmware
            |   ____|    |____         slows the whole machine there to v = e_corner_speed / |dr|
            |  /              \\
            | / slope r a      \\       slope: more than e_max_accel, and the line's acceleration is lowered
            |/__________________\\__ t

    REFUSED   BEAD     r area > max_bead, and over nozzle x max_bead in the line    Klipper extruder.py, check_move
              LENGTH   E farther than e_longest in one line      Klipper check_move; Marlin EXTRUDE_MAXLENGTH
    SLOWED    E_SPEED  r v > e_max_speed                         Klipper check_move; M203 E of the others
              E_STEP   |dr| v > e_corner_speed                   Klipper calc_junction; M205 E; M566
              E_ACCEL  r a > e_max_accel (Klipper: e_accel, of E alone)      M201 E; max_extrude_only_accel
              RATE     BUFFER lines in less than BUFFER / max_lines_per_second s      Marlin SLOWDOWN; the serial line
    BLURRED   MERGED   fewer than least_steps steps on every axis: joined to the next line    MIN_STEPS_PER_SEGMENT
              DIGITS   E's last digit is more than COARSE of what the line moves it

Speeds are those of the plan (`motion.profile`), as the file asks for them; what M203, M201 or M205 E in a file say is
not heard: the machine profile counts. A line is judged by itself and the one before it, so any chunking finds the same.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from gcodectl.columns import Columns, Floats, Ints, column
from gcodectl.config import Machine
from gcodectl.jit import jit_inline, jit_lean
from gcodectl.records import Flag, Kind, Moves, Profile, SpeedPlan

BUFFER = 16
"""Lines that a planner looks ahead (Marlin: BLOCK_BUFFER_SIZE); shorter bursts cost nothing."""
COARSE = 0.01
EXACT = 18
"""Digits where nothing is said: the line will not be rewritten, or says no E."""
HALF_A_DIGIT = 0.5 * 10.0 ** -np.arange(EXACT + 1.0)
SLACK = 1.0 + 1e-6
"""Rounding of the plan is no finding."""
PER_LINE = 1.05
"""The same for line rates, which go by times of two plans."""


class Effect(IntEnum):
    """What the firmware does about a line."""

    REFUSED = 0
    SLOWED = 1
    BLURRED = 2


class Rule(IntEnum):
    """The firmware's rules, as above."""

    BEAD = 0
    LENGTH = 1
    E_SPEED = 2
    E_STEP = 3
    E_ACCEL = 4
    RATE = 5
    MERGED = 6
    DIGITS = 7

    @property
    def effect(self) -> Effect:
        """What becomes of a line that breaks it."""
        return Effect.REFUSED if self <= Rule.LENGTH else Effect.SLOWED if self <= Rule.RATE else Effect.BLURRED

    @property
    def label(self) -> str:
        """For people."""
        return ("bead", "E in one line", "E speed", "E speed step", "E acceleration", "lines a second", "steps",
                "E digits")[self]  # fmt: skip

    @property
    def unit(self) -> str:
        """Of value and limit."""
        return ("mm^2", "mm", "mm/s", "mm/s", "mm/s^2", "1/s", "steps", "of the line's E")[self]


@dataclasses.dataclass(frozen=True)
class Findings(Columns):
    """One row a line and the rule it breaks, by row, then by rule."""

    row: Ints = column(np.int64)
    line: Ints = column(np.int64)
    rule: NDArray[np.int8] = column(np.int8)
    value: Floats = column(np.float64)
    """What the line asks for, in the rule's unit."""
    limit: Floats = column(np.float64)
    """What the firmware allows there."""


_BEAD, _LENGTH, _E_SPEED, _E_STEP = int(Rule.BEAD), int(Rule.LENGTH), int(Rule.E_SPEED), int(Rule.E_STEP)
_E_ACCEL, _RATE, _MERGED, _DIGITS = int(Rule.E_ACCEL), int(Rule.RATE), int(Rule.MERGED), int(Rule.DIGITS)
_ARC, _KNOWN = int(Kind.ARC), int(Flag.KNOWN)
L_STEP, L_SPEED, L_ACCEL, L_LONGEST, L_BEAD, L_ALONE, L_STEPS, L_E_ACCEL, L_AT_ONCE, L_RATE = range(10)
L_PER_MM = 10
"""Steps a mm of X, Y, Z and E stand there, in the vector of the machine's limits."""
C_RATIO, C_COUNT, C_BEGINS = 0, 1, 2
"""What is carried on: the ratio of the last line, how many there were, when the last BUFFER began."""
RULE, VALUE, LIMIT = 0, 1, 2


@jit_inline
def broken_kernel(rule: int, value: float, limit: float, slack: float, row: int, n: int, at: Ints, out: Floats) -> int:
    """Note a rule that is broken by `row`; returns how many there are."""
    if value > limit * slack:
        at[n], out[n, RULE], out[n, VALUE], out[n, LIMIT] = row, rule, value, limit
        return n + 1
    return n


@jit_lean
def rate_kernel(begins: float, carry: Floats) -> float:
    """Lines a second over the last BUFFER lines, the one that begins now included; 0 where fewer have come."""
    count = int(carry[C_COUNT])
    place = C_BEGINS + count % BUFFER
    before, carry[place], carry[C_COUNT] = carry[place], begins, count + 1
    return BUFFER / max(begins - before, 1e-9) if count >= BUFFER else 0.0


@jit_lean
def steps_kernel(p0: Floats, p1: Floats, length: float, arc: bool, e: float, limits: Floats) -> float:
    """Steps of the axis that makes the most of them; an arc's axes: its length; one that is nowhere yet: none."""
    most = abs(e) * limits[L_PER_MM + 3]
    for axis in range(3):
        reach = length if arc else abs(p1[axis] - p0[axis])
        steps = reach * limits[L_PER_MM + axis]
        if steps > most:
            most = steps
    return float(most)


@jit_lean
def inspect_kernel(
    kind: NDArray[np.int8], flags: NDArray[np.int16], decimals: NDArray[np.int8], row: Ints,
    p0: Floats, p1: Floats, e: Floats, length: Floats, area: Floats, distance: Floats, accel: Floats,
    phase_row: Ints, t: Floats, duration: Floats, v: Floats, a: Floats, j: Floats,
    limits: Floats, carry: Floats, at: Ints, out: Floats,
) -> int:  # fmt: skip
    """Judge every row that moves something by itself and the one before; returns how many findings there are."""
    n, phase = 0, 0
    alone_counts = limits[L_ALONE] != 0
    for i in range(len(kind)):
        first, top, ramps = phase, 0.0, False
        while phase < len(phase_row) and phase_row[phase] <= row[i]:
            ends = v[phase] + duration[phase] * (a[phase] + duration[phase] * j[phase] / 2.0)
            top = max(top, v[phase], ends)
            ramps = ramps or a[phase] != 0 or j[phase] != 0
            phase += 1
        if not (distance[i] > 0 and phase > first and np.isfinite(e[i])):
            continue
        arc, path, said = kind[i] == _ARC, length[i] > 0, abs(e[i])
        ratio = e[i] / length[i] if path else 0.0
        share = abs(ratio) if path else 1.0
        alone = e[i] < 0 or (e[i] != 0 and not arc and p1[i, 0] == p0[i, 0] and p1[i, 1] == p0[i, 1])
        watched = alone or not alone_counts
        if not alone and e[i] * area[i] > limits[L_AT_ONCE]:
            n = broken_kernel(_BEAD, ratio * area[i], limits[L_BEAD], SLACK, i, n, at, out)
        if watched:
            n = broken_kernel(_LENGTH, said, limits[L_LONGEST], SLACK, i, n, at, out)
        if watched and e[i] != 0:
            n = broken_kernel(_E_SPEED, share * top, limits[L_SPEED], SLACK, i, n, at, out)
        if path:
            step = abs(ratio - carry[C_RATIO]) * v[first]
            n = broken_kernel(_E_STEP, step, limits[L_STEP], SLACK, i, n, at, out)
        if watched and e[i] != 0 and ramps:
            hardest = limits[L_E_ACCEL] if alone and alone_counts else limits[L_ACCEL]
            n = broken_kernel(_E_ACCEL, share * accel[i], hardest, SLACK, i, n, at, out)
        n = broken_kernel(_RATE, rate_kernel(t[first], carry), limits[L_RATE], PER_LINE, i, n, at, out)
        steps = steps_kernel(p0[i], p1[i], length[i], arc, e[i], limits)
        if steps < limits[L_STEPS]:
            at[n], out[n, RULE], out[n, VALUE], out[n, LIMIT] = i, _MERGED, steps, limits[L_STEPS]
            n += 1
        if said > 0:
            places = max(int(decimals[i, 1]), 0) if flags[i] & _KNOWN else EXACT
            n = broken_kernel(_DIGITS, HALF_A_DIGIT[places] / said, COARSE, SLACK, i, n, at, out)
        carry[C_RATIO] = ratio
    return n


def inspect(
    chunks: Iterable[tuple[Moves, SpeedPlan, Profile]], machine: Machine
) -> Iterator[tuple[Moves, SpeedPlan, Profile, Findings]]:
    """Find what of a timed stream the machine's firmware would refuse, slow down or blur.

    Yields every chunk as it came, with its findings.
    """
    limits, carry = _limits(machine), np.zeros(C_BEGINS + BUFFER)
    for moves, speeds, phases in chunks:
        at = np.empty(len(Rule) * len(moves), dtype=np.int64)
        out = np.empty((len(at), 3))
        made = inspect_kernel(
            moves.kind, moves.flags, moves.decimals, moves.row,
            moves.p0, moves.p1, moves.e, moves.length, moves.area, speeds.distance, speeds.accel,
            phases.row, phases.t, phases.duration, phases.v, phases.a, phases.j,
            limits, carry, at, out,
        )  # fmt: skip
        rows, (rule, value, limit) = at[:made], out[:made].T
        found = Findings(row=moves.row[rows], line=moves.line[rows], rule=rule, value=value, limit=limit)
        yield moves, speeds, phases, found


def _limits(machine: Machine) -> Floats:
    """Return what the rules compare with, in the order of L_STEP and so on."""
    limits = machine.e_limits
    return np.array([
        limits.corner_speed, limits.max_speed, limits.max_accel, limits.longest, limits.max_bead, limits.alone,
        limits.least_steps, machine.e_accel, machine.most_at_once, machine.max_lines_per_second,
        *machine.steps_per_mm, machine.e_steps_per_mm,
    ])  # fmt: skip
