"""melt: a filament as a spring, a melt that thins as it shears, and a short delay; no yield stress.

    u --> drift --> delay --> filament spring C --> nozzle  q = k P^(1/n)

Firmware's pressure advance assumes the same spring with n = 1 (Klipper's docs/Kinematics.md: pressure in proportion
to flow), so that one constant, our tau, does for all speeds; with n < 1 it does only near one. A retract that
outruns the spring pulls the melt back and leaves a void; without yield stress, what is not retracted oozes at rest.

Ranges, and where they come from
    tau     0.02 to 0.6 s    pressure advance in practice: about 0.05 s direct drive, some 0.1 s Bowden (chosen)
    n       0.3 to 0.8       shear-thinning melt as in Bellini, Guceri, Bertoldi, J. Manuf. Sci. Eng. 126 (2004);
                             the bounds chosen
    P_over  1 to 20 MPa      chosen; only C P counts
    dead    0 to 0.05 s      chosen
"""

from __future__ import annotations

from plant_models.delay import DeadTime
from plant_models.drift import Drift
from plant_models.plant import Plant
from plant_models.reservoir import Reservoir


def melt(
    *,
    flow: float,
    seed: int = 0,
    tau: float = 0.05,
    n: float = 0.5,
    P_over: float = 5000.0,
    dead: float = 0.01,
    drift: float = 0.0,
    drift_period: float = 600.0,
    gain: float = 1.0,
    lag: float = 1.0,
) -> Plant:
    """Return a filament extruder for a nominal `flow`, mm^3/s; `gain` is a factor on what moves, `lag` on tau."""
    plant: Plant = Reservoir(flow=flow, tau=tau, n=n, P_y=0.0, P_over=P_over, gain=gain, lag=lag, name="melt")
    if dead:
        plant = DeadTime(plant, dead)
    if drift:
        plant = Drift(plant, drift, drift_period, seed=seed)
    return plant
