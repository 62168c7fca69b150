"""The built-in plants, as a table: a name, what builds it, the flow it is made for, and what sets it apart."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from types import MappingProxyType

from plant_models.delay import DeadTime
from plant_models.linear import Linear
from plant_models.melt import melt
from plant_models.pellet import pellet
from plant_models.plant import Plant
from plant_models.pneumatic import pneumatic
from plant_models.syringe import syringe


@dataclasses.dataclass(frozen=True)
class Recipe:
    """How a named plant is made."""

    build: Callable[..., Plant]
    """Takes `flow`, `seed`, and the parameters that `load_plant` accepts."""
    flow: float
    """Nominal flow where none is asked for, mm^3/s."""
    parameters: Mapping[str, float]
    """What differs from the defaults of `build`."""
    summary: str


def linear(
    *,
    flow: float,  # noqa: ARG001  a linear plant is the same at any flow
    seed: int = 0,  # noqa: ARG001  and has nothing random
    K: float = 1.0,
    tau: float = 1.0,
    dead: float = 0.0,
    gain: float = 1.0,
    lag: float = 1.0,
) -> Plant:
    """Return K / (tau s + 1), behind a dead time if there is one."""
    plant = Linear(K, tau, gain=gain, lag=lag)
    return DeadTime(plant, dead) if dead else plant


_SLOW = {"tau": 3.0, "n": 0.4, "P_y": 250.0, "P_over": 250.0}
_FAST = {"tau": 0.3, "n": 0.55, "P_y": 60.0, "P_over": 120.0}

RECIPES: Mapping[str, Recipe] = MappingProxyType(
    {
        "linear": Recipe(linear, 5.0, {}, "first-order lag of 1 s"),
        "paste-a": Recipe(linear, 5.0, {"K": 1.08, "tau": 2.7}, "Hoelzle's material A"),
        "paste-b": Recipe(linear, 5.0, {"K": 0.89, "tau": 4.5}, "Hoelzle's material B"),
        "syringe": Recipe(syringe, 5.0, {}, "yield-stress paste, lag 1 s"),
        "syringe-fast": Recipe(syringe, 5.0, _FAST, "yield-stress paste, lag 0.3 s"),
        "syringe-mid": Recipe(syringe, 5.0, {}, "the same as syringe"),
        "syringe-slow": Recipe(syringe, 5.0, _SLOW, "yield-stress paste, lag 3 s"),
        "syringe-dead": Recipe(syringe, 5.0, {"dead": 0.2}, "lag 1 s behind a dead time of 0.2 s"),
        "syringe-backlash": Recipe(syringe, 5.0, {"backlash": 0.1, "drive_lag": 0.03}, "a worn drive"),
        "syringe-drift": Recipe(syringe, 5.0, {"drift": 0.05, "drift_period": 400.0}, "delivers 5 % more, then less"),
        "syringe-thixo": Recipe(
            syringe, 5.0, {"rise": 0.5, "t_rebuild": 10.0, "t_break": 0.5}, "stiffens while it rests"
        ),
        "pneumatic": Recipe(pneumatic, 5.0, {}, "u sets a pressure"),
        "melt": Recipe(melt, 8.0, {}, "filament, direct drive"),
        "melt-bowden": Recipe(melt, 8.0, {"tau": 0.4, "dead": 0.03}, "filament, Bowden tube"),
        "pellet": Recipe(pellet, 1500.0, {"drift": 0.03}, "large-format pellet screw"),
    }
)
