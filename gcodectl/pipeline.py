"""The pipeline: chains the stages; alone knows their order.

    bytes -> Lines -> Moves -> Moves -> SpeedPlan -> Profile -> Tasks -> Command -> bytes
             parse    interpret  (heat)  plan       profile   segment  compose   emit

Every stage pulls from the one before it, chunk by chunk, and holds back only what later input may still change.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gcodectl.config import Machine
from gcodectl.filtered import Fresh
from gcodectl.flow.bank import SignalBank, signal_bank
from gcodectl.flow.holds import hold_starts
from gcodectl.flow.inversion import Inversion
from gcodectl.flow.library import BasisSet
from gcodectl.flow.retracts import replace_retracts
from gcodectl.flow.steer import steer
from gcodectl.gcode.emit import MARK, emit
from gcodectl.gcode.modal import interpret
from gcodectl.gcode.parse import parse
from gcodectl.motion.follow import Follow, share_of
from gcodectl.motion.lookahead import plan
from gcodectl.motion.profile import profile
from gcodectl.prefetch import prefetch
from gcodectl.records import Command, Composed, Flag, Kind, Moves, Profile, SpeedPlan, Tasks
from gcodectl.summary import Summary, summed
from gcodectl.version import VERSION

if TYPE_CHECKING:  # what only some files need is imported where they do
    from gcodectl.thermal.course import Course
    from gcodectl.thermal.profile import HeatProfile
    from gcodectl.thermal.tally import Tally

SEQUENCERS = ("model", "superpose", "basis")
"""`model`: the fitted flow model inverted; `superpose`: basis signals added up; `basis`: the paper's, one at a time."""
QUICK = 0.1
"""s; an extruder quicker than this is steered in finer samples."""
LEVELS = np.array([0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.3, 1.6, 2.0, 3.0])
"""Flows, as shares of a model's nominal one, at which it is asked how long filling and emptying take."""
SHORT = 20_000
"""Rows of a file that is done sooner than threads can help."""


@dataclasses.dataclass(frozen=True)
class Options:
    """What a filter needs to know; the same for every file."""

    machine: Machine
    sets: tuple[BasisSet | None, ...] = (None,)
    """Basis set of each tool; None: an extruder that obeys at once. Tools beyond the last use the last."""
    sequencer: str = "model"
    """How learned flow is laid over tasks, see SEQUENCERS; `model` is `superpose` where a material has no model."""
    quality: float = 0.5
    """0: no time is given to the bead; 0.5: starts and stops take the time that the extruder takes; 1: twice that."""
    keep_retracts: bool = False
    pass_unknown: bool = False
    relative_e: bool | None = None
    """The E mode before the first M82 or M83, where somebody has said it."""
    source: str = ""
    """Name of the input, for messages."""
    heat: HeatProfile | None = None
    """How the part cools, where its speeds are to be planned by that."""

    @cached_property
    def bank(self) -> SignalBank:
        """The signals of all tools: superposed they are softened to what the firmware follows, the paper's stay."""
        slew = math.inf if self.sequencer == "basis" else self.machine.followed_slew
        return signal_bank(self.sets, slew=slew)

    @cached_property
    def inversions(self) -> tuple[Inversion | None, ...]:
        """The flow model of each tool behind the machine's plunger; none at all where they are not to be used."""
        learned = [one for one in self.sets if one is not None]
        if self.sequencer != "model" or not learned or any(one.model is None for one in learned):
            return ()
        most, slew, carried = self.machine.max_flow, self.machine.followed_slew, self.machine.carried_flow
        dt = min((one.dt for one in learned), default=0.01)
        if any(one.model and one.model.quickness < QUICK for one in learned):
            dt /= 2.0  # a bin of its bead passes in less than two samples
        return tuple(Inversion(one.model, most, slew, dt, carried) if one and one.model else None for one in self.sets)


def follow_of(options: Options) -> Follow | None:
    """What the materials' extruders can follow, at the quality asked for; None where no flow model is used."""
    inversions = options.inversions
    if not inversions or options.quality == 0.0:
        return None
    levels, times = [], []
    for one in inversions:
        flow = LEVELS * (one.model.flow if one else 1.0)
        levels.append(flow)
        times.append([one.transit(float(q)) if one else (0.0, 0.0) for q in flow])
    seconds = np.array(times)
    share = share_of(options.quality)
    return Follow(np.array(levels), seconds[:, :, 0], seconds[:, :, 1], share, share)


def read_moves(chunks: Iterable[bytes], options: Options) -> Iterator[Moves]:
    """Bytes to moves."""
    moves = interpret(
        parse(chunks),
        options.machine,
        pass_unknown=options.pass_unknown,
        relative_e=options.relative_e,
        source=options.source,
    )
    return prefetch(moves, len, SHORT)


def time_moves(
    moves: Iterable[Moves], machine: Machine, settle: float = 0.0, lead: float = 0.0, follow: Follow | None = None
) -> Iterator[tuple[Moves, SpeedPlan, Profile]]:
    """Moves to planned, timed moves."""
    return profile(plan(moves, machine, follow), machine, settle, lead)


def find_tasks(
    moves: Iterable[Moves], options: Options, settle: float = 0.0, lead: float = 0.0
) -> Iterator[tuple[Moves, SpeedPlan, Profile, Tasks, float]]:
    """Moves to basis tasks; the slicer's retracts count as what the options say becomes of them."""
    from gcodectl.flow.tasks import segment

    tasks = segment(_retimed(moves, options, settle, lead))
    return prefetch(tasks, lambda one: len(one[0]), SHORT)


def _retimed(
    moves: Iterable[Moves], options: Options, settle: float = 0.0, lead: float = 0.0
) -> Iterator[tuple[Moves, SpeedPlan, Profile]]:
    """Moves to timed moves, the slicer's retracts taken out where the options say so."""
    moves = moves if options.keep_retracts else replace_retracts(moves)
    return time_moves(moves, options.machine, settle, lead, follow_of(options))


def heed_heat(moves: Iterable[Moves], options: Options, tally: Tally | None = None) -> Iterator[Moves]:
    """Moves to moves that are slowed, and waited for, by the heat of what lies beneath; as they come without a profile.

    Timed as `find_tasks` will time them, each piece of the file from rest to rest.
    """
    if options.heat is None:
        return iter(moves)
    from gcodectl.thermal.course import Course
    from gcodectl.thermal.stage import heat

    settle, lead = _waits(options)
    follow, machine = follow_of(options), options.machine

    def course(rows: Moves) -> Course:
        some = [rows] if options.keep_retracts else replace_retracts([rows])
        return Course.of(time_moves(some, machine, settle, lead, follow))

    return heat(moves, options.heat, machine.nozzle, course, tally)


def _waits(options: Options) -> tuple[float, float]:
    """How long a learned Stop runs out before a barrier, and a Start begins behind one, s."""
    if inversions := options.inversions:
        return max(one.tail for one in inversions if one), max(one.lead for one in inversions if one)
    return options.bank.tail, options.bank.longest_lead


def compose_moves(moves: Iterable[Moves], options: Options, heat: Tally | None = None) -> Iterator[Composed]:
    """Moves to moves with their signal; `heat` takes note of what lies beneath."""
    moves, bank = _closed(heed_heat(moves, options, heat)), options.bank
    moves = moves if bank.neutral else hold_starts(moves)
    if bank.neutral or options.inversions:  # nothing is laid over tasks, so nobody looks for them
        timed = prefetch(_retimed(moves, options, *_waits(options)), lambda one: len(one[0]), SHORT)
        if bank.neutral:
            nothing = Command.none(bank.dt)
            return (Composed(*one, Tasks.empty(), nothing) for one in timed)
        dt = next(one.dt for one in options.inversions if one)
        return prefetch(steer(timed, options.inversions, dt), lambda one: len(one.moves), SHORT)
    from gcodectl.flow.compose import compose

    tasks = find_tasks(moves, options, *_waits(options))
    return compose(tasks, bank, options.machine, "basis" if options.sequencer == "basis" else "superpose")


def filter_stream(chunks: Iterable[bytes], options: Options, summary: Summary | None = None) -> Iterator[bytes]:
    """Filter G-code: bytes in, bytes out, as they come.

    Input that gcodectl has filtered before comes out as it went in; what it found nothing to do in, as after a neutral
    material, counts as not filtered. Raises InputError, before any byte of the line concerned has left, where the input
    cannot be followed safely.
    """
    summary = summary if summary is not None else Summary()
    if options.bank.neutral:
        options = dataclasses.replace(options, keep_retracts=True)
    source = Fresh(chunks)
    last, lines, changed = b"", b"", False
    if options.heat is not None:
        from gcodectl.thermal.tally import Tally

        summary.heat = Tally(options.heat.band)
    composed = summed(compose_moves(read_moves(source, options), options, summary.heat), summary)
    steady = np.ones(len(options.sets)) if options.inversions else options.bank.steady
    for out in emit(composed, options.machine, steady):
        last, changed = out, changed or MARK in out
        lines = out if b"\n" in out else lines
        yield out
    for last in chain(source.rest, source.chunks):
        yield last
    summary.already_filtered = bool(source.rest) and not changed
    if not summary.already_filtered:
        newline = b"\r\n" if b"\r\n" in lines else b"\n"
        yield (b"" if last.endswith(b"\n") or not last else newline) + _trailer(options) + newline


def filter_bytes(data: bytes, options: Options) -> bytes:
    """Filter a whole file in memory."""
    return b"".join(filter_stream([data] if data else [], options))


def _trailer(options: Options) -> bytes:
    materials = ", ".join("neutral" if one is None else one.key for one in options.sets)
    heat = f", heat of {Path(options.heat.name).stem}" if options.heat is not None else ""
    return f"; gcodectl {VERSION}: {options.machine.name}, {materials}{heat}".encode()


def _closed(chunks: Iterable[Moves]) -> Iterator[Moves]:
    """The moves, and one more that comes to rest after the last, without a line of its own."""
    last: Moves | None = None
    for moves in chunks:
        last = moves if len(moves) else last
        yield moves
    if last is not None:
        last = last[-1:]
        one = {"row": last.row + 1, "start": last.end, "kind": np.array([Kind.BARRIER]), "p0": last.p1}
        nothing = {name: np.zeros(1) for name in ("e", "length", "sweep", "dwell")}
        yield last.replace(**one, **nothing, flags=last.flags & ~int(Flag.KNOWN))
