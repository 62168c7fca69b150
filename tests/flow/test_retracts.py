import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moves import Pen, chunked, pens, plain_python, same

from gcodectl.flow import retracts
from gcodectl.flow.retracts import replace_retracts
from gcodectl.records import Flag, Kind, Moves


def replaced(pen: Pen, size: int = 10_000) -> Moves:
    return Moves.concat(list(replace_retracts(chunked(pen.moves(), size))))


def dropped(pen: Pen, size: int = 10_000) -> list[int]:
    """Rows that leave no line."""
    moves = replaced(pen, size)
    assert np.array_equal(moves.row, np.arange(len(pen.rows)))
    gone = np.flatnonzero(moves.start == moves.end)
    assert (moves.kind[gone] == Kind.NOTHING).all()
    assert not moves.e[gone].any()
    return gone.tolist()


def between(*steps: str, amount: float = 0.8) -> Pen:
    """A road, some steps, another road; the steps are the rows from 1 on."""
    pen = Pen().road(5, 0)
    for step in steps:
        {
            "pull": lambda: pen.push(-amount), "push": lambda: pen.push(amount), "travel": lambda: pen.go(9, 9),
            "wipe": lambda: pen.go(4, 0, e=-0.1), "prime": lambda: pen.push(2 * amount),
            "G10": lambda: pen.plain(Kind.RETRACT), "G11": lambda: pen.plain(Kind.UNRETRACT), "note": pen.plain,
        }[step]()  # fmt: skip
    return pen.road(20, 0)


def test_a_retract_and_its_unretract_go() -> None:
    assert dropped(between("pull", "travel", "push")) == [1, 3]
    assert dropped(between("pull", "note", "travel", "push", "note")) == [1, 4]
    assert dropped(between("G10", "travel", "G11")) == [1, 3]
    assert dropped(between("pull", "travel", "pull", "push", "push")) == [1, 3, 4, 5]


def test_a_wipe_keeps_its_path_without_e() -> None:
    moves = replaced(between("wipe", "travel"))
    assert moves.e[1] == 0.0
    assert moves.kind[1] == Kind.LINE
    assert moves.raw(1) == b"row 1\n"


def test_a_wipe_that_may_not_be_rewritten_stays() -> None:
    pen = Pen().road(5, 0).go(4, 0, e=-0.1, flags=int(Flag.RELATIVE_E)).go(9, 9).road(20, 0)
    assert replaced(pen).e[1] == -0.1


def test_primes_stay() -> None:
    assert dropped(between("push")) == []
    assert dropped(between("pull", "travel", "prime")) == [1]
    assert dropped(between("pull", "push", "push")) == [1, 2]


def test_unloading_stays() -> None:
    assert dropped(between("pull", "travel", "push", amount=15.0)) == []
    assert dropped(between("pull", "travel", "push", amount=14.9)) == [1, 3]


def test_at_the_end_of_the_file() -> None:
    pen = Pen().road(5, 0).push(-0.8).go(0, 0)
    for size in (1, 2, 99):
        assert dropped(pen, size) == [1]
        assert dropped(Pen().push(-0.8).go(5, 5).push(0.8), size) == []
        assert dropped(Pen().push(-0.8).go(5, 5).push(0.8).road(9, 9), size) == [0, 2]
    assert len(replaced(Pen())) == 0


def test_a_row_of_unknown_e_stays() -> None:
    pen = Pen().road(5, 0).push(-0.8).push(np.nan).push(0.8).road(9, 0)
    moves = replaced(pen)
    assert (moves.start == moves.end).tolist() == [False, True, False, True, False]
    assert np.isnan(moves.e[2])


@pytest.mark.parametrize("size", [1, 2, 3, 99])
@pytest.mark.parametrize(("notes", "rows"), [(2, [1, 4]), (3, [])])
def test_patience_ends(monkeypatch: pytest.MonkeyPatch, size: int, notes: int, rows: list[int]) -> None:
    monkeypatch.setattr(retracts, "PATIENCE", 4)
    assert dropped(between("pull", *["note"] * notes, "push"), size) == rows
    again = between("pull", *["note"] * notes, "push").push(-0.8).push(0.8).road(30, 0)
    assert dropped(again, size) == [*rows, notes + 4, notes + 5]


@given(pens(most=60), st.sampled_from([1, 2, 7]), st.sampled_from([3, 20_000]))
def test_any_chunking_replaces_the_same(pen: Pen, size: int, patience: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(retracts, "PATIENCE", patience)
        whole = replaced(pen)
        same(whole, replaced(pen, size))
    assert np.array_equal(whole.row, np.arange(len(pen.rows)))
    assert np.array_equal(whole.length, pen.moves().length, equal_nan=True)


def test_the_same_with_the_jit_off() -> None:
    pen = between("pull", "wipe", "G10", "travel", "prime", "push")
    with plain_python("gcodectl.flow.retracts"):
        plain = replaced(pen)
    same(plain, replaced(pen))
