import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from moves import Pen, chunked, pens, same

from gcodectl.flow.holds import hold_starts
from gcodectl.records import Kind, Moves


def held(pen: Pen, size: int = 10_000) -> Moves:
    return Moves.concat(list(hold_starts(chunked(pen.moves(), size))))


def test_the_first_road_of_each_passage_has_one() -> None:
    pen = Pen().go(1, 0).road(5, 0).go(6, 0).road(7, 0).barrier().go(8, 0).road(9, 0).road(10, 0).tool(1).barrier()
    moves = held(pen.road(12, 0))
    rows = np.flatnonzero(moves.holds)
    assert rows.tolist() == [1, 7, 12]
    assert moves.row.tolist() == list(range(len(pen.rows) + 3))
    assert moves.line[rows].tolist() == moves.line[rows + 1].tolist()
    assert np.array_equal(moves.p0[rows], moves.p0[rows + 1])
    assert np.array_equal(moves.p1[rows], moves.p0[rows])
    for name in ("length", "e", "dwell", "sweep"):
        assert not getattr(moves, name)[rows].any()
    assert moves.tool[12] == 1


def test_lost_moves_begin_a_passage_too() -> None:
    moves = held(Pen().road(5, 0).lost(6, 6).road(9, 9))
    assert moves.kind.tolist() == [Kind.DWELL, Kind.LINE, Kind.LINE, Kind.DWELL, Kind.LINE]


def test_without_a_road_there_is_nothing_to_wait_for() -> None:
    pen = Pen().go(1, 1).barrier().dwell(0).push(1)
    same(held(pen), pen.moves())
    assert len(held(Pen())) == 0


def test_a_hold_leaves_the_logical_e_where_it_was() -> None:
    pen = Pen().go(1, 0, e_end=40.0).road(5, 0, e_end=40.3, flow_factor=1.1).barrier().road(9, 0, e_end=40.9)
    pen.rows[2]["e_end"] = 40.5
    for size in (1, 10):
        assert held(pen, size).e_end.tolist() == [40.0, 40.0, 40.3, 40.5, 40.5, 40.9]


@given(pens(most=40), st.sampled_from([1, 7]))
def test_any_chunking_gives_the_same_holds(pen: Pen, size: int) -> None:
    whole = held(pen)
    same(whole, held(pen, size))
    assert np.array_equal(whole.row, np.arange(len(whole)))
    others = whole[~(whole.holds & (whole.start == whole.end))]
    assert [others.raw(k) for k in range(len(others))] == [pen.moves().raw(k) for k in range(len(pen.rows))]
    for row in np.flatnonzero(whole.holds & (whole.start == whole.end)):
        assert whole.deposits[row + 1]
