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

from gcodectl.columns import Bools, Columns, Floats, Ints, column
from gcodectl.config import Machine
from gcodectl.records import Flag, Kind, Moves, Profile, SpeedPlan

BUFFER = 16
"""Lines that a planner looks ahead (Marlin: BLOCK_BUFFER_SIZE); shorter bursts cost nothing."""
COARSE = 0.01
EXACT = 18
"""Digits where nothing is said: the line will not be rewritten, or says no E."""
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


@dataclasses.dataclass(frozen=True)
class _Motion:
    """What the rules look at, one row a move that moves something: mm, s."""

    row: Ints
    line: Ints
    e: Floats
    length: Floats
    area: Floats
    reach: Floats
    """How far each of X, Y, Z goes (an arc's axes: its length), shape (n, 3)."""
    alone: Bools
    """Klipper's extrude-only moves: neither X nor Y moves, or E goes back."""
    places: Ints
    """Digits after the point of E words."""
    begins: Floats
    """When, s."""
    entry: Floats
    """Speed at its start, mm/s of path; 0 where the machine rested before."""
    top: Floats
    accel: Floats
    """mm/s^2; 0 where the plan keeps its speed."""
    ratio: Floats
    """mm of E a mm of path; 0 where there is no path."""


def inspect(
    chunks: Iterable[tuple[Moves, SpeedPlan, Profile]], machine: Machine
) -> Iterator[tuple[Moves, SpeedPlan, Profile, Findings]]:
    """Find what of a timed stream the machine's firmware would refuse, slow down or blur.

    Yields every chunk as it came, with its findings.
    """
    ratio, begins = 0.0, np.empty(0)
    for moves, speeds, phases in chunks:
        motion = _motion(moves, speeds, phases)
        times = np.concatenate([begins, motion.begins])
        before = np.concatenate([[ratio], motion.ratio])
        yield moves, speeds, phases, _findings(motion, machine, before[:-1], times)
        begins, ratio = times[-BUFFER:], float(before[-1])


def _motion(moves: Moves, speeds: SpeedPlan, phases: Profile) -> _Motion:
    """Put the numbers of the rows that move something side by side."""
    first = np.searchsorted(phases.row, moves.row)
    last = np.searchsorted(phases.row, moves.row, side="right")
    keep = (speeds.distance > 0) & (last > first) & np.isfinite(moves.e)
    rows, first = moves[keep], first[keep]
    top = np.zeros(len(moves))
    ends = phases.v + phases.duration * (phases.a + phases.duration * phases.j / 2.0)
    of = np.searchsorted(moves.row, phases.row)
    np.maximum.at(top, of, np.maximum(phases.v, ends))
    ramps = np.zeros(len(moves), dtype=np.bool_)
    ramps[of[(phases.a != 0) | (phases.j != 0)]] = True
    flat = (rows.p1[:, :2] == rows.p0[:, :2]).all(axis=1) & (rows.kind != Kind.ARC)
    return _Motion(
        row=rows.row, line=rows.line, e=rows.e, length=rows.length, area=rows.area,
        reach=np.where(rows.kind == Kind.ARC, rows.length, np.abs(rows.p1 - rows.p0).T).T,
        alone=(flat | (rows.e < 0)) & (rows.e != 0),
        places=np.where((rows.flags & int(Flag.KNOWN)) != 0, rows.decimals[:, 1], EXACT),
        begins=phases.t[first], entry=phases.v[first], top=top[keep], accel=np.where(ramps, speeds.accel, 0.0)[keep],
        ratio=np.divide(rows.e, rows.length, out=np.zeros(len(rows)), where=rows.length > 0),
    )  # fmt: skip


def _findings(motion: _Motion, machine: Machine, before: Floats, times: Floats) -> Findings:
    """Judge moving rows; `before` is the ratio of the one before each, `times` when they and those before began."""
    measured = {
        **_size_rules(motion, machine),
        **_speed_rules(motion, machine, before),
        Rule.RATE: (_rate(times)[len(times) - len(motion.row) :], machine.max_lines_per_second),
        **_grain_rules(motion, machine),
    }
    parts = []
    for rule, (value, limit) in measured.items():
        slack = PER_LINE if rule == Rule.RATE else SLACK
        broken = np.flatnonzero(value < limit if rule == Rule.MERGED else value > limit * slack)
        limits = np.broadcast_to(np.asarray(limit, dtype=np.float64), value.shape)
        parts.append(
            Findings(
                row=motion.row[broken], line=motion.line[broken], rule=np.full(len(broken), rule, dtype=np.int8),
                value=value[broken], limit=limits[broken],
            )
        )  # fmt: skip
    found = Findings.concat(parts)
    return found[np.lexsort((found.rule, found.row))]


def _size_rules(motion: _Motion, machine: Machine) -> dict[Rule, tuple[Floats, Floats | float]]:
    limits = machine.e_limits
    large = ~motion.alone & (motion.e * motion.area > machine.most_at_once)
    watched = motion.alone | (not limits.alone)
    return {
        Rule.BEAD: (np.where(large, motion.ratio * motion.area, 0.0), limits.max_bead),
        Rule.LENGTH: (np.where(watched, np.abs(motion.e), 0.0), limits.longest),
    }


def _speed_rules(motion: _Motion, machine: Machine, before: Floats) -> dict[Rule, tuple[Floats, Floats | float]]:
    limits = machine.e_limits
    share = np.where(motion.length > 0, np.abs(motion.ratio), 1.0)
    watched = (motion.alone | (not limits.alone)) & (motion.e != 0)
    accel = np.where(watched, share * motion.accel, 0.0)
    hardest = np.where(motion.alone & limits.alone, machine.e_accel, limits.max_accel)
    step = np.where(motion.length > 0, np.abs(motion.ratio - before) * motion.entry, 0.0)
    return {
        Rule.E_SPEED: (np.where(watched, share * motion.top, 0.0), limits.max_speed),
        Rule.E_STEP: (step, limits.corner_speed),
        Rule.E_ACCEL: (accel, hardest),
    }


def _rate(times: Floats) -> Floats:
    """Lines a second over the last BUFFER lines, for each; 0 where fewer have come."""
    rate = np.zeros(len(times))
    rate[BUFFER:] = BUFFER / np.maximum(times[BUFFER:] - times[:-BUFFER], 1e-9)
    return rate


def _grain_rules(motion: _Motion, machine: Machine) -> dict[Rule, tuple[Floats, Floats | float]]:
    steps = (motion.reach * machine.steps_per_mm).max(axis=1, initial=0.0)
    steps = np.maximum(steps, np.abs(motion.e) * machine.e_steps_per_mm)
    digit = 0.5 * 10.0 ** -np.maximum(motion.places, 0).astype(np.float64)
    blurred = np.divide(digit, np.abs(motion.e), out=np.zeros(len(digit)), where=motion.e != 0)
    return {Rule.MERGED: (steps, float(machine.e_limits.least_steps)), Rule.DIGITS: (blurred, COARSE)}
