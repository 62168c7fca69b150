"""Headings: which column of a measured table is what, and in which unit.

`t`, `t [ms]`, `time (s)`, `width_um`, `Flow Rate [ml/min]`: a quantity's name, and its unit in brackets or behind an
underscore; without one, s, mm, mm^2, mm^3/s. Case, `^`, `µ` and superscripts do not matter.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from gcodectl.errors import InputError

LENGTHS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "in": 25.4}
UNITS: Mapping[str, Mapping[str, float]] = {
    "t": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "q": {
        "mm3/s": 1.0, "mm3/min": 1.0 / 60.0, "ul/s": 1.0, "ul/min": 1.0 / 60.0, "ml/s": 1000.0,
        "ml/min": 1000.0 / 60.0, "cm3/s": 1000.0, "cm3/min": 1000.0 / 60.0,
    },
    "s": LENGTHS,
    "width": LENGTHS,
    "height": LENGTHS,
    "area": {f"{unit}2": factor**2 for unit, factor in LENGTHS.items()},
}  # fmt: skip
"""What a quantity may be given in, and how much of ours that is."""
NAMES: Mapping[str, tuple[str, ...]] = {
    "t": ("t", "time"),
    "q": ("q", "flow", "flow rate", "flowrate"),
    "s": ("s", "place", "position", "distance", "path", "arc length"),
    "width": ("width", "w", "road width", "bead width", "line width"),
    "height": ("height", "h", "bead height", "road height"),
    "area": ("area", "cross section", "bead", "bead area"),
}
PAIRS = (("t", "q"), ("s", "area"), ("s", "width"))
"""What a table may hold."""
WANTED = "name two columns: t,q (s, mm^3/s), s,area (mm, mm^2) or s,width (mm, mm), units as in `t [ms]`"
_BRACKETS = re.compile(r"^(.*?)\s*[\[(](.*)[\])]\s*$")


def read_headings(cells: list[str], source: str, line: int) -> dict[str, tuple[int, float]]:
    """Return each quantity's column and how much of ours one of its unit is; InputError says what is missing."""
    found: dict[str, tuple[int, float]] = {}
    for column, cell in enumerate(cells):
        quantity, unit = _split(cell)
        if quantity is None:
            continue
        if quantity in found:
            raise InputError(f"has two columns of {quantity}: keep one", source=source, line=line, text=",".join(cells))
        units = UNITS[quantity]
        if unit and unit not in units:
            raise InputError(
                f"gives {quantity} in {unit!r}, which is not known: use one of {', '.join(units)}", source=source,
                line=line, text=",".join(cells),
            )  # fmt: skip
        found[quantity] = column, units[unit] if unit else 1.0
    if not any(set(pair) <= set(found) for pair in PAIRS):
        seen = f"only {', '.join(found)} of them" if found else "none of them"
        raise InputError(f"has {seen}: {WANTED}", source=source, line=line, text=",".join(cells))
    return found


def _split(cell: str) -> tuple[str | None, str]:
    """Return the quantity that a heading names, None for another one, and the unit it gives."""
    text = cell.strip().strip('"').lower()
    if brackets := _BRACKETS.match(text):
        return _quantity(brackets[1]), _unit(brackets[2])
    if (whole := _quantity(text)) is not None:
        return whole, ""
    words = text.split("_")
    for split in range(len(words) - 1, 0, -1):
        quantity, unit = _quantity(" ".join(words[:split])), _unit("/".join(words[split:]))
        if quantity is not None and unit in UNITS[quantity]:
            return quantity, unit
    return None, ""


def _quantity(text: str) -> str | None:
    plain = re.sub(r"[\s_-]+", " ", text).strip()
    return next((quantity for quantity, names in NAMES.items() if plain in names), None)


def _unit(text: str) -> str:
    plain = text.strip().replace("µ", "u").replace("μ", "u").replace("²", "2").replace("³", "3")
    return re.sub(r"\s*per\s*|\s*/\s*", "/", plain).replace("^", "").replace(" ", "")
