"""The arguments of a kernel: their types as a short text, and the values that its gateway is given.

    array      `d2C`      dtype, dimensions, layout    the address of its object
    number     i f b      int64, float64, bool         itself
    tuple      `( )`      its items                    its items

Whatever the caller's numbers are, a kernel sees int64, float64 and bool; whether an array may be written makes no
signature of its own. A kernel so has one signature wherever its callers agree on dtypes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

_WORDS: dict[tuple[str, str, int, bool], str] = {}
"""Words of arrays by dtype's letter (int64 may have two) and order, dimensions, and whether they lie as C lays them."""


def _word(array: Any) -> str:
    dtype, contiguous = array.dtype, array.flags.c_contiguous
    if dtype.kind not in "biuf" or not dtype.isnative:
        raise TypeError(f"a kernel takes arrays of numbers in this machine's byte order, not {dtype}")
    _WORDS[dtype.char, dtype.byteorder, array.ndim, contiguous] = word = (
        f"{dtype.char}{array.ndim}{'C' if contiguous else 'A'}"
    )
    return word


def spell(arguments: Iterable[Any], words: list[str]) -> None:
    """Append the arguments' types to `words`.

    Raises TypeError for what is neither number, array nor tuple of them.
    """
    for one in arguments:
        kind = type(one)
        if kind is np.ndarray:
            dtype = one.dtype
            key = dtype.char, dtype.byteorder, one.ndim, one.flags.c_contiguous
            words.append(_WORDS.get(key) or _word(one))
        elif kind is bool or kind is np.bool_:
            words.append("b")
        elif isinstance(one, (int, np.integer)):
            words.append("i")
        elif isinstance(one, (float, np.floating)):
            words.append("f")
        elif isinstance(one, tuple):
            words.append("(")
            spell(one, words)
            words.append(")")
        else:
            raise TypeError(f"a kernel takes numbers, arrays and tuples of them, not {one!r}")


def slots(arguments: Iterable[Any]) -> tuple[tuple[Any, ...], list[Any]]:
    """Return the Python types of the arguments, and a value for each slot of a gateway; far quicker than to spell."""
    kinds: list[Any] = []
    values: list[Any] = []
    for one in arguments:
        kind = type(one)
        if kind is np.ndarray:
            values.append(id(one))
        elif isinstance(one, tuple):
            kind, inner = slots(one)  # type: ignore[assignment]  # a tuple of kinds in its kind's place
            values += inner
        else:
            values.append(one)
        kinds.append(kind)
    return tuple(kinds), values


def numba_types(words: Iterable[str]) -> tuple[Any, ...]:
    """Return numba's types of a signature's words."""
    from numba import types as made_typed
    from numba.np.numpy_support import from_dtype

    types: Any = made_typed
    numbers = {"i": types.int64, "f": types.float64, "b": types.boolean}
    open_: list[list[Any]] = [[]]
    for word in words:
        if word == "(":
            open_.append([])
        elif word == ")":
            items = open_.pop()
            open_[-1].append(types.Tuple(items))
        elif word in numbers:
            open_[-1].append(numbers[word])
        else:
            open_[-1].append(types.Array(from_dtype(np.dtype(word[0])), int(word[1:-1]), word[-1]))
    return tuple(open_[0])
