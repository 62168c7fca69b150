"""Columns: slices, joins and trims of rows; read-only; lines ride along."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcodectl.columns import Columns, Floats, Ints, TextColumns, column


@dataclass(frozen=True)
class Points(Columns):
    name: str
    number: Ints = column(np.int64)
    at: Floats = column(np.float64, width=2)


@dataclass(frozen=True)
class Lines(TextColumns):
    number: Ints = column(np.int64)


def points(n: int) -> Points:
    return Points("p", np.arange(n), np.arange(2.0 * n).reshape(n, 2))


def lines(*texts: bytes) -> Lines:
    ends = np.cumsum([len(text) for text in texts], dtype=np.int64)
    starts = ends - np.array([len(text) for text in texts], dtype=np.int64)
    return Lines(np.frombuffer(b"".join(texts), dtype=np.uint8), starts, ends, np.arange(len(texts)))


def test_rows_are_taken_by_slice_mask_and_index() -> None:
    p = points(4)
    assert len(p) == 4
    assert p[1:3].number.tolist() == [1, 2]
    assert p[p.number > 2].at.tolist() == [[6.0, 7.0]]
    assert p[np.array([3, 0])].number.tolist() == [3, 0]
    assert p[:0].name == "p"


def test_columns_are_read_only_and_equally_long() -> None:
    with pytest.raises(ValueError, match="read-only"):
        points(2).number[0] = 1
    for wrong in ({"number": np.arange(3)}, {"at": np.zeros((2, 3))}, {"at": np.zeros(2)}):
        with pytest.raises(AssertionError):
            points(2).replace(**wrong)


def test_a_writable_array_stays_writable_for_its_owner() -> None:
    mine = np.arange(2)
    Points("p", mine, np.zeros((2, 2)))
    mine[0] = 7


@given(st.lists(st.integers(0, 4), max_size=5))
def test_parts_joined_are_the_whole(sizes: list[int]) -> None:
    whole = points(sum(sizes))
    cuts = np.cumsum([0, *sizes])
    parts = [whole[a:b] for a, b in pairwise(cuts)]
    if parts:
        assert Points.concat(parts).at.tolist() == whole.at.tolist()


@given(st.lists(st.binary(max_size=6), max_size=6), st.data())
def test_raw_lines_survive_slices_and_joins(texts: list[bytes], data: st.DataObject) -> None:
    whole = lines(*texts)
    cut = data.draw(st.integers(0, len(texts)))
    joined = Lines.concat([whole[cut:], whole[:cut]])
    assert [joined.raw(k) for k in range(len(joined))] == texts[cut:] + texts[:cut]
    assert len(joined.text) == sum(map(len, texts))


def test_nothing_joined_is_nothing() -> None:
    assert len(Lines.concat([])) == len(Lines.empty()) == 0
    assert Lines.empty(2).raw(1) == b""
