"""Flow models made by hand, one of each structure, and a basis set that ships one, for the tests of flow and filter."""

from __future__ import annotations

import dataclasses

from gcodectl.flow.flow_model import FlowModel
from gcodectl.flow.library import BasisSet, open_library

LINEAR = FlowModel("linear", K=1.08, flow=5.0, store=5.0, delay=0.1)
PLUNGER = FlowModel("plunger", K=0.9, flow=5.0, store=4.0, threshold=2.0, power=2.0, delay=0.153)
BACKLASH = dataclasses.replace(PLUNGER, structure="backlash", gap=0.4)
PRESSURE = FlowModel("pressure", K=1.1, flow=5.0, store=1.0, threshold=0.4, power=2.0, lag=0.3, delay=0.05, pull=1.0)
SCREW = FlowModel("screw", K=1.0, flow=5.0, store=2.0, power=1.2, leak=0.2, delay=0.1, swing=0.15, damping=0.6)
MODELS = {one.structure: one for one in (LINEAR, PLUNGER, PRESSURE, BACKLASH, SCREW)}


def modelled(model: FlowModel | None, material: str = "paste-a") -> BasisSet:
    """A built-in basis set with this model instead of its own."""
    return dataclasses.replace(open_library().find(material), model=model)
