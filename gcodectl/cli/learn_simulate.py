"""`gcodectl learn simulate`: play the printer's part of a session, on a simulated plant."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from gcodectl.session.record import Session
    from plant_models.recorded import Recording

STEP = 0.25
"""Nozzles between two places that are measured."""
RATE = 0.02
"""s between two times."""


class Form(StrEnum):
    """What is measured."""

    FLOW = "t,q"
    AREA = "s,area"
    WIDTH = "s,width"


def simulate(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="Folder of the session.")],
    plant: Annotated[str, typer.Option(help="Extruder model: a name, or path/to/file.py:Attribute.")],
    trial: Annotated[int | None, typer.Option(help="Which trial to print (default: the one that waits).")] = None,
    form: Annotated[Form, typer.Option("--as", help="What is measured of the print.")] = Form.AREA,
    noise: Annotated[float, typer.Option(min=0, help="Camera noise, as a multiple of a measured one's; 0: none.")] = 0,
    seed: Annotated[int, typer.Option(help="Seed of all that is random; each print of a trial draws its own.")] = 0,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Default: beside the trial, as .csv.")] = None,
) -> None:
    """Print the trial that waits on the virtual machine and a plant, and write what a camera would measure."""
    from gcodectl.cli.common import write_whole
    from gcodectl.errors import InputError, UsageError
    from gcodectl.session.record import load, save
    from plant_models.plant import load_plant
    from plant_models.recorded import record

    now = load(session)
    waiting = [one.number for one in now.trials if not one.prints]
    if trial is None and not waiting:
        raise UsageError("no trial waits to be printed: learning has stopped; name one with --trial")
    one = now.trial(waiting[-1] if trial is None else trial)
    try:
        data = (session / one.file).read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}): `gcodectl learn status` writes it again",
                         source=str(session / one.file)) from error  # fmt: skip
    setup = now.setup
    machine = setup.printout.machine
    made = load_plant(plant, seed=seed, flow=None if plant.endswith(".py") or ".py:" in plant else setup.routine.flow)
    recorded = record(data, machine, made, setup.printout.layout.path)
    prints = len(one.prints) + len(one.dropped)
    path = output or (session / one.file).with_suffix(f".{prints}.csv" if prints else ".csv")
    write_whole(path, [_table(now, recorded, form, noise, (seed, one.number, prints))])
    save(_simulated(now, f"{plant}, seed {seed}, noise {noise:g}"), session)
    typer.echo(f"{path}: trial {one.number} on {plant}, seed {seed}, noise {noise:g}, as {form}")


def _simulated(session: Session, by: str) -> Session:
    """Return the session, which says for ever that its prints were simulated, and on what."""
    import dataclasses

    told = session.setup.plant.split("; ") if session.setup.plant else []
    plant = "; ".join(dict.fromkeys([*told, by]))
    return dataclasses.replace(session, setup=dataclasses.replace(session.setup, plant=plant))


def _table(session: Session, recorded: Recording, form: Form, noise: float, seed: tuple[int, ...]) -> bytes:
    """Return the CSV file; noise is relative, along the road."""
    import numpy as np

    from gcodectl.session.measured import width_of
    from plant_models.noise import ROAD_WIDTHS

    setup = session.setup
    speed, height = setup.printout.layout.speed, setup.printout.height
    x, y = recorded.means(RATE) if form is Form.FLOW else recorded.areas(STEP * setup.nozzle)
    if noise:
        places = x * speed if form is Form.FLOW else x
        y = y * np.maximum(1.0 + ROAD_WIDTHS.scaled(noise).along(places, np.random.default_rng(seed)), 0.0)
    if form is Form.WIDTH:
        y = width_of(y, height)
    heading = {Form.FLOW: "t [s],q [mm^3/s]", Form.AREA: "s [mm],area [mm^2]", Form.WIDTH: "s [mm],width [mm]"}[form]
    return "\n".join([heading, *(f"{a:.4f},{b:.6g}" for a, b in zip(x, y, strict=True))]).encode() + b"\n"
