"""Two parts of the paper as G-code, written here: three lines with two corners (Fig. 9), and tic-tac-toe (Fig. 11).

    Fig. 9     ________         tic-tac-toe      |   |  O     lines cross; an O is one arc (G3), an X two chevrons
                       |                       __|___|__      that meet at their tips, so that there are corners;
                       |                         | X |        nothing is connected, so that flow starts and stops
               ________|                       __|___|__      at every one
                                               O |   |

E is absolute, in mm of the barrel; the bead is flow / speed everywhere.
"""

from __future__ import annotations

import dataclasses
import math

from gcodectl.config import Machine

CELL = 20.0
"""Side of a tic-tac-toe cell, mm."""
PUSHED = 4.0
"""How fast E moves alone, as a multiple of the nominal flow."""


@dataclasses.dataclass(frozen=True)
class Style:
    """How the parts are printed."""

    barrel_diameter: float = 15.8
    """mm"""
    flow: float = 5.0
    """mm^3/s at full speed."""
    speed: float = 10.0
    """mm/s while depositing."""
    travel: float = 15.0
    """mm/s in between."""
    height: float = 0.6
    """mm"""
    size: float = 1.0
    """Factor on all lengths that are drawn, for a wider bead."""

    @classmethod
    def of(cls, machine: Machine, flow: float) -> Style:
        """Return the style for a machine's barrel and a flow, mm^3/s."""
        return cls(barrel_diameter=machine.barrel_diameter, flow=flow)


class Pen:
    """Writes G-code as it draws, E absolute; what is drawn is stretched by the style's size."""

    def __init__(self, style: Style, name: str) -> None:
        self.style = style
        self.e, self.x, self.y = 0.0, 0.0, 0.0
        self.lines = [f"; {name}", "G21", "G90", "M82", "G28", "G92 E0", f"G0 Z{style.height:g} F600"]

    def go(self, x: float, y: float) -> None:
        """Travel."""
        self.x, self.y = x, y
        self.lines.append(f"G0 {self._place()} F{self.style.travel * 60:g}")

    def line(self, x: float, y: float, pace: float = 1.0) -> None:
        """Deposit the same bead in a straight line, at `pace` times the speed."""
        self._feed(math.hypot(x - self.x, y - self.y))
        self.x, self.y = x, y
        self.lines.append(f"G1 {self._place()} E{self.e:.5f} F{self.style.speed * 60 * pace:g}")

    def push(self, volume: float) -> None:
        """Move E alone by `volume`, mm^3, a retraction where it is negative, at `PUSHED` times the nominal flow."""
        area = math.pi * self.style.barrel_diameter**2 / 4
        self.e += volume / area
        self.lines.append(f"G1 E{self.e:.5f} F{PUSHED * self.style.flow / area * 60:.4g}")

    def circle(self, radius: float) -> None:
        """Deposit a full circle, counter-clockwise, with its centre to the left of here (-X)."""
        self._feed(2 * math.pi * radius)
        words = f"{self._place()} I{-radius * self.style.size:.3f} J0"
        self.lines.append(f"G3 {words} E{self.e:.5f} F{self.style.speed * 60:g}")

    def tool(self, number: int) -> None:
        """Change to another tool, E from 0 again."""
        self.e = 0.0
        self.lines += [f"T{number}", "G92 E0"]

    def wait(self, seconds: float) -> None:
        """Stand still."""
        self.lines.append(f"G4 P{seconds * 1000:g}")

    def text(self) -> bytes:
        """Return the file."""
        return ("\n".join(self.lines) + "\n").encode()

    def _feed(self, length: float) -> None:
        area = math.pi * self.style.barrel_diameter**2 / 4
        self.e += length * self.style.size * self.style.flow / self.style.speed / area

    def _place(self) -> str:
        return f"X{self.x * self.style.size:.3f} Y{self.y * self.style.size:.3f}"


def fig9_gcode(style: Style | None = None) -> bytes:
    """Return three straight lines with two corners: No-Flow, Start, ..., Corner, ..., Corner, ..., Stop, No-Flow."""
    pen = Pen(style or Style(), "three lines with two corners")
    pen.go(30, 30)
    pen.wait(2)
    for x, y in ((70, 30), (70, 60), (30, 60)):
        pen.line(x, y)
    pen.go(30, 75)
    pen.wait(2)
    return pen.text()


def tic_tac_toe_gcode(style: Style | None = None) -> bytes:
    """Return a board of four lines, three circles and two crosses, none of them connected."""
    pen = Pen(style or Style(), "tic-tac-toe")
    left, low = 20.0, 20.0
    pen.go(left, low + CELL)
    pen.wait(2)
    for number in (1, 2):  # back and forth, so that travels are short
        ends = (left, left + 3 * CELL) if number == 1 else (left + 3 * CELL, left)
        pen.go(ends[0], low + number * CELL)
        pen.line(ends[1], low + number * CELL)
    for number in (1, 2):
        ends = (low + 3 * CELL, low) if number == 1 else (low, low + 3 * CELL)
        pen.go(left + number * CELL, ends[0])
        pen.line(left + number * CELL, ends[1])
    radius = 0.33 * CELL
    for column, row in ((2, 2), (0, 0), (2, 0)):
        pen.go(left + (column + 0.5) * CELL + radius, low + (row + 0.5) * CELL)
        pen.circle(radius)
    for column, row in ((1, 1), (0, 2)):
        _cross(pen, left + (column + 0.5) * CELL, low + (row + 0.5) * CELL, 0.33 * CELL)
    pen.go(10, 10)
    pen.wait(2)
    return pen.text()


def _cross(pen: Pen, x: float, y: float, half: float) -> None:
    """Draw an X as two chevrons, < above > so to say: their tips stay a bead apart."""
    apart = 0.5
    for side in (-1, 1):
        pen.go(x + side * (half + apart), y - half)
        pen.line(x + side * apart, y)
        pen.line(x + side * (half + apart), y + half)
