"""Steering: models inverted along moves, tool by tool, what a barrel holds carried on, however the moves are cut."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from flow_models import BACKLASH, LINEAR, MODELS, PLUNGER
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import SYRINGE, Pen, chunked, pens, plain_python, same, three_lines

from gcodectl.columns import Floats
from gcodectl.flow import steer as stage
from gcodectl.flow.flow_model import STATE, STORED, FlowModel
from gcodectl.flow.holds import hold_starts
from gcodectl.flow.inversion import Inversion
from gcodectl.flow.plungers import AT, BARREL, BLOCK, rest_kernel
from gcodectl.flow.pursuit import stand_kernel
from gcodectl.flow.slewing import slewed_kernel
from gcodectl.flow.steer import steer
from gcodectl.motion.lookahead import plan
from gcodectl.motion.profile import profile
from gcodectl.records import Command, Composed, Kind, Moves, Profile, Tasks

DT = 0.01
SLEW = SYRINGE.max_flow_slew


def behind(*models: FlowModel | None) -> tuple[Inversion | None, ...]:
    return tuple(Inversion(one, SYRINGE.max_flow, SLEW, DT) if one else None for one in models)


PASTE = behind(PLUNGER)


def steered(moves: Moves, inversions: Sequence[Inversion | None] = PASTE, size: int = 10_000) -> list[Composed]:
    tail = max((one.tail for one in inversions if one), default=0.0)
    lead = max((one.lead for one in inversions if one), default=0.0)
    held = hold_starts(chunked(moves, size))
    return list(steer(profile(plan(held, SYRINGE), SYRINGE, tail, lead), inversions, DT))


def joined(pieces: list[Composed]) -> tuple[Moves, Profile, Tasks, Command]:
    """Everything in one; the command on one grid, and every sample that two pieces share the same in both."""
    end = max((round(piece.command.t1 / DT) for piece in pieces), default=0)
    u, reference = np.full(end, np.nan), np.full(end, np.nan)
    for piece in pieces:
        first = round(piece.command.t0 / DT)
        for whole, part in ((u, piece.command.u), (reference, piece.command.reference)):
            place = whole[first : first + len(part)]
            assert np.array_equal(place[~np.isnan(place)], part[~np.isnan(place)])
            place[:] = part
    return (
        Moves.concat([piece.moves for piece in pieces]),
        Profile.concat([piece.profile for piece in pieces]),
        Tasks.concat([piece.tasks for piece in pieces]),
        Command(0.0, DT, u, reference),
    )


def laid(model: FlowModel, u: Floats) -> Floats:
    mean = np.array([slewed_kernel(now, last, SLEW * DT) for now, last in zip(u, np.append(0.0, u), strict=False)])
    return model.predict(mean, DT)


def rms(x: Floats) -> float:
    return float(np.sqrt(np.mean(x**2)))


@pytest.mark.parametrize("structure", MODELS)
def test_the_flow_is_what_the_roads_ask_for(structure: str) -> None:
    model = MODELS[structure]
    moves, _, _, command = joined(steered(three_lines().moves(), behind(model)))
    wanted = command.reference
    assert wanted.sum() * DT == pytest.approx(float((moves.e * moves.area)[moves.deposits].sum()), rel=1e-6)
    q, plain = laid(model, command.u), model.predict(wanted * model.steady_rate(5.0) / 5.0, DT)
    assert rms(q - wanted) < 0.5 * rms(plain - wanted)
    assert q.sum() == pytest.approx(wanted.sum(), rel=0.05)


@settings(max_examples=20)
@given(pens(), st.sampled_from(sorted(MODELS)))
def test_the_plunger_keeps_its_limit_and_every_row_leaves_once(pen: Pen, structure: str) -> None:
    given_in = pen.moves()
    moves, phases, _, command = joined(steered(given_in, behind(MODELS[structure], None)))
    real = moves.start < moves.end
    assert np.array_equal(moves.line[real], given_in.line)
    assert np.isfinite(command.u).all()
    second = np.zeros(len(command.u), dtype=bool)  # of the tool that obeys at once, u is what the road asks for
    for k in np.flatnonzero(moves.tool[phases.row - moves.row[0]] > 0):
        second[int(phases.t[k] / DT) : int((phases.t[k] + phases.duration[k]) / DT) + 1] = True
    assert np.abs(command.u[~second]).max(initial=0.0) <= SYRINGE.max_flow * (1 + 1e-9)


@settings(max_examples=25)
@given(pens(most=40), st.sampled_from([1, 2, 7, 19]), st.sampled_from([(BACKLASH, LINEAR), (None, PLUNGER), (LINEAR,)]))
def test_any_chunking_steers_the_same(pen: Pen, size: int, models: tuple[FlowModel | None, ...]) -> None:
    moves = pen.moves()
    for whole, pieces in zip(
        joined(steered(moves, behind(*models))), joined(steered(moves, behind(*models), size)), strict=True
    ):
        if isinstance(whole, Command):
            assert np.array_equal(whole.u, pieces.u)  # type: ignore[union-attr]
            assert np.array_equal(whole.reference, pieces.reference)  # type: ignore[union-attr]
        else:
            same(whole, pieces)  # type: ignore[arg-type]


@pytest.mark.parametrize("samples", [1, 60, 700])
def test_what_prints_slowly_is_steered_in_short_pieces(samples: int, monkeypatch: pytest.MonkeyPatch) -> None:
    moves = Pen().road(5, 0).dwell(30).go(9, 0).push(-1).road(20, 0).tool(1).plain().road(30, 0).dwell(2).moves()
    whole = joined(steered(moves, behind(PLUNGER, LINEAR)))
    monkeypatch.setattr(stage, "SAMPLES", samples)
    pieces = steered(moves, behind(PLUNGER, LINEAR))
    assert len(pieces) > 3
    for one, other in zip(whole[:3], joined(pieces)[:3], strict=True):
        same(one, other)
    assert np.array_equal(whole[3].u, joined(pieces)[3].u)


def test_a_dead_time_begins_sooner_by_itself() -> None:
    pen = Pen().dwell(3.0).road(20, 0).dwell(3.0)
    u = [joined(steered(pen.moves(), behind(dataclasses.replace(LINEAR, delay=d))))[3].u for d in (0.0, 0.3)]
    begins = [np.flatnonzero(one[100:] > 1.0)[0] for one in u]
    assert begins[0] - begins[1] in (29, 30, 31)


def test_no_road_is_begun_before_its_passage() -> None:
    pen = Pen().dwell(1.0).road(10, 0).barrier()
    alone = joined(steered(pen.moves()))[3].u
    moves, phases, _, command = joined(steered(pen.road(20, 0).road(30, 0).moves()))
    barrier = moves.row[moves.kind == Kind.BARRIER][0]
    begins = int(phases.t[phases.row > barrier][0] / DT)
    assert begins > 100
    assert np.array_equal(command.u[:begins], alone[:begins])
    assert command.u[begins : begins + 20].max() > 20.0
    assert command.reference[begins : begins + 5].max() == 0.0  # it waits for the lead


def test_a_phase_that_ends_with_the_last_sample_decided_leaves_whole() -> None:
    # a tool change of exactly 1 s, and then a road that is known piece by piece only
    for size in (1, 10_000):
        pieces = steered(Pen().tool(1).road(40, 0).road(80, 0).moves(), behind(None, PLUNGER), size)
        assert joined(pieces)[0].line[-1] == 3


def test_what_a_barrel_holds_is_kept_while_another_tool_prints() -> None:
    def first_strokes(*models: FlowModel | None) -> tuple[float, float]:
        pen = Pen().dwell(2.0).road(20, 0).tool(1).road(40, 0).tool(0).go(40, 5).road(60, 5)
        moves, phases, _, command = joined(steered(pen.moves(), behind(*models)))
        tool = moves.tool[phases.row - moves.row[0]]
        again = phases.t[(tool == 0) & (phases.t > phases.t[tool == 1].max())][0]
        at = int(again / DT)
        road = at + np.flatnonzero(command.reference[at:])[0]
        return float(command.u[: int(phases.t[tool == 1][0] / DT)].sum() * DT), float(
            command.u[at : road + 40].sum() * DT
        )

    # what filled the barrel to its threshold at first need not be put in again: the yield holds it
    thick = dataclasses.replace(PLUNGER, threshold=12.0, gap=0.0, delay=0.0)
    thin = dataclasses.replace(PLUNGER, threshold=0.0, gap=0.0, delay=0.0)
    heavy, light = first_strokes(thick, LINEAR), first_strokes(thin, LINEAR)
    assert heavy[0] - light[0] == pytest.approx(12.0 / 0.9, rel=0.1)
    assert heavy[1] == pytest.approx(light[1], abs=1.0)


def test_a_barrel_at_rest_flows_off() -> None:
    inversion = PASTE[0]
    assert inversion is not None
    barrel = np.zeros(BARREL)
    barrel[:STATE], barrel[STORED] = PLUNGER.at_rest, 5.0
    stood = barrel.copy()
    rest_kernel(barrel, 300, inversion.row)
    assert barrel[AT] == 300
    for _ in range(300):
        stand_kernel(stood, 0.0, 0.0, inversion.row)
    assert np.array_equal(barrel[:STATE], stood[:STATE])
    assert PLUNGER.threshold <= barrel[STORED] < 3.0
    rest_kernel(barrel, 100_000_000, inversion.row)  # no longer than LONGEST_REST is looked at
    assert barrel[AT] == 100_000_000
    assert PLUNGER.threshold <= barrel[STORED] <= stood[STORED]
    still = barrel.copy()
    rest_kernel.py_func(barrel, 100_000_300, inversion.row)
    assert barrel[STORED] == pytest.approx(still[STORED], abs=5e-3)


def test_a_tool_beyond_the_inversions_uses_the_last_and_one_without_obeys_at_once() -> None:
    pen = Pen().tool(3).road(20, 0)
    assert np.array_equal(
        joined(steered(pen.moves(), behind(None, PLUNGER)))[3].u, joined(steered(pen.moves(), behind(PLUNGER)))[3].u
    )
    command = joined(steered(pen.moves(), behind(PLUNGER, None)))[3]
    assert np.array_equal(command.u, command.reference)


def test_a_road_that_never_ends_leaves_on_the_way() -> None:
    pen = Pen()
    for k in range(1500):
        pen.road(0.5 * (k + 1), 0)
    given_in, out, held = 0, 0, [0]

    def watched():  # type: ignore[no-untyped-def]
        nonlocal given_in
        for chunk in chunked(pen.moves(), 25):
            given_in += len(chunk)
            yield chunk

    for piece in steer(profile(plan(watched(), SYRINGE), SYRINGE), PASTE, DT):
        out += len(piece.moves)
        held.append(given_in - out)
    assert out == 1500
    # a block and a horizon of 10 mm/s, and what the plan holds back
    assert max(held) < 2 * (BLOCK + PASTE[0].horizon) * DT * 10 / 0.5 + 100  # type: ignore[union-attr]


def test_nothing_in_nothing_out_and_files_without_a_road() -> None:
    assert steered(Moves.empty()) == []
    pieces = steered(Pen().plain().go(10, 0).moves())
    assert sum(len(piece.moves) for piece in pieces) == 2
    assert len(steered(Pen().plain().moves())[0].moves) == 1


def test_the_same_with_the_jit_off() -> None:
    moves = Pen().road(6, 0).tool(1).road(6, 4).moves()
    inversions = behind(BACKLASH, LINEAR)
    expected = joined(steered(moves, inversions))[3]
    with plain_python("gcodectl.flow"):
        found = joined(steered(moves, inversions))[3]
    assert found.u == pytest.approx(expected.u, abs=1e-6)
    assert found.reference == pytest.approx(expected.reference, abs=1e-9)
