"""The bench's own parts: each sets one difficulty apart, drawn for any machine, some 15 to 60 s of it.

    short_travels  raster, the next row a bead away       dots       roads of 2 mm, apart
    spiral         one road without an end in sight       zigzag     a tip of 170 degrees every few mm
    mixed_speeds   the same bead at 0.4 to 1.4 of speed   two_tools  squares of one material in rings of another
    star           ten edges, three rings of it           dashes     roads from 1.5 to 24 mm, gaps as long
    islands        small squares, retracted in between    comb       long and short teeth, corners of 90 degrees

Lengths are those of a syringe; `Style.size` stretches them for a wider bead. Nothing here is tuned to anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from plant_models.parts import Pen, Style, fig9_gcode, tic_tac_toe_gcode

RETRACTED = 0.5
"""Seconds of nominal flow that `islands` retracts."""


def _begun(style: Style, name: str) -> Pen:
    pen = Pen(style, name)
    pen.go(20, 20)
    pen.wait(1)
    return pen


def _ended(pen: Pen) -> bytes:
    pen.go(10, 10)
    pen.wait(1)
    return pen.text()


def short_travels(style: Style) -> bytes:
    """Return a raster of 10 rows that are not joined: the travel from row to row is as short as the bead is wide."""
    pen = _begun(style, "raster with short travels")
    for row in range(10):
        ends = (20, 45) if row % 2 == 0 else (45, 20)
        pen.go(ends[0], (20 + 1.2 * row))
        pen.line(ends[1], (20 + 1.2 * row))
    return _ended(pen)


def dots(style: Style) -> bytes:
    """Return 30 roads of 2 mm, 6 mm apart."""
    pen = _begun(style, "dots")
    for number in range(30):
        x, y = (20 + 6 * (number % 6)), (20 + 6 * (number // 6))
        pen.go(x, y)
        pen.line(x + 2, y)
    return _ended(pen)


def spiral(style: Style) -> bytes:
    """Return one road that winds outward five times, in short pieces as slicers write a curve."""
    pen = _begun(style, "spiral")
    angle = math.pi
    first = True
    while angle < 12 * math.pi:
        radius = 0.45 * angle
        x, y = 45 + radius * math.cos(angle), 45 + radius * math.sin(angle)
        if first:
            pen.go(x, y)
            first = False
        else:
            pen.line(x, y)
        angle += 1.2 / radius
    return _ended(pen)


def zigzag(style: Style) -> bytes:
    """Return two roads of sharp corners, legs of 12 mm and of 5 mm."""
    pen = _begun(style, "zig-zag")
    for y0, leg, step, count in ((20, 12, 1.5, 14), (40, 5, 1.2, 20)):
        pen.go(20, y0)
        for corner in range(count):
            pen.line((20 + step * (corner + 1)), (y0 + (leg if corner % 2 == 0 else 0)))
    return _ended(pen)


def mixed_speeds(style: Style) -> bytes:
    """Return rings and rows of one bead at many speeds, within a road and from road to road."""
    pen = _begun(style, "mixed speeds")
    paces = (1.0, 0.4, 0.7, 1.4, 0.5, 1.2, 0.85, 1.0, 0.4, 1.4)
    for ring in range(2):
        low, high = (20 + 4 * ring), (40 - 4 * ring)
        pen.go(low, low)
        for side, (x, y) in enumerate(((high, low), (high, high), (low, high), (low, low))):
            pen.line(x, y, paces[(4 * ring + side) % len(paces)])
    for row, pace in enumerate(paces[:6]):
        pen.go(20, (46 + 2 * row))
        pen.line(32, (46 + 2 * row), pace)
        pen.line(40, (46 + 2 * row), 1.4 - 0.7 * pace)
    return _ended(pen)


def two_tools(style: Style) -> bytes:
    """Return two layers' worth of squares of material 0 in rings of material 1."""
    pen = _begun(style, "two materials")
    for tool in (0, 1, 0, 1):
        pen.tool(tool)
        for square in range(2):
            x0, y0, side = (20 + 20 * square), 20, (8 if tool == 0 else 12)
            x0, y0 = (x0 + 2, y0 + 2) if tool == 0 else (x0, y0)
            pen.go(x0, y0)
            for x, y in ((x0 + side, y0), (x0 + side, y0 + side), (x0, y0 + side), (x0, y0)):
                pen.line(x, y)
    return _ended(pen)


def star(style: Style) -> bytes:
    """Return three rings of a star with five tips, corners of 36 and of 108 degrees."""
    pen = _begun(style, "star")
    for ring in range(3):
        outer, inner = (15 - 2.5 * ring), (7 - 1.2 * ring)
        for corner in range(11):
            radius, angle = (outer if corner % 2 == 0 else inner), corner * math.pi / 5
            x, y = 40 + radius * math.sin(angle), 40 + radius * math.cos(angle)
            pen.go(x, y) if corner == 0 else pen.line(x, y)
    return _ended(pen)


def dashes(style: Style) -> bytes:
    """Return rows of dashes from 1.5 to 24 mm, each followed by a gap of 1 to 12 mm."""
    pen = _begun(style, "dashes")
    lengths, gaps = (24.0, 3.0, 12.0, 1.5, 6.0), (1.0, 12.0, 2.0, 6.0, 1.0)
    for row in range(4):
        x, y = 20.0, 20.0 + 3 * row
        for number in range(5):
            length, gap = lengths[(number + row) % 5], gaps[(number + 2 * row) % 5]
            pen.go(x, y)
            pen.line(x + length, y)
            x += length + gap
    return _ended(pen)


def islands(style: Style) -> bytes:
    """Return nine small squares of 5 mm, the slicer's retraction around every travel."""
    pen = _begun(style, "islands")
    for number in range(9):
        x0, y0 = (20 + 12 * (number % 3)), (20 + 12 * (number // 3))
        pen.go(x0, y0)
        if number:
            pen.push(RETRACTED * style.flow)
        for x, y in ((x0 + 5, y0), (x0 + 5, y0 + 5), (x0, y0 + 5), (x0, y0)):
            pen.line(x, y)
        pen.push(-RETRACTED * style.flow)
    return _ended(pen)


def comb(style: Style) -> bytes:
    """Return one road of right-angled teeth, long and short by turns."""
    pen = _begun(style, "comb")
    x = 20.0
    pen.go(x, 20)
    for tooth in range(8):
        height = 20 + (14 if tooth % 2 == 0 else 4)
        for to in ((x, height), (x + 2, height), (x + 2, 20), (x + 4, 20)):
            pen.line(*to)
        x += 4
    return _ended(pen)


DRAWN: Mapping[str, Callable[[Style], bytes]] = MappingProxyType(
    {
        "fig9": fig9_gcode,
        "tic-tac-toe": tic_tac_toe_gcode,
        "short-travels": short_travels,
        "dots": dots,
        "spiral": spiral,
        "zigzag": zigzag,
        "mixed-speeds": mixed_speeds,
        "two-tools": two_tools,
        "star": star,
        "dashes": dashes,
        "islands": islands,
        "comb": comb,
    }
)
"""Every part that is drawn here or in `plant_models.parts`, by name."""
