"""Photographs of a trial: the sheet that is laid beneath it, and the widths along its path that they show."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gcodectl.session.layout import Layout
from gcodectl.session.measured import Series
from gcodectl.session.record import Session
from gcodectl.vision.join import measure_session
from gcodectl.vision.overlay import overlay
from gcodectl.vision.photo import Photo, read_photograph
from gcodectl.vision.sheet import Sheet, sheet_around
from gcodectl.vision.view import Scale
from gcodectl.vision.widths import Widths

MARGIN, NOZZLES = 5.0, 3.0
"""mm, or nozzles, that the sheet's window leaves around everything that is laid."""
STEP = 0.3
"""Nozzles from one place that is measured to the next."""


def sheet_of(layout: Layout, nozzle: float) -> Sheet:
    """Return the sheet of markers around a layout; nozzle in mm."""
    points = np.concatenate([layout.datum, layout.set_off[None], layout.path, layout.run_out])
    return sheet_around(points, max(MARGIN, NOZZLES * nozzle))


def photographed(session: Session, files: Sequence[Path], scale: float | None = None) -> tuple[Series, Photo]:
    """Return the widths that photographs of one print show, and the first photograph with its edges drawn in.

    `scale`: pixels a mm where the camera looks straight down and there is no sheet. Raises InputError, named after the
    photograph, for what is none of the session's road.
    """
    images = [(str(file), read_photograph(file)) for file in files]
    found = widths_in(session, images, scale)
    series = Series("s,width", found.s, found.width, source=", ".join(map(str, files)), notes=found.notes, by="photo")
    return series, overlay(images[0][1], found)


def widths_in(session: Session, images: Sequence[tuple[str, Photo]], scale: float | None = None) -> Widths:
    """Return the widths along the path that photographs, (name, image) each, of one print show."""
    setup = session.setup
    layout = setup.printout.layout
    view = sheet_of(layout, setup.nozzle) if scale is None else Scale(scale)
    return measure_session(images, layout.path, layout.datum, view, STEP * setup.nozzle, height=setup.printout.height)
