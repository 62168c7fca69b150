"""Numbers as G-code words: what is written reads back as the value to its digits, in its shortest form."""

from __future__ import annotations

import re
from decimal import ROUND_HALF_UP, Decimal

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gcodectl.gcode import write
from gcodectl.gcode.write import word

VALUES = st.floats(-1e6, 1e6, allow_nan=False)


@given(VALUES, st.integers(0, 8))
@example(0.0, 5)
@example(-0.0000001, 5)
@example(0.9999999, 3)
@example(-0.5, 3)
@example(1e6, 8)
@example(100.0, 0)
@example(0.00001, 5)
def test_a_word_reads_back_to_its_digits(value: float, decimals: int) -> None:
    text = word(value, decimals).decode()
    assert re.fullmatch(r"-?(0|[1-9]\d*)(\.\d*[1-9])?", text)
    assert text != "-0"
    assert len(text.partition(".")[2]) <= decimals
    assert abs(Decimal(text) - Decimal(value)) <= Decimal("0.5000001") * Decimal(10) ** -decimals + Decimal("1e-9")


@given(st.integers(-(10**9), 10**9), st.integers(0, 6))
def test_a_number_with_so_many_digits_is_written_as_it_is(units: int, decimals: int) -> None:
    number = Decimal(units).scaleb(-decimals)
    assert Decimal(word(float(number), decimals).decode()) == number


@given(VALUES, st.integers(0, 6))
def test_what_was_rounded_is_what_is_written(value: float, decimals: int) -> None:
    rounded = write.units_kernel(value, decimals) / 10.0**decimals
    assert float(word(value, decimals)) == pytest.approx(rounded, rel=1e-15, abs=1e-15)
    if abs(value) < 1e4:
        exact = Decimal(value).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP)
        assert abs(Decimal(rounded) - exact) <= Decimal(10) ** -decimals  # a tie in binary may go either way


@given(VALUES, st.integers(0, 8))
def test_plain_python_writes_the_same(value: float, decimals: int) -> None:
    units = write.units_kernel(value, decimals)
    assert write.units_kernel.py_func(value, decimals) == units
    out = np.zeros(40, dtype=np.uint8)
    end = write.write_word_kernel.py_func(out, 0, 88, units, decimals)
    assert out[:end].tobytes() == b" X" + word(value, decimals)


LINES = [
    ("G1 X1 E2 ; e", "E", True, 9),
    ("g1 x1 e2", "E", True, None),
    ("G1 X1 ; E2", "E", False, 6),
    ("G1 (E4) X1", "E", False, None),
    ("G1 (a;b) X1 ;c", "X", True, 12),
    ("; E1", "E", False, 0),
    ("(E1 ; X", "E", False, None),
    ("", "E", False, None),
]


@pytest.mark.parametrize(("line", "letter", "has", "comment"), LINES)
def test_words_and_comments_are_found(line: str, letter: str, has: bool, comment: int | None) -> None:
    text = np.frombuffer(b"??" + line.encode() + b"E;", dtype=np.uint8)
    end = 2 + len(line)
    for find in (write.has_word_kernel, write.has_word_kernel.py_func):
        assert bool(find(text, 2, end, ord(letter))) is has
    for find in (write.comment_kernel, write.comment_kernel.py_func):
        assert find(text, 2, end) == (end if comment is None else 2 + comment)
