"""Printout: a trial as G-code, in the machine's own dialect.

    begin | datum at steady flow | rest | lifted, to the set-off | path: E as the trial's signal says | end
                                   5 lags or more                  ^ the routine's first sample

The head travels LIFT above what is laid: at its height it would carry the datum's end along.

The path is written without E, and the signal is laid over it as over any other file (`session.laying`): E then keeps to
what the firmware allows, and comes when the plan says that the head is there.
"""

from __future__ import annotations

import dataclasses

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.errors import InputError
from gcodectl.pipeline import Options
from gcodectl.session.laying import lay
from gcodectl.session.layout import Layout

BEGIN = "G28"
END = ""
REST, REST_LAGS = 15.0, 5.0
"""The head rests so many seconds, or lags, behind the datum."""
LIFT = 5.0
"""mm above the bead, while it travels."""
TRAVEL = 0.5
"""Share of the machine's fastest that it travels at."""


@dataclasses.dataclass(frozen=True)
class Printout:
    """What is the same for all trials of a session."""

    machine: Machine
    layout: Layout
    flow: float
    """Of the datum, mm^3/s."""
    height: float
    """Of the nozzle above the bed, mm."""
    lag: float
    begin: str = BEGIN
    """G-code before the machine is known to be ready: homing, heating."""
    end: str = END

    @property
    def rest(self) -> float:
        """Seconds that the head rests behind the datum."""
        return max(REST, REST_LAGS * self.lag)

    def base(self, title: str) -> tuple[bytes, int, int]:
        """Return the file without its signal, and its lines, from 1, that begin and end the path."""
        layout, machine = self.layout, self.machine
        fast = TRAVEL * min(machine.max_speed[:2]) * 60.0
        up = self.height + LIFT
        z = f"G1 Z{{:.3f}} F{TRAVEL * machine.max_speed[2] * 60.0:.0f}"
        speed = f"F{layout.speed * 60.0:.3f}"
        e = self.flow * layout.datum_lasts / machine.area
        lines = [
            *(f"; {line}" for line in title.splitlines()), *self.begin.splitlines(), "G21", "G90", "M83",
            z.format(up), f"G1 {_xy(layout.datum[0])} F{fast:.0f}", z.format(self.height),
            "; the datum: places are counted from its middle line", f"G1 {_xy(layout.datum[1])} E{e:.6f} {speed}",
            "; rest until nothing flows, and lift off", f"G4 P{self.rest * 1000.0:.0f}", z.format(up),
            f"G1 {_xy(layout.set_off)} F{fast:.0f}", z.format(self.height), f"G1 {_xy(layout.path[0])} {speed}",
        ]  # fmt: skip
        first = len(lines) + 1
        lines += [f"G1 {_xy(point)}" for point in layout.path[1:]]
        last = len(lines)
        lines += [f"G1 {_xy(point)}" for point in layout.run_out]
        lines += ["; away from it", z.format(up + LIFT), *self.end.splitlines()]
        return ("\n".join(lines) + "\n").encode(), first, last

    def gcode(self, title: str, u: Floats, dt: float) -> bytes:
        """Return the trial's file; `u` (n samples of dt s, mm^3/s) begins with the path."""
        data, first, last = self.base(title)
        options = Options(self.machine, source="the begin and end of the trial")
        laid = lay(data, options, u, dt, (first, last))
        slow = laid.lasts / (self.layout.length / self.layout.speed)
        if not 0.99 < slow < 1.01:
            raise InputError(
                f"the machine takes {slow:.2f} times as long for the path as its speed says: `begin` may set a feed "
                "rate factor, or accelerations, that the profile does not know; set them back there"
            )
        if laid.flow_factor != 1.0:
            raise InputError(
                f"the G-code before the trial sets the flow to {100 * laid.flow_factor:g} % (M221), which would be "
                "learned as the material's: leave it out there, or set it back with M221 S100"
            )
        return laid.data


def _xy(point: Floats) -> str:
    return f"X{point[0]:.3f} Y{point[1]:.3f}"
