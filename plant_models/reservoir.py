"""Reservoir: something compressible between a drive and a nozzle; what syringe, melt and pellet plants share.

     u --->[ C, P ]---> q       q |          /      q = 0                      |P| <= P_y
              |                   |         .       q = k (P - P_y)^(1/n)      P > P_y
              `--> B P            |______.-'        the same law inwards       P < -P_y
                  flows back           P_y     P

    C dP/dt = u (1 + leak) - B P - q(P)      paste, trapped air and drive give way by C mm^3/kPa; B P flows back

The first-order lag is this reservoir, linearised: about a flow q it is tau = C / (dq/dP + B), so it is given at the
nominal flow and follows from there: slower below it, faster above (shear thinning), endless at rest (the paste relaxes
to P_y and keeps it). What is drawn in below -P_y is air: nothing is taken back from the bed (q never falls below 0),
and the void it leaves must be filled before anything flows again.

Thixotropy: structure s in [0, 1] builds at rest and breaks in flow, and the yield stress follows it,

    ds/dt = (1 - s) / t_rebuild - |q| / flow s / t_break,     P_y(s) = P_y (1 + rise (s - s at the nominal flow)).

Integration: classical Runge-Kutta in substeps. P moves towards its steady value and never past it, so the fastest rate
of a sample is known before it begins (dq/dP grows with P): a substep is at most 0.2 of that time constant, which keeps
it stable and accurate at any dt and any lag. P is advanced by the very flow that is handed out, so without leak volume
is conserved to rounding:  sum(u - q) dt = C (P1 - P0) - (void1 - void0).

Sources: Herschel-Bulkley flow in a round nozzle, here as pressure over a nozzle's yield pressure (a common
simplification: the plug's radius is left out); the first-order lag of Hoelzle, eq. (1), and of its ref. 14, Bellini,
Guceri, Bertoldi, "Liquefier Dynamics in Fused Deposition", J. Manuf. Sci. Eng. 126 (2004), which it falls back to at
n = 1 and P_y = 0; the structure equation is the usual kinetic one of thixotropy, s for lambda.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Floats
from gcodectl.jit import jit
from plant_models.plant import checked, require


@jit
def law_kernel(P: float, P_y: float, k: float, exponent: float) -> float:
    """Return the flow through the nozzle at pressure P: k (|P| - P_y)^exponent, inwards where P < 0."""
    over = abs(P) - P_y
    if over <= 0.0:
        return 0.0
    return math.copysign(k * over**exponent, P)


@jit
def slopes_kernel(P: float, s: float, u: float, constants: Floats) -> tuple[float, float, float]:
    """Return dP/dt, ds/dt and the flow through the nozzle."""
    C, B, k, exponent, P_y, rise, s_flow, rebuild, breaking = constants
    q = law_kernel(P, P_y * (1.0 + rise * (s - s_flow)), k, exponent)
    return (u - B * P - q) / C, (1.0 - s) * rebuild - s * breaking * abs(q), q


@jit
def reservoir_kernel(state: Floats, u: Floats, dt: float, constants: Floats, q: Floats) -> None:
    """Advance state [P, void, s] in place by u[n] and fill q[n] with sample averages.

    `constants`: C, B, k, 1/n, P_y, rise, s at the nominal flow, 1/t_rebuild, 1/(t_break flow).
    """
    C, B, k, exponent, P_y, rise, s_flow, rebuild, breaking = constants
    P, void, s = state[0], state[1], state[2]
    last, steady = 0.0, 0.0  # u, and the pressure above the yield that it ends in: powers are what costs here
    for i in range(len(u)):
        P_y_now = P_y * (1.0 + rise * (s - s_flow))
        if u[i] != last:
            last, steady = u[i], (abs(u[i]) / k) ** (1.0 / exponent)
        over = max(abs(P) - P_y_now, steady)
        slope = k * over ** (exponent - 1.0) if over > 0.0 else 0.0
        rate = max((exponent * slope + B) / C, rebuild + breaking * slope * over)
        steps = max(1, math.ceil(rate * dt / 0.2))
        h = dt / steps
        out = 0.0
        for _ in range(steps):
            p1, s1, q1 = slopes_kernel(P, s, u[i], constants)
            p2, s2, q2 = slopes_kernel(P + 0.5 * h * p1, s + 0.5 * h * s1, u[i], constants)
            p3, s3, q3 = slopes_kernel(P + 0.5 * h * p2, s + 0.5 * h * s2, u[i], constants)
            p4, s4, q4 = slopes_kernel(P + h * p3, s + h * s3, u[i], constants)
            P += h * (p1 + 2.0 * p2 + 2.0 * p3 + p4) / 6.0
            s += h * (s1 + 2.0 * s2 + 2.0 * s3 + s4) / 6.0
            through = h * (q1 + 2.0 * q2 + 2.0 * q3 + q4) / 6.0
            filled = min(void, through)  # negative where air is drawn in: the void grows
            void -= filled
            out += through - filled
        q[i] = out / dt
    state[0], state[1], state[2] = P, void, s


class Reservoir:
    """The plant C dP/dt = u - q(P); parameters hold at the nominal `flow`, mm^3/s.

    tau: lag there, s; n: flow index, 1 Newtonian, less is shear-thinning; P_y: yield pressure, P_over: pressure above
    it at the nominal flow, kPa; leak: back flow there, as a share of it; rise: how much of P_y the structure governs;
    t_rebuild, t_break: its times at rest and in nominal flow, s; primed: pressure at the start, as a share of P_y;
    gain: mm^3 that move for each that u says; lag: factor on tau. Raises UsageError where a number makes no sense.
    """

    def __init__(
        self,
        *,
        flow: float,
        tau: float,
        n: float,
        P_y: float,
        P_over: float,
        leak: float = 0.0,
        rise: float = 0.0,
        t_rebuild: float = 10.0,
        t_break: float = 1.0,
        primed: float = 1.0,
        gain: float = 1.0,
        lag: float = 1.0,
        name: str = "reservoir",
    ):
        positive = {"flow": flow, "tau": tau, "n": n, "P_over": P_over, "t_rebuild": t_rebuild, "t_break": t_break}
        require(name, positive={**positive, "gain": gain, "lag": lag})
        require(name, least={"P_y": P_y, "leak": leak, "rise": rise, "primed": primed, "1 - n": 1.0 - n})
        require(name, least={"1 - rise": 1.0 - rise, "1 - primed": 1.0 - primed})
        self.inflow = gain * (1.0 + leak)
        self.k = flow / P_over ** (1.0 / n)
        """mm^3/s at 1 kPa above the yield."""
        self.B = leak * flow / (P_y + P_over)
        """Back flow, mm^3/s/kPa."""
        self.C = tau * lag * (flow / (n * P_over) + self.B)
        """Compliance, mm^3/kPa."""
        s_flow = t_break / (t_break + t_rebuild)
        self.constants = np.array(
            [self.C, self.B, self.k, 1.0 / n, P_y, rise, s_flow, 1.0 / t_rebuild, 1.0 / (t_break * flow)]
        )
        self.rest_pressure = primed * P_y * (1.0 + rise * (1.0 - s_flow))

    def initial(self) -> Floats:
        """Return the state [P kPa, void mm^3, structure]: rested, and primed."""
        return np.array([self.rest_pressure, 0.0, 1.0])

    def run(self, state: Floats, u: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return the state after u[n] and the flow q[n]."""
        after, q = state.copy(), np.empty(len(u))
        reservoir_kernel(after, self.inflow * checked(u, dt), dt, self.constants, q)
        return after, q
