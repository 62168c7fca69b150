"""`gcodectl learn simulate`: play the printer's part of a session, on a simulated plant."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

if TYPE_CHECKING:
    from gcodectl.columns import Floats
    from gcodectl.session.record import Session
    from plant_models.plant import Plant
    from plant_models.recorded import Recording

Draw: TypeAlias = tuple[int, int, int]
"""What a print's noise is drawn by: seed, trial, and how often it was printed before."""
STEP = 0.25
"""Nozzles between two places that are measured."""
RATE = 0.02
"""s between two times."""


class Form(StrEnum):
    """What is measured."""

    FLOW = "t,q"
    AREA = "s,area"
    WIDTH = "s,width"
    PHOTO = "photo"


def simulate(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="Folder of the session.")],
    plant: Annotated[str, typer.Option(help="Extruder model: a name, or path/to/file.py:Attribute.")],
    trial: Annotated[int | None, typer.Option(help="Which trial to print (default: the one that waits).")] = None,
    form: Annotated[Form, typer.Option("--as", help="What is measured of the print.")] = Form.AREA,
    noise: Annotated[float, typer.Option(min=0, help="Camera noise, as a multiple of a measured one's; 0: none.")] = 0,
    weigh: Annotated[
        float | None, typer.Option(metavar="READABILITY", help="Weigh it too, with a scale of so fine a step, g.")
    ] = None,
    density: Annotated[
        float | None, typer.Option(help="Of what is weighed, g/cm^3 (default: as the session knows it).")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of all that is random; each print of a trial draws its own.")] = 0,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Default: beside the trial, as .csv or .jpg.")
    ] = None,
) -> None:
    """Print the trial that waits on the virtual machine and a plant, and write what a camera would measure."""
    from gcodectl.cli.common import write_whole
    from gcodectl.cli.compiling import announce_compiling
    from gcodectl.errors import InputError, UsageError
    from gcodectl.session.held import held
    from gcodectl.session.record import load, save
    from plant_models.plant import load_plant
    from plant_models.recorded import record

    announce_compiling()
    now = load(session)
    one = now.waiting if trial is None else now.trial(trial)
    if one is None:
        raise UsageError("no trial waits to be printed: learning has stopped; name one with --trial")
    try:
        data = (session / one.file).read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror}): `gcodectl learn status` writes it again",
                         source=str(session / one.file)) from error  # fmt: skip
    setup = now.setup
    layout = setup.printout.layout
    made = load_plant(plant, seed=seed, flow=None if ".py" in plant else setup.routine.flow)
    try:
        along = record(data, setup.printout.machine, made, layout.path)
    except InputError as error:
        raise InputError(f"{error}: delete it, and `gcodectl learn status` writes it again",
                         source=str(session / one.file)) from error  # fmt: skip
    prints = len(one.prints) + len(one.dropped)
    suffix = ".jpg" if form is Form.PHOTO else ".csv"
    path = output or (session / one.file).with_suffix(f".{prints}{suffix}" if prints else suffix)
    draw = (seed, one.number, prints)
    weight = "" if weigh is None else _weighed(now, data, made, weigh, density, draw)  # first: it may be refused
    if form is Form.PHOTO:
        _photograph(now, along, record(data, setup.printout.machine, made, layout.datum), noise, draw, path)
    else:
        write_whole(path, [_table(now, along, form, noise, draw)])
    with held(session):
        save(_simulated(load(session), f"{plant}, seed {seed}, noise {noise:g}"), session)
    typer.echo(f"{path}: trial {one.number} on {plant}, seed {seed}, noise {noise:g}, as {form}{weight}")


def _weighed(session: Session, data: bytes, plant: Plant, step: float, density: float | None, draw: Draw) -> str:
    """Return what a scale of that step, g, shows of all that the file lays, as `learn next` takes it."""
    import numpy as np

    from gcodectl.errors import UsageError
    from plant_models.recorded import laid
    from plant_models.scale import weigh

    density = session.setup.density if density is None else density
    if not density:
        raise UsageError("--weigh needs --density, in g/cm^3: no weight has told this session")
    grams = weigh(laid(data, session.setup.printout.machine, plant), density, step, np.random.default_rng([*draw, 13]))
    return f"; weighs {grams} g: --weighed {grams} --density {density:g}"


def _simulated(session: Session, by: str) -> Session:
    """Return the session, which says for ever that its prints were simulated, and on what."""
    import dataclasses

    told = session.setup.plant.split("; ") if session.setup.plant else []
    plant = "; ".join(dict.fromkeys([*told, by]))
    return dataclasses.replace(session, setup=dataclasses.replace(session.setup, plant=plant))


def _measured(session: Session, along: Recording, form: Form, noise: float, draw: Draw) -> tuple[Floats, Floats]:
    """Return times or places, and what is measured there; noise is relative, along the road."""
    import numpy as np

    from gcodectl.session.measured import width_of
    from plant_models.noise import ROAD_WIDTHS

    setup = session.setup
    x, y = along.means(RATE) if form is Form.FLOW else along.areas(STEP * setup.nozzle)
    if noise:
        places = x * setup.printout.layout.speed if form is Form.FLOW else x
        y = y * np.maximum(1.0 + ROAD_WIDTHS.scaled(noise).along(places, np.random.default_rng(draw)), 0.0)
    return (x, width_of(y, setup.printout.height)) if form in (Form.WIDTH, Form.PHOTO) else (x, y)


def _table(session: Session, along: Recording, form: Form, noise: float, draw: Draw) -> bytes:
    """Return the CSV file."""
    x, y = _measured(session, along, form, noise, draw)
    heading = {Form.FLOW: "t [s],q [mm^3/s]", Form.AREA: "s [mm],area [mm^2]", Form.WIDTH: "s [mm],width [mm]"}[form]
    return "\n".join([heading, *(f"{a:.4f},{b:.6g}" for a, b in zip(x, y, strict=True))]).encode() + b"\n"


def _photograph(session: Session, along: Recording, datum: Recording, noise: float, draw: Draw, path: Path) -> None:
    """Write the photograph of a print on its sheet."""
    import numpy as np

    from gcodectl.session.measured import width_of
    from gcodectl.session.photographs import sheet_of
    from gcodectl.vision.photo import write_photograph
    from plant_models.photo_scene import another_view, draw_scene
    from plant_models.photograph import Strip, photograph

    setup = session.setup
    layout, height = setup.printout.layout, setup.printout.height
    s, width = _measured(session, along, Form.PHOTO, noise, draw)
    _, area = datum.areas(STEP * setup.nozzle)
    steady = float(np.median(width_of(area[len(area) // 2 :], height)))
    strip = Strip(layout.path, s, width, layout.datum, steady, height)
    scene = another_view(draw_scene(draw[0]), int(np.random.default_rng(draw).integers(1 << 31)))
    write_photograph(path, photograph(strip, sheet_of(layout, setup.nozzle), scene))
