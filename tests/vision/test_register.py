"""Registration of what a session lays out: thin roads far apart, the first lanes empty."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from gcodectl.columns import Floats
from gcodectl.config import load_machine
from gcodectl.session.measured import width_of
from gcodectl.session.photographs import sheet_of, widths_in
from gcodectl.session.steps import begin
from plant_models.photo_scene import draw_scene
from plant_models.photograph import Strip, photograph
from plant_models.plant import load_plant
from plant_models.recorded import record


@pytest.mark.parametrize("datum", [0.0, 7.5])
def test_lanes_are_not_taken_for_their_neighbours(datum: float) -> None:
    """`datum`: so much nearer to the lanes, mm: then bands are thin, and coarsely seen every lane lies as well."""
    machine = load_machine("filament")
    now = begin(machine, material="m", flow=8.0, gcode=("G28", ""), date="2026-01-02")
    printout = now.setup.printout
    data = printout.gcode("t", now.trials[0].u, now.setup.routine.dt)
    places, area = record(data, machine, load_plant("melt", seed=2, flow=8.0), printout.layout.path).areas(0.1)
    road: Floats = printout.layout.datum + np.array([datum, 0.0])
    layout = dataclasses.replace(printout.layout, datum=road)
    now = dataclasses.replace(
        now, setup=dataclasses.replace(now.setup, printout=dataclasses.replace(printout, layout=layout))
    )
    strip = Strip(layout.path, places, width_of(area, 0.28), road, 0.54, 0.28)
    scene = draw_scene(20_100)
    found = widths_in(now, [("photograph", photograph(strip, sheet_of(layout, 0.4), scene))])
    assert found.shift.y == pytest.approx(scene.shift[1], abs=0.3)
    assert found.shift.degrees == pytest.approx(scene.shift[2], abs=0.05)
    empty = found.s < 0.1 * layout.length
    assert np.nanmedian(found.width[empty]) == 0.0
