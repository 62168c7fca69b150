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


@dataclasses.dataclass(frozen=True)
class Columns:
    """Equal-length read-only arrays; subclasses declare them with `column`."""

    def __post_init__(self) -> None:
        length = -1
        for field in column_fields(type(self)):
            array = np.asarray(getattr(self, field.name), dtype=field.metadata["dtype"])
            width = field.metadata["width"]
            assert array.ndim == (2 if width else 1), f"{field.name} has {array.ndim} dimensions"
            assert not width or array.shape[1] == width, f"{field.name} has width {array.shape[1]}, not {width}"
            assert length in (-1, len(array)), f"{field.name} has {len(array)} rows, not {length}"
            length = len(array)
            array = array.view()
            array.flags.writeable = False
            object.__setattr__(self, field.name, array)

    def __len__(self) -> int:
        return len(getattr(self, column_fields(type(self))[0].name))

    def __getitem__(self, rows: Rows) -> Self:
        return self.replace(**{field.name: getattr(self, field.name)[rows] for field in column_fields(type(self))})

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some columns exchanged."""
        return dataclasses.replace(self, **changes)

    @classmethod
    def empty(cls, rows: int = 0) -> Self:
        """Return `rows` rows of zeros."""
        return cls(**cls.allocate(rows))

    @classmethod
    def allocate(cls, rows: int) -> dict[str, Any]:
        """Return writable zeroed arrays by field name, for a kernel to fill before the record is made of them."""
        shapes = {field.name: field.metadata for field in column_fields(cls)}
        return {
            name: np.zeros((rows, meta["width"]) if meta["width"] else rows, dtype=meta["dtype"])
            for name, meta in shapes.items()
        }

    @classmethod
    def concat(cls, parts: Sequence[Self]) -> Self:
        """Join `parts` in order."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            return cls.empty()
        joined = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in column_fields(cls)
        }
        return parts[0].replace(**joined)


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

    def trim(self) -> Self:
        """Return the same rows over a copy of just the bytes between the first and the last of them."""
        if not len(self):
            return self.replace(text=np.zeros(0, dtype=np.uint8))
        low, high = int(self.start.min()), int(self.end.max())
        return self.replace(text=self.text[low:high].copy(), start=self.start - low, end=self.end - low)

    @classmethod
    def concat(cls, parts: Sequence[Self]) -> Self:
        """Join `parts` in order, and their texts."""
        if len(parts) == 1:
            return parts[0]
        trimmed = [part.trim() for part in parts if len(part)]
        if not trimmed:
            return cls.empty()
        shifts = np.cumsum([0, *(len(part.text) for part in trimmed[:-1])])
        moved = [
            part.replace(start=part.start + shift, end=part.end + shift)
            for part, shift in zip(trimmed, shifts, strict=True)
        ]
        joined = super().concat(moved)
        return joined.replace(text=np.concatenate([part.text for part in trimmed]))
