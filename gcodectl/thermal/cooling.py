"""Cooling: fit how each location of a surface cools, and predict how hot it will be, with a bound on either side.

    T |o                     o observed         model     T(t) = T_inf + (T0 - T_inf) exp(b1 (t - t0))
      | o.                                                T_inf = T_env - b0 / b1
      |   o'..  ''-- upper bound
      |     o o''--..__ ''---.___               upper     T + z se     so that P(T > upper) = alpha
      |       lower    o''--o.___'----          lower     T - z se     so that P(T < lower) = alpha
      |            '---.______ o  o'----        se^2      = g V g' + sigma^2,  z: Student's t, alpha, n - 3
      +--------------------------------- t

1. Start, linear: (4.11), dT/dt = b0 + b1 (T - T_env), summed from the first frame: T(t) = T0 + b0 (t - t0) + b1 times
   the area under T - T_env. A difference of neighbouring frames is mostly noise, an area hardly at all.
2. Gauss-Newton on the solution (3.2), all locations at once, damped where a step would not lower the residuals.
3. V = sigma^2 (J' J)^-1, sigma^2 the mean square of the residuals; predictions by the delta method, g the gradient.

The start T0 is fitted with b0 and b1 (n - 3 degrees of freedom, not the paper's n - 2): the first frame has as much
noise as any other, and a curve that must pass through it is off everywhere.

Source: Fathizadan, dissertation (Arizona State University, 2022), eq. (3.2)-(3.7), (4.11), (4.12).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.special import stdtrit

from gcodectl.columns import Bools, Columns, Floats, Ints, column
from gcodectl.errors import InputError
from gcodectl.thermal.surface import Surface

LEAST = 5
"""Observations that a location needs: three parameters, and something left to tell the noise from."""
ROUNDS = 60
CLOSE = 1e-10
"""Relative change of the sum of squares at which a fit has come to rest."""
FASTEST = 1.0
"""1/s; a location that cools faster than that is a fault in the frames."""


@dataclasses.dataclass(frozen=True)
class Cooling(Columns):
    """How each location cools, and how well that is known; one row a location."""

    b0: Floats = column(np.float64)
    """degC/s."""
    b1: Floats = column(np.float64)
    """1/s, below 0."""
    t0: Floats = column(np.float64)
    """When its curve begins, s on the clock of the observations."""
    temp0: Floats = column(np.float64)
    """Its fitted temperature then, degC."""
    covariance: Floats = column(np.float64, 9)
    """Of b0, b1 and temp0, a 3 x 3 matrix row by row."""
    sigma2: Floats = column(np.float64)
    """Variance of a single observation about the curve, degC^2."""
    freedom: Ints = column(np.int64)
    """Degrees of freedom that sigma2 was estimated with."""

    def surface(self, s: Floats) -> Surface:
        """Return the fitted curves as a surface, its locations at `s`."""
        return Surface(s=s, b0=self.b0, b1=self.b1, t0=self.t0, temp0=self.temp0)

    def predict(self, t: Floats, ambient: float) -> tuple[Floats, Floats]:
        """Return temperature and its standard error, degC; `t`: s, one a location, or locations x times."""
        wide = np.asarray(t, dtype=np.float64)
        times = wide[:, None] if wide.ndim == 1 else wide
        age = np.maximum(times - self.t0[:, None], 0.0)
        temperature, gradient = _solution(self.b0, self.b1, self.temp0, age, ambient)
        spread = np.einsum("lti,lij,ltj->lt", gradient, self.covariance.reshape(-1, 3, 3), gradient)
        error = np.sqrt(np.maximum(spread, 0.0) + self.sigma2[:, None])
        return temperature.reshape(wide.shape), error.reshape(wide.shape)

    def bounds(self, t: Floats, ambient: float, alpha: float) -> tuple[Floats, Floats]:
        """Return what temperatures fall below, and rise above, with probability `alpha` each; (3.5), degC."""
        temperature, error = self.predict(t, ambient)
        quantile = stdtrit(self.freedom, 1.0 - alpha)
        wide = quantile.reshape(quantile.shape + (1,) * (temperature.ndim - 1)) * error
        return temperature - wide, temperature + wide


def fit(t: Floats, temperature: Floats, ambient: float, t0: Floats | None = None) -> Cooling:
    """Fit every location's cooling to its observations; raises InputError for locations that cannot be fitted.

    `temperature`: degC, locations x times, NaN where a location was not seen; `t`: s, rising, one a time or of
    `temperature`'s shape; `t0`: s, when each location was laid (or heated again): what was seen before is left out, and
    T0 is its temperature then. None: when it was first seen.
    """
    observed = np.atleast_2d(np.asarray(temperature, dtype=np.float64))
    times = np.broadcast_to(np.asarray(t, dtype=np.float64), observed.shape)
    seen = np.isfinite(observed) & np.isfinite(times)
    if t0 is not None:
        seen &= times >= t0[:, None]
    _refuse(seen.sum(axis=1) < LEAST, f"fewer than {LEAST} temperatures", "show them to the camera for longer")
    if t0 is None:
        t0 = times[np.arange(len(times)), seen.argmax(axis=1)]
    age = np.where(seen, times - t0[:, None], 0.0)
    observed = np.where(seen, observed, 0.0)
    parameters = _start(age, observed, seen, ambient)
    parameters, residual, jacobian = _gauss_newton(parameters, age, observed, seen, ambient)
    freedom = seen.sum(axis=1) - 3
    sigma2 = (residual**2).sum(axis=1) / freedom
    normal = np.einsum("lti,ltj->lij", jacobian, jacobian)
    scale = np.sqrt(np.maximum(np.einsum("lii->li", normal), 1e-300))
    inverse = np.linalg.pinv(normal / scale[:, :, None] / scale[:, None, :], hermitian=True)
    covariance = sigma2[:, None, None] * inverse / scale[:, :, None] / scale[:, None, :]
    return Cooling(
        b0=parameters[:, 0], b1=parameters[:, 1], t0=t0, temp0=parameters[:, 2],
        covariance=covariance.reshape(-1, 9), sigma2=sigma2, freedom=freedom,
    )  # fmt: skip


def standardised(cooling: Cooling, t: Floats, temperature: Floats, ambient: float) -> Floats:
    """Return each observation's residual in standard deviations of the fit, NaN where there is none."""
    observed = np.atleast_2d(np.asarray(temperature, dtype=np.float64))
    times = np.broadcast_to(np.asarray(t, dtype=np.float64), observed.shape)
    expected, _ = cooling.predict(times, ambient)
    return np.asarray((observed - expected) / np.sqrt(np.maximum(cooling.sigma2, 1e-300))[:, None])


def _solution(b0: Floats, b1: Floats, temp0: Floats, age: Floats, ambient: float) -> tuple[Floats, Floats]:
    """Temperature, locations x times, and its gradient by b0, b1 and temp0 in a last axis; (3.2)."""
    b0, b1, temp0 = b0[:, None], b1[:, None], temp0[:, None]
    decay = np.exp(b1 * age)
    risen = -np.expm1(b1 * age)
    above = temp0 - ambient + b0 / b1
    temperature = ambient - b0 / b1 + above * decay
    by_b1 = b0 / b1**2 * risen + above * age * decay
    return temperature, np.stack((-risen / b1, by_b1, decay), axis=-1)


def _start(age: Floats, observed: Floats, seen: Bools, ambient: float) -> Floats:
    """First parameters, locations x 3: linear regression on (4.11), summed up."""
    parameters = np.empty((len(age), 3))
    for one in range(len(age)):
        x, y = age[one, seen[one]], observed[one, seen[one]]
        area = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(x) * (y[1:] + y[:-1] - 2.0 * ambient))))
        span = max(float(x[-1]), 1e-9)
        columns = np.column_stack((x / span, area / span, np.ones_like(x)))
        slope = np.linalg.lstsq(columns, y, rcond=None)[0] / (span, span, 1.0)
        slowest = 0.05 / span
        if (
            not -FASTEST <= slope[1] <= -slowest
        ):  # the noise had its way: begin where it cools by a factor e in the time
            slope[1] = -1.0 / span
            slope[0] = float(np.mean(np.diff(y[[0, -1]]))) / span - slope[1] * float(np.mean(y - ambient))
        parameters[one] = slope
    return parameters


def _gauss_newton(
    parameters: Floats, age: Floats, observed: Floats, seen: Bools, ambient: float
) -> tuple[Floats, Floats, Floats]:
    """Settled parameters, residuals and gradients; a step that raises the squares is retried, damped more."""

    def at(values: Floats) -> tuple[Floats, Floats, Floats]:
        expected, gradient = _solution(values[:, 0], values[:, 1], values[:, 2], age, ambient)
        residual = np.where(seen, observed - expected, 0.0)
        return residual, np.where(seen[:, :, None], gradient, 0.0), (residual**2).sum(axis=1)

    residual, jacobian, squares = at(parameters)
    damping = np.full(len(age), 1e-6)
    moving = np.ones(len(age), dtype=bool)
    for _ in range(ROUNDS):
        normal = np.einsum("lti,ltj->lij", jacobian, jacobian)
        scale = np.sqrt(np.maximum(np.einsum("lii->li", normal), 1e-300))
        normal = normal / scale[:, :, None] / scale[:, None, :] + damping[:, None, None] * np.eye(3)
        right = np.einsum("lti,lt->li", jacobian, residual) / scale
        step = np.linalg.solve(normal, right[:, :, None])[:, :, 0] / scale
        tried = parameters + step
        tried[:, 1] = np.minimum(tried[:, 1], 0.2 * parameters[:, 1])  # it cools, whatever one step says
        tried[:, 1] = np.maximum(tried[:, 1], -FASTEST)
        after = at(tried)
        better = moving & (after[2] <= squares)
        small = (squares - after[2]) <= CLOSE * squares + 1e-18
        parameters = np.where(better[:, None], tried, parameters)
        residual = np.where(better[:, None], after[0], residual)
        jacobian = np.where(better[:, None, None], after[1], jacobian)
        squares = np.where(better, after[2], squares)
        damping = np.clip(np.where(better, 0.1 * damping, 10.0 * damping), 1e-12, 1e12)
        moving &= ~(better & small) & (damping < 1e12)
        if not moving.any():
            break
    span = age.max(axis=1)
    flat = (-parameters[:, 1] * span < 1e-3) | (parameters[:, 1] <= -FASTEST) | ~np.isfinite(parameters).all(axis=1)
    _refuse(flat, "no cooling to be seen", "are they on the part, and was it hot?")
    return parameters, residual, jacobian


def _refuse(bad: Bools, what: str, remedy: str) -> None:
    """Raise InputError for the locations marked."""
    rows = np.flatnonzero(bad)
    if len(rows):
        named = ", ".join(str(row) for row in rows[:5]) + (f" and {len(rows) - 5} more" if len(rows) > 5 else "")
        raise InputError(f"location {named}: {what}; {remedy}")
