"""Head: up to four systems, each a plunger and a barrel, on a rotary array; one at a time stands over the part.

    tool     0 0 0 0 1 1 1 1 1 1 1 1         asked for, a sample at a time
    over     0 0 0 0 - - - - 1 1 1 1         nothing for `switch` seconds while the array turns
    q[0]     ------..........____________    a system that was not stopped oozes on at its residual pressure,
    q[1]     ____________________.-'-----    over the part or beside it

So a material switch is Stop, dwell, Start: without the Stop the old system oozes, without the dwell the begin of the
new road lands elsewhere. Each system has its own motor, so a plunger follows its u wherever the system stands: the next
one may build pressure while the array turns. `run` returns what leaves every nozzle, `over` which of them is in place;
where it lands is the caller's to know.

Its protocol is Plant's with a row a channel, and the tool a column:

    initial(tool) -> state        run(state, u[c, n], tool[n], dt) -> (state, q[c, n])

Cut into pieces, a run gives the same; the state holds [tool, seconds to go | length, state | length, state ...].

Source: Hoelzle et al., "Iterative Learning Control Using a Basis Signal Library", Section II and Fig. 1: four systems
in a rotary array, each with motor, lead screw and plunger; Section IV: a dwell to switch; the 1.0 s is the project's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.errors import UsageError
from gcodectl.jit import jit
from plant_models.actuator import join, split
from plant_models.plant import Plant, require

MOST_SYSTEMS = 4


@jit
def place_kernel(here: int, to_go: float, tool: Ints, dt: float, switch: float, over: Ints) -> tuple[int, float]:
    """Fill over[n] with the system in place, -1 while the array turns; return the tool asked for and the time to go.

    A sample counts as in place once no more than a millionth of it was left to turn.
    """
    for k in range(len(tool)):
        if tool[k] != here:
            here, to_go = tool[k], switch
        over[k] = here if to_go <= 1e-6 * dt else -1
        to_go = max(to_go - dt, 0.0)
    return here, to_go


class Head:
    """Systems side by side; `switch` is the seconds that the array takes to turn."""

    def __init__(self, plants: Sequence[Plant], switch: float = 1.0):
        if not 1 <= len(plants) <= MOST_SYSTEMS:
            raise UsageError(f"a head carries 1 to {MOST_SYSTEMS} systems, not {len(plants)}")
        require("head", least={"switch": switch})
        self.plants, self.switch = tuple(plants), switch

    def initial(self, tool: int = 0) -> Floats:
        """Return the state with all systems at rest and `tool` in place."""
        parts = [join(plant.initial(), np.zeros(0)) for plant in self.plants]
        return np.concatenate([np.array([float(tool), 0.0]), *parts])

    def run(self, state: Floats, u: Floats, tool: Ints, dt: float) -> tuple[Floats, Floats]:
        """Return the state and q[c, n] after u[c, n] with tool[n] asked for; UsageError for a tool that is not there.

        Flows in mm^3/s. Every plunger follows its row of u, in place or not.
        """
        assert u.shape == (len(self.plants), len(tool)), "u is systems x samples, and so long is tool"
        here, _ = self.over(state, tool, dt)
        q, parts, rest = np.empty_like(u), [here], state[2:]
        for channel, plant in enumerate(self.plants):
            own, rest = split(rest)
            own, q[channel] = plant.run(own, u[channel], dt)
            parts.append(join(own, np.zeros(0)))
        return np.concatenate(parts), q

    def over(self, state: Floats, tool: Ints, dt: float) -> tuple[Floats, Ints]:
        """Return [tool, seconds to go] after, and over[n]: the system in place at each sample, -1 while turning."""
        asked = np.ascontiguousarray(tool, dtype=np.int64)
        strange: Bools = (asked < 0) | (asked >= len(self.plants))
        if strange.any():
            raise UsageError(f"the head has no T{asked[strange][0]}; it carries T0 to T{len(self.plants) - 1}")
        over = np.empty_like(asked)
        here, to_go = place_kernel(int(state[0]), float(state[1]), asked, dt, self.switch, over)
        return np.array([float(here), to_go]), over
