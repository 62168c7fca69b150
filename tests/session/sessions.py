"""Small sessions to test with, and a printer for them: the virtual machine and a plant."""

from __future__ import annotations

import numpy as np

from gcodectl.config import Machine, load_machine
from gcodectl.session.measured import Series
from gcodectl.session.record import Session
from gcodectl.session.steps import advance, begin, take
from plant_models.plant import load_plant
from plant_models.recorded import Recording, record

FLOW = 5.0


def session(machine: Machine | str = "syringe", **changes: object) -> Session:
    profile = load_machine(machine) if isinstance(machine, str) else machine
    words: dict[str, object] = {"material": "clay", "flow": FLOW, "gcode": ("G28", ""), "date": "2026-01-02"}
    return begin(profile, **(words | changes))  # type: ignore[arg-type]


def printed(now: Session, number: int = -1, plant: str = "linear") -> Recording:
    """Print a trial of the session on a plant with a lag of a second."""
    printout, trial = now.setup.printout, now.trials[number]
    data = printout.gcode("a trial", trial.u, now.setup.routine.dt)
    return record(data, printout.machine, load_plant(plant, flow=FLOW), printout.layout.path)


def areas(now: Session, number: int = -1, noise: float = 0.0, seed: int = 0, plant: str = "linear") -> Series:
    """What is measured of it, every 0.25 mm, white noise relative to the bead, another factor each print."""
    s, area = printed(now, number, plant).areas(0.25)
    rng = np.random.default_rng(seed)
    factor = 1.0 + noise * rng.normal() + noise * rng.normal(size=len(area))
    return Series("s,area", s, area * factor, source=f"print {seed}")


def learned(trials: int = 2) -> Session:
    """Return a session of so many measured trials, and one that waits where learning goes on."""
    now = session()
    for seed in range(trials):
        now, _ = advance(take(now, None, [areas(now, noise=0.02, seed=seed)]))
    return now
