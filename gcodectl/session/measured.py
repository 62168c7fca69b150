"""Measured: a table of what was measured of a print, and the flow over time that it tells.

    t,q        a flow sensor, or scales: s since the path's begin
    s,area     a bead's cross-section along the path, mm from its begin        q = area x speed, t = s / speed
    s,width    its width, as a camera sees it; its height is the nozzle's, unless a column tells it

A bead of width w and height h is taken as slicers take it: flat, with round sides,

    area = (w - h) h + pi h^2 / 4   for w > h,   else pi w^2 / 4

Source: Slic3r's manual, "Flow Math".
"""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path

import numpy as np

from gcodectl.columns import Floats, Ints
from gcodectl.errors import InputError
from gcodectl.session.headings import PAIRS, WANTED, read_headings

DELIMITERS = (";", "\t", ",")
FEWEST = 20


@dataclasses.dataclass(frozen=True)
class Series:
    """One measured quantity over another."""

    kind: str
    """`t,q`, `s,area` or `s,width`."""
    x: Floats
    """s or mm, shape (n,); NaN where a cell is empty."""
    y: Floats
    """mm^3/s, mm^2 or mm."""
    height: Floats | None = None
    """Of the bead, mm, where the table tells it."""
    line: Ints = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """Of each row in the file; none for what is not from a file."""
    source: str = ""
    notes: tuple[str, ...] = ()
    """What there is to say of how it was measured."""
    by: str = ""
    """What measured it, where that is not a table."""

    @property
    def way(self) -> str:
        """How it was measured: what is wrong with one print is wrong with all that were measured the same way."""
        return self.by or (self.kind if self.height is None else f"{self.kind},height")

    def flow(self, speed: float, height: float) -> tuple[Floats, Floats]:
        """Return times (s) and flow (mm^3/s) of a path at `speed` mm/s with the nozzle at `height` mm."""
        if self.kind == "t,q":
            return self.x, self.y
        area = self.y if self.kind == "s,area" else area_of(self.y, height if self.height is None else self.height)
        return self.x / speed, area * speed


def area_of(width: Floats, height: Floats | float) -> Floats:
    """Return the cross-section (mm^2) of a bead of that width and height, mm."""
    flat = (width - height) * height + math.pi * np.square(height) / 4.0
    return np.asarray(np.where(width > height, flat, math.pi * np.square(width) / 4.0), dtype=np.float64)


def width_of(area: Floats, height: float) -> Floats:
    """Return the width (mm) of a bead of that cross-section (mm^2) and height, mm: the other way round."""
    round_one = math.pi * height**2 / 4.0
    flat = (area - round_one) / height + height
    return np.where(area > round_one, flat, np.sqrt(4.0 * np.maximum(area, 0.0) / math.pi))


def read_measured(path: Path) -> Series:
    """Read a CSV file; InputError names the line, what is wrong with it and what would be right."""
    source = str(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError("there is no such file", source=source) from None
    except UnicodeDecodeError as error:
        raise InputError(f"cannot be read as a table: {error}; save it as CSV in UTF-8", source=source) from error
    except OSError as error:
        raise InputError(f"cannot be read as a table: {error.strerror}", source=source) from error
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    if not lines:
        raise InputError(f"is empty: {WANTED}", source=source)
    number, head = lines[0]
    delimiter = next((one for one in DELIMITERS if one in head), ",")
    cells = next(csv.reader([head], delimiter=delimiter))
    if all(_number(cell) is not None for cell in cells):
        raise InputError(f"has no heading: {WANTED}", source=source, line=number, text=head)
    found = read_headings(cells, source, number)
    pairs = [pair for pair in PAIRS if set(pair) <= set(found)]
    if len(pairs) > 1:
        said = " and ".join(",".join(pair) for pair in pairs)
        raise InputError(f"has {said}: keep one pair", source=source, line=number, text=head)
    rows = [_row(line, delimiter, len(cells), found, source, at) for at, line in lines[1:]]
    if len(rows) < FEWEST:
        raise InputError(f"has {len(rows)} rows of numbers: at least {FEWEST} are needed", source=source)
    table = {name: np.array([row[name] for row in rows]) for name in found}
    first, second = pairs[0]
    line_of = np.array([at for at, _ in lines[1:]], dtype=np.int64)
    series = Series(f"{first},{second}", table[first], table[second], table.get("height"), line_of, source)
    _ordered(series)
    return series


def _row(
    line: str, delimiter: str, headings: int, found: dict[str, tuple[int, float]], source: str, number: int
) -> dict[str, float]:
    """Return what a line gives for each quantity, in our units; NaN where its cell is empty; width: or its height's."""

    def wrong(what: str) -> InputError:
        return InputError(what, source=source, line=number, text=line)

    try:
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except csv.Error as error:
        raise wrong(f"is no row of a table: {error}") from error
    if any(cells[headings:]):
        raise wrong(f"has {len(cells)} cells under {headings} headings: where numbers have decimal commas, part them "
                    "by semicolons")  # fmt: skip
    row = {}
    for name, (column, factor) in found.items():
        cell = cells[column] if column < len(cells) else ""
        value = math.nan if not cell else _number(cell)
        if value is None:
            raise wrong(f"has {cell!r} where {name} should be a number: leave the cell empty where nothing was seen")
        if name in ("width", "height") and value < 0.0:
            raise wrong(f"{name} is {value:g}: no road is smaller than nothing; leave the cell empty where nothing was "
                        "seen")  # fmt: skip
        row[name] = value * factor
    if math.isnan(row.get("height", 0.0)) and row.get("width"):  # without a road, there is no height to measure
        row["width"] = math.nan
    return row


def _number(cell: str) -> float | None:
    try:
        return float(cell.strip().replace(",", "."))
    except ValueError:
        return None


def _ordered(series: Series) -> None:
    """Raise InputError where what should only grow falls back."""
    first, second = series.kind.split(",")
    known = np.flatnonzero(np.isfinite(series.x))
    back = np.flatnonzero(np.diff(series.x[known]) < 0)
    if not len(back):
        return
    y = series.y[np.isfinite(series.y)]
    if len(y) > 1 and (np.diff(y) > 0).all():
        raise InputError(
            f"has {first} going up and down and {second} growing all the time: the columns look swapped: rename them",
            source=series.source,
        )
    at = known[back[0] + 1]
    what = "time runs backwards" if first == "t" else "the place goes back"
    raise InputError(
        f"{what}: {first} is {series.x[at]:g} after {series.x[known[back[0]]]:g}; put the rows in order, or cut off "
        "what belongs to another measurement", source=series.source, line=int(series.line[at]),
    )  # fmt: skip
