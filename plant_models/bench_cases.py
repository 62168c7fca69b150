"""What the flow bench prints: plants, the machine each belongs to, and the parts of that machine.

    structure  plants                                   machine     parts (>= 12 for every plant)
    linear     paste-a, paste-b                         syringe     the 12 that are drawn (plant_models.drawn_parts),
    yield      syringe-fast, syringe-mid, syringe-slow  syringe     the star of tests/data where it is there,
    dead time  syringe-dead                             syringe     and the corpus's parts of that machine
    backlash   syringe-backlash                         syringe
    thixotropy syringe-thixo                            syringe
    pressure   pneumatic (steady flow is a curve of u)  syringe
    melt       melt, melt-bowden                        filament
    pellet     pellet (a screw that overshoots)         pellet

A drawn part is drawn anew for each machine: its flow, its speed, and all lengths stretched to its bead. A file of a
slicer is printed by the machine that it was sliced for, its first `SECONDS`: whole roads only. A plant is the same
whatever the part: its parameters hold at the machine's flow, which is also what the library is learned at.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from gcodectl.config import Machine, load_machine
from plant_models.bead import on_road
from plant_models.drawn_parts import DRAWN
from plant_models.gantry import Firmware, cut
from plant_models.parts import Style
from plant_models.planner import plan
from plant_models.printing import capped
from plant_models.reading import read_moves

SECONDS = 40.0
"""s; how much of a slicer's file is printed."""


@dataclasses.dataclass(frozen=True)
class Shop:
    """How one machine prints in the bench: nominal flow mm^3/s, speeds mm/s, lengths mm."""

    machine: str
    flow: float
    speed: float
    travel: float
    height: float
    size: float
    sliced: tuple[str, ...]
    """Files of the corpus that were sliced for it, or for one like it."""

    def style(self) -> Style:
        """Return how parts are drawn for it."""
        barrel = load_machine(self.machine).barrel_diameter
        return Style(barrel, self.flow, self.speed, self.travel, self.height, self.size)


@dataclasses.dataclass(frozen=True)
class BenchPlant:
    """One plant of the bench and what is hard about it."""

    name: str
    structure: str
    shop: str


@dataclasses.dataclass(frozen=True)
class Case:
    """One part on one plant, ready to print."""

    plant: str
    """A name, or path/to/file.py:Attribute."""
    structure: str
    part: str
    data: bytes = dataclasses.field(repr=False)
    machine: Machine
    """Its plunger capped."""
    flow: float
    """What the plant is made for and the library is learned at, mm^3/s."""


SHOPS = {
    "syringe": Shop(
        "syringe", 4.0, 10.0, 40.0, 0.6, 1.0,
        ("paste_cube_prusaslicer", "paste_features_prusaslicer", "paste_testmodel_prusaslicer"),
    ),
    "filament": Shop("filament", 6.0, 40.0, 120.0, 0.3, 1.5, ("ps_cube10_relE", "cura_ender3_absE")),
    "pellet": Shop("pellet", 800.0, 50.0, 150.0, 2.5, 6.0, ("pellet_box_prusaslicer", "pellet_vase_prusaslicer")),
}  # fmt: skip

PLANTS = (
    BenchPlant("paste-a", "linear", "syringe"),
    BenchPlant("paste-b", "linear", "syringe"),
    BenchPlant("syringe-fast", "yield", "syringe"),
    BenchPlant("syringe-mid", "yield", "syringe"),
    BenchPlant("syringe-slow", "yield", "syringe"),
    BenchPlant("syringe-dead", "dead time", "syringe"),
    BenchPlant("syringe-backlash", "backlash", "syringe"),
    BenchPlant("syringe-thixo", "thixotropy", "syringe"),
    BenchPlant("pneumatic", "pressure", "syringe"),
    BenchPlant("melt", "melt", "filament"),
    BenchPlant("melt-bowden", "melt", "filament"),
    BenchPlant("pellet", "pellet", "pellet"),
)
STRUCTURES = {one.name: one.structure for one in PLANTS}


def shop_parts(shop: Shop, corpus: Path | None, star: Path | None = None) -> dict[str, bytes]:
    """Return the parts of a machine by name: drawn ones, and the beginnings of the sliced files that are there."""
    parts = {name: draw(shop.style()) for name, draw in DRAWN.items()}
    files = [corpus / f"{name}.gcode" for name in shop.sliced] if corpus else []
    if star is not None and shop.machine == "syringe":
        files.append(star)
    machine = load_machine(shop.machine)
    for file in files:
        if file.is_file():
            parts[file.stem.removesuffix("_prusaslicer")] = begin_of(file.read_bytes(), machine, SECONDS)
    return parts


def begin_of(data: bytes, machine: Machine, seconds: float) -> bytes:
    """Return the first lines of a file, those that `machine` prints in `seconds`, and on to the end of that road."""
    moves = read_moves(data, machine, source="the part")
    segments = cut(moves, machine, Firmware())
    phases = plan(segments, Firmware())
    late = np.unique(phases.segment[phases.t > seconds])
    ends = late[~on_road(segments[late])]
    if not len(ends):
        return data
    return b"".join(data.splitlines(keepends=True)[: int(segments.line[ends[0]]) - 1])


def cases(names: tuple[str, ...], cap: float, corpus: Path | None, star: Path | None = None) -> list[Case]:
    """Return every built-in plant of `names` with every part of its machine, the plunger capped at `cap` x its flow."""
    made: list[Case] = []
    parts = {name: shop_parts(shop, corpus, star) for name, shop in SHOPS.items()}
    for plant in PLANTS:
        if plant.name not in names:
            continue
        shop = SHOPS[plant.shop]
        machine = capped(load_machine(shop.machine), shop.flow, cap)
        made += [
            Case(plant.name, plant.structure, part, data, machine, shop.flow)
            for part, data in parts[plant.shop].items()
        ]
    return made
