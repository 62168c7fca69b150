"""Record: what a session knows, and the one file that holds it.

    session/
      session.json      setup, and every trial: what the plunger was told, and each print of it as measured
      trial-00.gcode    to be printed; made again from session.json whenever it is missing
      trial-01.gcode

`session.json` is replaced whole, and last: a command that dies before that has changed nothing that counts, and is
simply called again. Everything else follows from it: the learner is run over its trials anew by every command
(`session.replay`), with the signals that were printed, whatever a newer version would have planned.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine, machine_from_table
from gcodectl.errors import InputError, UsageError
from gcodectl.learn.reference import Routine
from gcodectl.session.layout import Layout
from gcodectl.session.printout import Printout
from gcodectl.version import VERSION

FORMAT, FORMAT_VERSION = "gcodectl-session", 2
READ = (1, 2)
"""Versions that are read; 1 knows no weights."""
NAME = "session.json"
DIGITS = 7
"""Decimal places, as shares of the nominal flow, that signals and measurements are kept to."""


@dataclasses.dataclass(frozen=True)
class Setup:
    """What is fixed when a session starts."""

    material: str
    nozzle: float
    """mm"""
    routine: Routine
    printout: Printout
    max_trials: int
    """Learning stops there at the latest."""
    date: str
    guess: str = ""
    """What trial 0 came from, where it was not the flow asked for."""
    plant: str = ""
    """Simulated sessions: what played the printer's part."""
    density: float = 0.0
    """g/cm^3, of what is weighed; 0: none is known."""


@dataclasses.dataclass(frozen=True)
class Weight:
    """What a scale showed, g, and the finest step that it shows, g."""

    grams: float
    readability: float

    def __str__(self) -> str:
        """The reading, with all its digits."""
        return f"{self.grams:.{max(0, -math.floor(math.log10(self.readability) + 1e-9))}f} g"


@dataclasses.dataclass(frozen=True)
class Print:
    """One print of a trial, measured."""

    source: str
    q: Floats
    """On the routine's samples, as measured whatever it weighs, mm^3/s."""
    delay: float
    """How late it comes after the plunger, its lag aside, s."""
    faults: tuple[str, ...] = ()
    """What is wrong with it, where it was taken all the same."""
    notes: tuple[str, ...] = ()
    """What there is to say of how it was measured."""
    way: str = ""
    """How it was measured: `photo`, or as `Series.kind`; none in sessions of version 1."""
    weight: Weight | None = None
    """Of all that the print laid, where it was weighed."""
    beside: float = 0.0
    """What of that lies beside the path, over what lies on it; see `session.weighing`."""
    beside_sigma: float = 0.0
    """Its standard error."""


@dataclasses.dataclass(frozen=True)
class Trial:
    """One trial: its signal, and the prints of it that count."""

    number: int
    u: Floats
    """On the routine's samples, mm^3/s."""
    prints: tuple[Print, ...] = ()
    dropped: tuple[str, ...] = ()
    """Sources of prints that do not count any more."""

    @property
    def file(self) -> str:
        """Name of its G-code."""
        return f"trial-{self.number:02}.gcode"

    @property
    def q(self) -> Floats:
        """The mean of its prints, mm^3/s."""
        return np.asarray(np.mean([one.q for one in self.prints], axis=0), dtype=np.float64)


@dataclasses.dataclass(frozen=True)
class Session:
    """A setup and its trials; the last one may still wait for its measurement."""

    setup: Setup
    trials: tuple[Trial, ...]

    @property
    def measured(self) -> tuple[Trial, ...]:
        """Trials with a print that counts."""
        return tuple(one for one in self.trials if one.prints)

    @property
    def waiting(self) -> Trial | None:
        """The trial that waits for its measurement: trial 0 before all, else the last one; None where neither does."""
        return next((one for one in (self.trials[0], self.trials[-1]) if not one.prints), None)

    def trial(self, number: int) -> Trial:
        """Return a trial; UsageError where there is none of that number."""
        if not 0 <= number < len(self.trials):
            raise UsageError(f"there is no trial {number} in this session: it has 0 to {len(self.trials) - 1}")
        return self.trials[number]

    def with_trial(self, one: Trial) -> Session:
        """Return the session with `one` in place of the trial of its number, or as the next one."""
        kept = tuple(one if other.number == one.number else other for other in self.trials)
        return dataclasses.replace(self, trials=kept if one.number < len(kept) else (*kept, one))


def rounded(values: Floats, flow: float) -> Floats:
    """Return signals or measurements (mm^3/s) as they are kept, at a nominal flow (mm^3/s)."""
    scale = 10.0 ** (DIGITS - math.ceil(math.log10(flow)))
    return np.asarray(np.round(values * scale) / scale + 0.0, dtype=np.float64)  # no -0.0


def save(session: Session, folder: Path) -> None:
    """Replace the folder's session by this one, whole."""
    setup = session.setup
    table = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "gcodectl": VERSION,
        "setup": _plain(dataclasses.asdict(setup)),
        "trials": [_plain(dataclasses.asdict(one)) for one in session.trials],
    }
    beside = folder / f".{NAME}.{os.getpid()}.part"
    try:
        with beside.open("w", encoding="utf-8") as file:
            json.dump(table, file, allow_nan=False)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(folder / NAME)
    finally:
        beside.unlink(missing_ok=True)


def load(folder: Path) -> Session:
    """Read the session in a folder; InputError where there is none, or one that this gcodectl cannot read."""
    path = folder / NAME
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError("holds no session: begin one with `gcodectl learn start`", source=str(folder)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", source=str(path)) from error
    try:
        table = json.loads(text)
        if not isinstance(table, dict) or table.get("format") != FORMAT:
            raise InputError("is not a learning session of gcodectl", source=str(path))
        if table.get("version") not in READ:
            raise InputError(
                f"is a session of format {table.get('version')} (gcodectl {table.get('gcodectl', '?')}), and this "
                f"gcodectl {VERSION} reads formats 1 and {FORMAT_VERSION}: go on with the version that began it; "
                "nothing was changed", source=str(path),
            )  # fmt: skip
        made = Session(_setup(table["setup"]), tuple(_trial(one) for one in table["trials"]))
        _whole(made)
        return made
    except (ValueError, KeyError, TypeError, AttributeError, UsageError) as error:
        raise InputError(f"is damaged: {error}; nothing was changed", source=str(path)) from error


def _plain(value: Any) -> Any:
    """Return JSON values: arrays as lists."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return value


def _whole(session: Session) -> None:
    """Raise ValueError where a trial is not the session's."""
    samples = len(session.setup.routine.t)
    for place, one in enumerate(session.trials):
        if one.number != place:
            raise ValueError(f"trial {one.number} stands where trial {place} should")
        for row in (one.u, *(each.q for each in one.prints)):
            if row.shape != (samples,):
                raise ValueError(f"trial {place} has {row.size} samples, and its routine {samples}")
            if not np.isfinite(row).all():
                raise ValueError(f"trial {place} has samples that are no numbers")


def _setup(table: dict[str, Any]) -> Setup:
    routine = dict(table["routine"])
    routine["corner"] = tuple(routine["corner"])
    routine["more"] = tuple(tuple(one) for one in routine["more"])
    printout = dict(table["printout"])
    layout = dict(printout["layout"])
    speed = float(layout.pop("speed"))
    places = {name: np.array(value, dtype=np.float64) for name, value in layout.items()}
    made = Printout(**{**printout, "machine": _machine(printout["machine"]), "layout": Layout(**places, speed=speed)})
    return Setup(**{**table, "routine": Routine(**routine), "printout": made})


def _machine(table: dict[str, Any]) -> Machine:
    return machine_from_table({name: float(value) if type(value) is int else value for name, value in table.items()})


def _trial(table: dict[str, Any]) -> Trial:
    prints = tuple(_print(one) for one in table["prints"])
    return Trial(table["number"], np.array(table["u"]), prints, tuple(table["dropped"]))


def _print(table: dict[str, Any]) -> Print:
    made = Print(table["source"], np.array(table["q"]), table["delay"], tuple(table["faults"]), tuple(table["notes"]))
    if "way" not in table:  # version 1
        return made
    weight = None if table["weight"] is None else Weight(**table["weight"])
    return dataclasses.replace(made, way=table["way"], weight=weight, beside=float(table["beside"]),
                               beside_sigma=float(table["beside_sigma"]))  # fmt: skip
