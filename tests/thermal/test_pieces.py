"""Pieces: where a file is cut, the same whatever the chunks; and locations along arcs and lines."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from gcodectl.config import load_machine
from gcodectl.pipeline import Options, read_moves
from gcodectl.records import Moves
from gcodectl.thermal import pieces as module
from gcodectl.thermal.beneath import S, X, Y, Z
from gcodectl.thermal.locations import Sampler, corners
from gcodectl.thermal.pieces import Piece, pieces

DATA = Path(__file__).parent.parent / "data"
MACHINE = load_machine("syringe")
HEAD = "G21\nG90\nM83\nG1 X0 Y0 Z1 F600\n"


def moves_of(text: str) -> Moves:
    return Moves.concat(list(read_moves([text.encode()], Options(MACHINE))))


def cut(moves: Moves, bead: float = 1.2, size: int = 1 << 30) -> list[Piece]:
    return list(pieces((moves[k : k + size] for k in range(0, len(moves), size)), bead))


def square(z: float, side: float = 20.0) -> str:
    return "".join(f"G1 X{x} Y{y} E1\n" for x, y in ((side, 0), (side, side), (0, side), (0, 0))) + f"G1 Z{z + 1}\n"


def test_layers_are_pieces_with_what_comes_before_their_first_road() -> None:
    moves = moves_of(HEAD + square(1) + square(2) + square(3))
    found = cut(moves)
    assert [len(one.moves.deposits.nonzero()[0]) for one in found] == [4, 4, 4]
    assert [one.begins for one in found] == [True] * 3
    assert (
        bytes(moves.text.tobytes()).decode()
        == b"".join(one.moves.raw(k) for one in found for k in range(len(one.moves))).decode()
    )
    assert found[1].moves.raw(0) == b"G1 Z2\n"
    assert [one.path for one in found] == pytest.approx([0.0, 80.0, 160.0])


def test_marks_alone_cut_nothing_and_a_spiral_is_cut_where_it_lies_on_itself() -> None:
    rows = [HEAD]
    for k in range(200):
        a = 2 * math.pi * k / 40
        rows.append(f";LAYER_CHANGE\nG1 X{10 * math.cos(a):.4f} Y{10 * math.sin(a):.4f} Z{1 + k / 80:.4f} E0.1\n")
    found = cut(moves_of("".join(rows)))
    turns = [one.path / (20 * math.pi) for one in found]
    assert np.diff(turns)[1:] == pytest.approx(np.ones(len(turns) - 2), abs=0.05)  # the first has the way there


def test_what_never_lies_on_itself_is_cut_by_its_size(monkeypatch: pytest.MonkeyPatch) -> None:
    long = moves_of(HEAD + "".join(f"G1 X{2 * k} Y{k % 2} E0.1\n" for k in range(1, 300)))
    monkeypatch.setattr(module, "MOST_ROWS", 50)
    found = cut(long)
    assert max(len(one.moves) for one in found) <= 51
    assert [one.begins for one in found] == [True] + [False] * (len(found) - 1)
    monkeypatch.setattr(module, "MOST_ROWS", 10_000)
    monkeypatch.setattr(module, "MOST_LOCATIONS", 100)
    found = cut(long)
    assert len(found) > 5
    assert max(len(one.locations) for one in found) <= 105


def test_rows_without_a_road_do_not_pile_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_ROWS", 50)
    moves = moves_of(HEAD + ";\n" * 130 + "G1 X9 E1\n" + ";\n" * 130 + "G1 X20 E1\nG1 X30 E1\n")
    found = cut(moves, size=7)
    assert [len(one.moves) for one in found] == [len(one.moves) for one in cut(moves)]
    assert max(len(one.moves) for one in found) <= 86
    assert sum(len(one.moves) for one in found) == len(moves)
    assert [one.path for one in found][-1] == 9.0


@pytest.mark.parametrize("name", ["box_abs.gcode", "arcs_rel.gcode", "star_rel.gcode"])
@pytest.mark.parametrize("size", [1, 13])
def test_any_chunking_gives_the_same_pieces(name: str, size: int) -> None:
    moves = Moves.concat(list(read_moves([(DATA / name).read_bytes()], Options(MACHINE))))[:400]
    whole, parts = cut(moves), cut(moves, size=size)
    assert len(whole) == len(parts) > 1
    for one, other in zip(whole, parts, strict=True):
        assert np.array_equal(one.moves.row, other.moves.row)
        assert np.array_equal(one.locations, other.locations)
        assert (one.path, one.begins) == (other.path, other.begins)


def test_a_turn_in_one_arc_that_lies_on_itself_stays_whole() -> None:
    ring = "G3 X10 Y0 I-10 J0 Z1.7 E3\nG3 X10 Y0 I-10 J0 Z2.4 E3\n"
    found = cut(moves_of(HEAD + "G1 X10\n" + ring))
    assert [int(one.moves.deposits.sum()) for one in found] == [1, 1]


def test_locations_lie_at_equal_steps_on_what_is_deposited() -> None:
    moves = moves_of(HEAD + "G1 X10 E1\nG1 X30\nG3 X30 Y20 I0 J10 E2\nG1 X20 E1\n")
    places, rows = Sampler(0.5).sample(moves)
    assert np.diff(places[:, S]) == pytest.approx(0.5)
    assert places[-1, S] == pytest.approx(20 + 10 * math.pi, abs=0.5)
    on_arc = rows == 6
    assert np.hypot(places[on_arc, X] - 30, places[on_arc, Y] - 10) == pytest.approx(10.0)
    assert (places[:, Z] == 1.0).all()
    assert not ((places[:, X] > 10.0) & (places[:, Y] == 0.0) & (places[:, X] < 30.0)).any()
    part, _ = Sampler(0.5).sample(moves[:5])
    assert np.array_equal(part, places[: len(part)])


def test_corners_are_where_a_road_turns_and_not_where_another_begins() -> None:
    moves = moves_of(HEAD + "G1 X10 E1\nG1 X10 Y10 E1\nG1 X11 Y20 E1\nG1 X30 Y20\nG1 X30 Y0 E1\n")
    assert corners(moves, 100.0) == pytest.approx([110.0])
