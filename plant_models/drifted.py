"""Drifted: any plant, delivering more or less and answering sooner or later than when its signals were learned.

    u --> x gain --> the plant, its clock slower by `lag` --> q      dt' = dt / lag: every time constant is lag x longer

Built-in plants take `gain` and `lag` themselves (and leave their dead time alone); a plant out of a file need not.
"""

from __future__ import annotations

from gcodectl.columns import Floats
from plant_models.plant import Plant, load_plant, require


class Drifted:
    """A plant whose u is `gain` times what is asked, and which takes `lag` times as long for everything."""

    def __init__(self, plant: Plant, gain: float, lag: float):
        require("drifted", positive={"gain": gain, "lag": lag})
        self.plant, self.gain, self.lag = plant, gain, lag

    def initial(self) -> Floats:
        """Return the plant's own state."""
        return self.plant.initial()

    def run(self, state: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state after u[n] and the flow q[n]."""
        return self.plant.run(state, self.gain * u, dt / self.lag)


def load_drifted(spec: str, *, seed: int = 0, flow: float | None = None, gain: float = 1.0, lag: float = 1.0) -> Plant:
    """Return the plant that `spec` names with `gain` and `lag` (factors; 1: as it is); raises as `load_plant` does."""
    if gain == 1.0 and lag == 1.0:
        return load_plant(spec, seed=seed, flow=flow)
    if ".py" in spec:
        return Drifted(load_plant(spec, seed=seed, flow=flow), gain, lag)
    return load_plant(spec, seed=seed, flow=flow, gain=gain, lag=lag)
