"""The arguments of a kernel: their types as a short text, and as the numbers that machine code takes.

    array      `d2C`      dtype, dimensions, layout    no owner, no owner, items, bytes an item, address, shape, strides
    number     i f b      int64, float64, bool         itself
    tuple      `( )`      its items                    its items

Whatever the caller's numbers are, a kernel sees int64, float64 and bool; whether an array may be written makes no
signature of its own. A kernel so has one signature wherever its callers agree on dtypes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np


def _slowly(array: Any) -> int:
    return int(array.__array_interface__["data"][0])


def _quickly(array: Any) -> int:
    return _POINTER.from_address(id(array) + _DATA).value or 0


_POINTER = ctypes.c_size_t
_DATA = object.__basicsize__
"""Where an array object keeps its address: first behind Python's own part (numpy's ndarraytypes.h, part of its ABI)."""
_KNOWN = np.zeros(3)
address_of: Callable[[Any], int] = _quickly if _quickly(_KNOWN) == _slowly(_KNOWN) else _slowly
"""Where an array's first item is; asking numpy for it takes longer than many a kernel."""


_WORDS: dict[tuple[str, int, bool], str] = {}
"""Words of arrays by dtype, byte order included, dimensions, and whether they lie as C would lay them."""


def _word(array: Any) -> str:
    dtype, contiguous = array.dtype, array.flags.c_contiguous
    if dtype.kind not in "biuf" or not dtype.isnative:
        raise TypeError(f"a kernel takes arrays of numbers in this machine's byte order, not {dtype}")
    _WORDS[dtype.str, array.ndim, contiguous] = word = f"{dtype.char}{array.ndim}{'C' if contiguous else 'A'}"
    return word


def pack(arguments: Iterable[Any], words: list[str], flat: list[Any]) -> None:
    """Append the arguments' types to `words`, and what machine code is given to `flat`.

    Raises TypeError for what is neither number, array nor tuple of them.
    """
    for one in arguments:
        kind = type(one)
        if kind is np.ndarray:
            shape, dtype = one.shape, one.dtype
            words.append(_WORDS.get((dtype.str, len(shape), one.flags.c_contiguous)) or _word(one))
            flat += (None, None, one.size, dtype.itemsize, address_of(one), *shape, *one.strides)
        elif kind is bool or kind is np.bool_:
            words.append("b")
            flat.append(bool(one))
        elif isinstance(one, (int, np.integer)):
            words.append("i")
            flat.append(int(one))
        elif isinstance(one, (float, np.floating)):
            words.append("f")
            flat.append(float(one))
        elif isinstance(one, tuple):
            words.append("(")
            pack(one, words, flat)
            words.append(")")
        else:
            raise TypeError(f"a kernel takes numbers, arrays and tuples of them, not {one!r}")


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
