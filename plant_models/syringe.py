"""syringe: a plunger, its drive's faults, and a barrel of yield-stress paste.

    u --> drift --> dead time --> drive lag --> backlash --> reservoir (yield stress, power law, thixotropy) --> q

The plunger's cap and slew are the machine's: wrap the plant in `plunger.Plunger`, or give max_flow and max_flow_slew.

Ranges, and where they come from
    tau          0.3 to 5 s     Hoelzle et al., Table I: 2.7 and 4.5 s; shorter for stiff syringes (chosen)
    n            0.3 to 0.8     shear-thinning colloidal inks: Smay, Cesarano, Lewis, Langmuir 18 (2002); bounds chosen
    P_y, P_over  50 to 500 kPa  chosen: what a stepper syringe drive reaches
    dead         0.1 to 0.3 s   drive lag of long tubes, controller latency (chosen)
    backlash     0.02 to 0.1 s  of nominal flow (chosen)
    rise         0.2 to 0.8     share of the yield stress that comes back at rest (chosen), t_rebuild 5 to 60 s
    gain         0.8 to 1.1     Table I: 1.08 and 0.89; barrel slip and calibration
"""

from __future__ import annotations

import math

from plant_models.delay import DeadTime
from plant_models.drift import Drift
from plant_models.drive import DriveLag
from plant_models.plant import Plant
from plant_models.plunger import Backlash, Plunger
from plant_models.reservoir import Reservoir


def syringe(
    *,
    flow: float,
    seed: int = 0,
    tau: float = 1.0,
    n: float = 0.45,
    P_y: float = 120.0,
    P_over: float = 180.0,
    rise: float = 0.0,
    t_rebuild: float = 10.0,
    t_break: float = 1.0,
    primed: float = 1.0,
    backlash: float = 0.0,
    drive_lag: float = 0.0,
    dead: float = 0.0,
    drift: float = 0.0,
    drift_period: float = 600.0,
    max_flow: float = math.inf,
    max_flow_slew: float = math.inf,
    gain: float = 1.0,
    lag: float = 1.0,
) -> Plant:
    """Return a syringe of paste for a nominal `flow`, mm^3/s; `backlash` in seconds of that flow, see above.

    `gain` is a factor on the volume that moves, `lag` on tau and drive_lag.
    """
    plant: Plant = Reservoir(
        flow=flow,
        tau=tau,
        n=n,
        P_y=P_y,
        P_over=P_over,
        rise=rise,
        t_rebuild=t_rebuild,
        t_break=t_break,
        primed=primed,
        gain=gain,
        lag=lag,
        name="syringe",
    )
    if backlash:
        plant = Backlash(plant, backlash * flow)
    if drive_lag:
        plant = DriveLag(plant, drive_lag * lag)
    if dead:
        plant = DeadTime(plant, dead)
    if drift:
        plant = Drift(plant, drift, drift_period, seed=seed)
    if math.isfinite(max_flow) or math.isfinite(max_flow_slew):
        plant = Plunger(plant, max_flow, max_flow_slew)
    return plant
