import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import SYRINGE, Pen, chunked, pens, plain_python, same, three_lines

from gcodectl.config import Machine
from gcodectl.errors import UsageError
from gcodectl.flow import compose as stage
from gcodectl.flow.bank import SignalBank, signal_bank
from gcodectl.flow.compose import SEQUENCERS, compose, hand_over_kernel
from gcodectl.flow.events import due_share, flow_events, unused_margin
from gcodectl.flow.holds import hold_starts
from gcodectl.flow.library import BasisSet, BasisSignal, open_library
from gcodectl.flow.tasks import segment
from gcodectl.motion.lookahead import plan
from gcodectl.motion.profile import profile
from gcodectl.records import Command, Composed, Moves, Profile, TaskKind, Tasks

PASTE = signal_bank([open_library().find("paste-a"), open_library().find("paste-b")])
NEUTRAL = signal_bank([None])
TIGHT = dataclasses.replace(SYRINGE, max_flow=9.0)
WIDE = dataclasses.replace(SYRINGE, max_flow=1e4)


def composed(
    moves: Moves, bank: SignalBank = PASTE, sequencer: str = "superpose", size: int = 10_000, machine: Machine = SYRINGE
) -> list[Composed]:
    held = hold_starts(chunked(moves, size))
    timed = profile(plan(held, machine), machine, bank.tail, bank.longest_lead)
    return list(compose(segment(timed), bank, machine, sequencer))


def joined(pieces: list[Composed]) -> tuple[Moves, Profile, Tasks, Command]:
    """Everything in one; the command on one grid, and every sample that two pieces share the same in both."""
    dt = pieces[0].command.dt
    end = max(round(piece.command.t1 / dt) for piece in pieces)
    u, reference = np.full(end, np.nan), np.full(end, np.nan)
    for piece in pieces:
        first = round(piece.command.t0 / dt)
        for whole, part in ((u, piece.command.u), (reference, piece.command.reference)):
            place = whole[first : first + len(part)]
            assert np.array_equal(place[~np.isnan(place)], part[~np.isnan(place)])
            place[:] = part
    moves = Moves.concat([piece.moves for piece in pieces])
    phases = Profile.concat([piece.profile for piece in pieces])
    return moves, phases, Tasks.concat([piece.tasks for piece in pieces]), Command(0.0, dt, u, reference)


def volume(moves: Moves) -> float:
    return float((moves.e * moves.area)[moves.deposits].sum())


def test_a_neutral_bank_adds_nothing_to_the_reference() -> None:
    assert NEUTRAL.neutral
    for sequencer in SEQUENCERS:
        pieces = composed(three_lines().moves(), NEUTRAL, sequencer, 1)
        command = joined(pieces)[3]
        assert command.u.any()
        assert np.array_equal(command.u, command.reference)
        moves = Moves.concat([piece.moves for piece in pieces])
        assert np.array_equal(moves.line[moves.start < moves.end], three_lines().moves().line)


def test_the_reference_is_what_the_material_takes_for_the_flow() -> None:
    pen = Pen().go(10, 0).road(30, 0).tool(1).go(40, 0).road(60, 0)
    _, _, _, command = joined(composed(pen.moves()))
    halves = [10.0, 10.0] * PASTE.steady
    assert command.reference.sum() * command.dt == pytest.approx(halves.sum(), rel=1e-9)


def test_a_tool_beyond_the_bank_uses_the_last() -> None:
    one, nine = (joined(composed(Pen().tool(n).go(10, 0).road(30, 0).moves()))[3] for n in (1, 9))
    assert np.array_equal(one.u, nine.u)


def test_volume_is_the_references_and_what_the_signals_add() -> None:
    pen = three_lines().go(100, 20)
    moves, _, tasks, command = joined(composed(pen.moves(), machine=WIDE))
    added = np.zeros(len(command.u))
    events, begin, when = flow_events(tasks, np.zeros(len(tasks)))
    scale = events.flow * due_share(events, begin, PASTE, np.full(1, -1.0))
    stage.superpose_kernel(
        events.kind.astype(np.int64), events.tool.astype(np.int64), when, unused_margin(events, PASTE), scale, begin,
        0, PASTE.dt, PASTE.values, PASTE.count, PASTE.lead, PASTE.dip, PASTE.steady, added,
    )  # fmt: skip
    assert command.u == pytest.approx(command.reference + added, abs=1e-9)
    assert command.reference.sum() * PASTE.dt == pytest.approx(volume(moves) * PASTE.steady[0], rel=1e-9)


def test_a_lump_keeps_its_volume_where_there_is_room() -> None:
    pen = three_lines().go(200, 20)
    capped = dataclasses.replace(SYRINGE, max_flow=15.0)
    wide, tight = (joined(composed(pen.moves(), machine=machine))[3].u for machine in (WIDE, capped))
    assert wide.max() > 1.5 * capped.max_flow
    assert tight.max() == pytest.approx(capped.max_flow)
    assert tight.sum() == pytest.approx(wide.sum(), rel=1e-9)


@pytest.mark.parametrize("kernel", [hand_over_kernel, hand_over_kernel.py_func])
def test_a_lump_goes_half_before_and_half_after(kernel) -> None:  # type: ignore[no-untyped-def]
    u = np.array([0, 1, 1, 5, -7, 0, 3.5, 0.0])
    out = np.clip(u, -3, 3)
    assert kernel(u, out, 0, len(u), False, 3.0, 2, np.array([0, 99])) == 6
    assert kernel(u, out, 6, len(u), True, 3.0, 2, np.array([0, 99])) == 8
    assert np.abs(out).max() <= 3
    assert out[:3].tolist() == [0, 1, 2]
    walled = np.clip(u, -3, 3)
    kernel(u, walled, 0, len(u), True, 3.0, 2, np.array([0, 3, 99]))
    assert walled[:3].tolist() == [0, 1, 1]
    across = np.array([0, 0, 5, 5, 0, 0.0])
    out = np.clip(across, -3, 3)
    kernel(across, out, 0, 6, True, 3.0, 4, np.array([0, 3, 99]))
    assert out.tolist() == [0, 1, 3, 3, 1, 0]


@pytest.mark.parametrize("sequencer", SEQUENCERS)
def test_no_signal_begins_before_its_passage(sequencer: str) -> None:
    pen = Pen().go(10, 0).road(30, 0).go(35, 0).tool(1).road(60, 0).road(60, 30).go(99, 0)
    for machine in (SYRINGE, TIGHT):
        moves, phases, _, command = joined(composed(pen.moves(), sequencer=sequencer, machine=machine))
        tool = int(np.flatnonzero(moves.starts_passage)[0])
        begin = phases.t[phases.row > tool][0]
        alone = Pen().go(10, 0).road(30, 0).go(35, 0).tool(1)
        _, _, _, first = joined(composed(alone.moves(), sequencer=sequencer, machine=machine))
        n = int(begin / command.dt) - 1
        assert command.u[:n] == pytest.approx(first.u[:n], abs=1e-9)
        assert np.abs(command.u[n + 2 :]).max() > 1


@given(pens(most=40), st.sampled_from(SEQUENCERS), st.sampled_from([SYRINGE, TIGHT]))
def test_the_plunger_keeps_its_limit_and_every_row_leaves_once(pen: Pen, sequencer: str, machine: Machine) -> None:
    moves, phases, tasks, command = joined(composed(pen.moves(), sequencer=sequencer, machine=machine))
    assert moves.row.tolist() == list(range(len(moves)))
    assert np.isfinite(command.u).all()
    assert np.abs(command.u).max(initial=0.0) <= machine.max_flow * (1 + 1e-12)
    assert np.array_equal(tasks.t1[:-1], tasks.t0[1:])
    if len(phases):
        assert command.t1 >= phases.t[-1] + phases.duration[-1] - 1e-9
    deposited = (command.reference.sum() * command.dt) if len(command.u) else 0.0
    shares = PASTE.steady[np.clip(moves.tool, 0, 1)]
    timed = np.isin(moves.row, phases.row)
    assert deposited == pytest.approx(float((moves.e * moves.area * shares)[moves.deposits & timed].sum()), rel=1e-4)


@settings(max_examples=25)
@given(pens(most=60), st.sampled_from(SEQUENCERS), st.sampled_from([1, 37]), st.sampled_from([SYRINGE, TIGHT]))
def test_any_chunking_composes_the_same(pen: Pen, sequencer: str, size: int, machine: Machine) -> None:
    whole = joined(composed(pen.moves(), sequencer=sequencer, machine=machine))
    pieces = joined(composed(pen.moves(), sequencer=sequencer, size=size, machine=machine))
    for a, b in zip(whole[:3], pieces[:3], strict=True):
        same(a, b)
    assert np.array_equal(whole[3].u, pieces[3].u)
    assert np.array_equal(whole[3].reference, pieces[3].reference)


@pytest.mark.parametrize("sequencer", SEQUENCERS)
def test_a_road_that_never_ends_leaves_on_the_way(sequencer: str) -> None:
    pen = Pen().go(5, 0)
    for k in range(600):
        pen.road(5 + k, 1.0 + k % 2)
    given_in = 0

    def watched():  # type: ignore[no-untyped-def]
        nonlocal given_in
        for chunk in chunked(pen.moves(), 20):
            given_in += len(chunk)
            yield chunk

    held, out = [], 0
    for piece in compose(segment(profile(plan(watched(), SYRINGE), SYRINGE)), PASTE, SYRINGE, sequencer):
        out += len(piece.moves)
        held.append(given_in - out)
    assert out == 601
    assert max(held) < 150


def test_barriers_that_are_past_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = []
    kernel = stage.hand_over_kernel
    monkeypatch.setattr(stage, "hand_over_kernel", lambda *args: kept.append(len(args[-1])) or kernel(*args))
    pen = Pen()
    for k in range(200):
        pen.go(k, 9).barrier().go(k, 0).road(k + 0.5, 0)
    composed(pen.moves(), size=5)
    assert max(kept) < 30


@pytest.mark.parametrize("sequencer", SEQUENCERS)
@pytest.mark.parametrize(
    "pen", [Pen(), Pen().plain(), Pen().dwell(0.3), Pen().lost(1, 1), Pen().barrier(), Pen().push(1)]
)
def test_files_without_a_road(pen: Pen, sequencer: str) -> None:
    pieces = composed(pen.moves(), sequencer=sequencer)
    moves, _, tasks, command = joined(pieces)
    assert len(moves) == len(pen.rows)
    assert tasks.kind.tolist() == [TaskKind.NO_FLOW]
    assert not command.u.any()


@pytest.mark.parametrize("sequencer", SEQUENCERS)
def test_the_same_with_the_jit_off(sequencer: str) -> None:
    pen = three_lines()
    expected = joined(composed(pen.moves(), sequencer=sequencer, machine=TIGHT))[3]
    with plain_python("gcodectl.flow.compose", "gcodectl.flow.sequencer"):
        plain = joined(composed(pen.moves(), sequencer=sequencer, machine=TIGHT))[3]
    assert plain.u == pytest.approx(expected.u, abs=1e-9)
    assert plain.reference == pytest.approx(expected.reference, abs=1e-9)


def test_the_bank() -> None:
    paste = open_library().find("paste-a")
    assert PASTE.values.shape[:2] == (2, 3)
    start = paste.signals[TaskKind.START]
    assert PASTE.values[0, TaskKind.START, : len(start.values)] == pytest.approx(start.values / paste.flow)
    assert PASTE.longest_lead == PASTE.lead.max()
    stops = PASTE.count[:, 0] * PASTE.dt - PASTE.lead[:, 0]
    assert PASTE.tail == stops.max() > 0
    assert not PASTE.neutral
    assert signal_bank([]).longest_lead == 0.0
    mixed = signal_bank([None, paste])
    assert mixed.steady.tolist() == [1.0, paste.steady]
    assert not mixed.count[0].any()


def test_libraries_of_different_sample_times_do_not_mix() -> None:
    signals = {kind: BasisSignal(np.ones(3)) for kind in TaskKind}
    other = BasisSet("other", 0.84, 0.02, 5.0, signals)
    with pytest.raises(UsageError, match="different sample times"):
        signal_bank([open_library().find("paste-a"), other])
