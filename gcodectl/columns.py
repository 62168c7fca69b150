"""Columns: many alike things as equal-length, read-only arrays; what the records are built on.

A subclass is a frozen dataclass whose fields are made with `column(dtype)`; axis 0 of every field is the row. Rows are
taken with slices, masks or index arrays, and joined with `concat`. `TextColumns` adds the bytes of the lines: one
shared buffer that `start` and `end` point into, so that a raw line rides along without a Python object a row.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import DTypeLike, NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
Bytes: TypeAlias = NDArray[np.uint8]
Rows: TypeAlias = slice | Ints | Bools


def column(dtype: DTypeLike, width: int = 0) -> Any:
    """Declare a column: its dtype, and its width where a row holds a vector."""
    return dataclasses.field(metadata={"dtype": np.dtype(dtype), "width": width})


def column_fields(cls: type) -> list[dataclasses.Field[Any]]:
    """Return the dataclass fields of `cls` that are columns."""
    return [field for field in dataclasses.fields(cls) if "dtype" in field.metadata]


_SHAPES: dict[type, dict[str, tuple[np.dtype[Any], int]]] = {}


def _shapes(cls: type) -> dict[str, tuple[np.dtype[Any], int]]:
    """Dtype and width (0: not a vector) of each column, by name; found once a class."""
    if cls not in _SHAPES:
        fields = column_fields(cls)
        _SHAPES[cls] = {field.name: (field.metadata["dtype"], field.metadata["width"]) for field in fields}
    return _SHAPES[cls]


def _locked(name: str, values: Any, dtype: np.dtype[Any], width: int) -> NDArray[Any]:
    """Return values as a column that nobody may write to."""
    array = values if type(values) is np.ndarray and values.dtype is dtype else np.asarray(values, dtype=dtype)
    assert array.ndim == (2 if width else 1), f"{name} has {array.ndim} dimensions"
    assert not width or array.shape[1] == width, f"{name} has width {array.shape[1]}, not {width}"
    if array.flags.writeable:  # what another record holds is locked already
        array = array.view()
        array.flags.writeable = False
    return array


@dataclasses.dataclass(frozen=True)
class Columns:
    """Equal-length read-only arrays; subclasses declare them with `column`."""

    def __post_init__(self) -> None:
        length = -1
        held = self.__dict__
        for name, (dtype, width) in _shapes(type(self)).items():
            held[name] = array = _locked(name, held[name], dtype, width)
            assert length in (-1, len(array)), f"{name} has {len(array)} rows, not {length}"
            length = len(array)

    def __len__(self) -> int:
        held = self.__dict__
        for name in _shapes(type(self)):  # the first will do
            return len(held[name])
        return 0

    def __getitem__(self, rows: Rows) -> Self:
        held = self.__dict__
        if not isinstance(rows, slice):
            return self._with({name: held[name][rows] for name in _shapes(type(self))})
        if rows.indices(length := len(self)) == (0, length, 1):
            return self
        return self._made({name: held[name][rows] for name in _shapes(type(self))})  # a view of what is locked is, too

    def _with(self, columns: dict[str, Any]) -> Self:
        """Return a copy with all columns exchanged for ones that are known to fit."""
        for array in columns.values():
            array.flags.writeable = False
        return self._made(columns)

    def _made(self, changes: dict[str, Any]) -> Self:
        made = object.__new__(type(self))
        made.__dict__.update(self.__dict__)
        made.__dict__.update(changes)
        return made

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some columns exchanged."""
        shapes, length = _shapes(type(self)), len(self)
        columns = {name: _locked(name, changes[name], *shapes[name]) for name in changes if name in shapes}
        if any(len(array) != length for array in columns.values()):
            return type(self)(**{**self.__dict__, **changes})
        return self._made({**changes, **columns})

    @classmethod
    def empty(cls, rows: int = 0) -> Self:
        """Return `rows` rows of zeros."""
        return cls(**cls.allocate(rows))

    @classmethod
    def allocate(cls, rows: int) -> dict[str, Any]:
        """Return writable zeroed arrays by field name, for a kernel to fill before the record is made of them."""
        return {
            name: np.zeros((rows, width) if width else rows, dtype) for name, (dtype, width) in _shapes(cls).items()
        }

    def taken(self, rows: Ints, behind: Self) -> dict[str, Any]:
        """Return writable columns by name: those of `behind`, then `rows` of these: one copy where two would do."""
        columns, begin = {}, len(behind)
        for name in _shapes(type(self)):
            source, before = self.__dict__[name], behind.__dict__[name]
            columns[name] = room = np.empty((begin + len(rows), *source.shape[1:]), dtype=source.dtype)
            room[:begin] = before
            np.take(source, rows, axis=0, out=room[begin:], mode="clip")  # any other mode fills a copy first
        return columns

    @classmethod
    def concat(cls, parts: Sequence[Self]) -> Self:
        """Join `parts` in order."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            return cls.empty()
        held = [part.__dict__ for part in parts]
        return parts[0]._with({name: np.concatenate([one[name] for one in held]) for name in _shapes(cls)})


@dataclasses.dataclass(frozen=True)
class TextColumns(Columns):
    """Columns whose rows are lines: `text[start:end]` is the raw line, its line ending included.

    `text` is shared by slices; `concat` keeps only the bytes that the rows still point at.
    """

    text: Bytes
    start: Ints = column(np.int64)
    end: Ints = column(np.int64)

    @classmethod
    def allocate(cls, rows: int) -> dict[str, Any]:
        """Return writable zeroed arrays by field name, and an empty text."""
        return {"text": np.zeros(0, dtype=np.uint8), **super().allocate(rows)}

    def raw(self, row: int) -> bytes:
        """Return the bytes of one row's line."""
        return self.text[self.start[row] : self.end[row]].tobytes()

    def taken(self, rows: Ints, behind: Self) -> dict[str, Any]:
        """As of all columns, with the text that they point into."""
        columns = super().taken(rows, behind)
        columns["text"] = self.text
        if len(behind):
            low, high = int(behind.start.min()), int(behind.end.max())
            columns["text"] = np.concatenate([behind.text[low:high], self.text])
            for name in ("start", "end"):
                columns[name][: len(behind)] -= low
                columns[name][len(behind) :] += high - low
        return columns

    @classmethod
    def concat(cls, parts: Sequence[Self]) -> Self:
        """Join `parts` in order, and their texts."""
        if len(parts) == 1:
            return parts[0]
        held = [part for part in parts if len(part)]
        if len(held) <= 1:
            return held[0] if held else cls.empty()
        low = [int(part.start.min()) for part in held]
        texts = [part.text[begin : int(part.end.max())] for part, begin in zip(held, low, strict=True)]
        shifts = np.cumsum([0, *(len(text) for text in texts[:-1])]) - low
        joined = super().concat(held)
        ends = {
            name: np.concatenate([getattr(part, name) + shift for part, shift in zip(held, shifts, strict=True)])
            for name in ("start", "end")
        }
        return joined.replace(text=np.concatenate(texts), **ends)
