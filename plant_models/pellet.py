"""pellet: a single screw that drags melt forward while the die's pressure presses some of it back.

    screw speed --> dead time --> speed loop --> drag u (1 + leak) - pressure flow B P = C dP/dt + q,   q = k P^(1/n)
                                  (overshoots)

Net output of a metering screw is drag flow minus pressure flow (the textbook result for the metering zone), calibrated
so that u is the net flow at the nominal speed; as the die thins with shear, P falls less than q does, and below the
nominal flow less than u comes out. Die and barrel heat up and cool down over minutes: `drift`.

Ranges, and where they come from
    tau         0.3 to 3 s     chosen; flow must ramp before and after a bead on large-format machines
    dead        0.1 to 1 s     chosen
    n           0.3 to 0.7     filled thermoplastics (chosen)
    leak        0.05 to 0.4    chosen
    speed_loop  0.05 to 0.5 s, zeta 0.4 to 1 (chosen); longer than tau, it makes q overshoot
    drift       0.01 to 0.05 over 200 to 1200 s (chosen)
"""

from __future__ import annotations

from plant_models.delay import DeadTime
from plant_models.drift import Drift
from plant_models.drive import SpeedLoop
from plant_models.plant import Plant
from plant_models.reservoir import Reservoir


def pellet(
    *,
    flow: float,
    seed: int = 0,
    tau: float = 0.3,
    n: float = 0.45,
    P_over: float = 4000.0,
    leak: float = 0.15,
    dead: float = 0.2,
    speed_loop: float = 0.3,
    zeta: float = 0.5,
    drift: float = 0.0,
    drift_period: float = 600.0,
    gain: float = 1.0,
    lag: float = 1.0,
) -> Plant:
    """Return a pellet screw for a nominal `flow`, mm^3/s; `speed_loop` is its drive's 1 / w, s, `zeta` its damping.

    `gain` is a factor on the drag flow, `lag` on tau and speed_loop.
    """
    plant: Plant = Reservoir(
        flow=flow, tau=tau, n=n, P_y=0.0, P_over=P_over, leak=leak, gain=gain, lag=lag, name="pellet"
    )
    if speed_loop:
        plant = SpeedLoop(plant, speed_loop * lag, zeta)
    if dead:
        plant = DeadTime(plant, dead)
    if drift:
        plant = Drift(plant, drift, drift_period, seed=seed)
    return plant
