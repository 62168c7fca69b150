"""A job against the virtual printer, for tests: what was executed, and how it ended."""

from __future__ import annotations

import dataclasses
from typing import Any

from gcodectl.config import load_machine
from gcodectl.link.dialect import Dialect
from gcodectl.link.host import Host
from gcodectl.link.job import BASE, Line
from gcodectl.link.settings import Settings
from plant_models.printer.duel import duel
from plant_models.printer.faults import parse_faults
from plant_models.printer.virtual import VirtualPrinter

MACHINE = load_machine("syringe")
STANDARD = Dialect()
OLD = Dialect(drop_repeats=False, ok_after_resend=False, emergency_parser=False)
ADVANCED = Dialect(advanced_ok=True)
HOT = b"M104 S200"


@dataclasses.dataclass
class Outcome:
    host: Host
    printer: VirtualPrinter
    took: float
    sent: list[bytes]

    @property
    def laid(self) -> list[bytes]:
        """The job's commands that were executed, in order."""
        return [one.text for one in self.printer.executed if one.text in set(self.sent)]

    @property
    def exact(self) -> bool:
        return self.laid == self.sent

    @property
    def cold(self) -> bool:
        """Whether no heater is on, or the printer has halted."""
        return not self.printer.alive or self.host.printer.cold


def job_of(count: int) -> list[Line]:
    """A job whose commands are all different, its heater on."""
    moves = [Line(i + 2, b"G1 X%d Y%.2f E%.3f" % (i, i % 7, i / 50)) for i in range(count)]
    return [Line(1, HOT), *moves]


def print_job(
    count: int,
    faults: str = "",
    *,
    dialect: Dialect = STANDARD,
    seed: int = 0,
    settings: Settings | None = None,
    **how: Any,
) -> Outcome:
    """Print `count` commands on a printer with faults; their lines are counted from 1, as in the job."""
    lines = job_of(count)
    shifted = ",".join(_shifted(one) for one in faults.split(",")) if faults else ""
    host = Host(lines, settings)
    printer = VirtualPrinter(MACHINE, dialect=dialect, faults=parse_faults(shifted), seed=seed)
    took = duel(host, printer, **how)
    return Outcome(host, printer, took, [line.command for line in lines])


def _shifted(fault: str) -> str:
    """Count a fault's line as the job does: the link's own four lines come before its first."""
    name, at, line = fault.partition("@")
    return f"{name}@{int(line) + BASE + 4}" if at else fault
