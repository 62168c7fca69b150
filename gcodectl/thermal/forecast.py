"""Forecast: how the next layer will cool, from how the last ones did.

    b |      o                 d layers' estimates, each with its variance; the mean of them is taken off, a Gaussian
      |  o       o   _x_       process with a squared exponential kernel runs through the rest, and on to the next
      |              '''       layer (x). Or EWMA: the newest counts most, a layer older counts 1 - weight of that.
      +--1---2---3---4---- layer

Every parameter of every location is told in its own noise (the mean variance of its estimates, 3.12). What all the
locations do in common (a draught, a warmer day) is one process, known M times as well; what each does beside that is
another, and all locations share its kernel. A kernel's amplitude and length are those of the greatest marginal
likelihood: three layers of one location alone would tell nothing about either. So the forecast is one and the same
weighted sum of layers for b0 and b1, and errors of theirs that belong together (their correlation is near -1: what one
has too much the other makes up for) stay together; its covariance is the fits' mean one, times the process' variance in
noises. T0 does not drift: where the road is laid it is what comes out of the nozzle, and its mean is taken. The
variance of the next estimate's own noise (3.19) is left out: roads land on temperatures, not on estimates. sigma^2 has
no trend in the published layers, and is averaged.

Source: Fathizadan, dissertation (Arizona State University, 2022), eq. (3.8)-(3.20); Rasmussen and Williams 2006.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from gcodectl.columns import Floats
from gcodectl.errors import UsageError
from gcodectl.thermal.cooling import Cooling

DEPTH = 3
EWMA_WEIGHT = 0.4
AMPLITUDES = np.geomspace(1e-2, 1e6, 17)
"""Variances of the process that are tried, in variances of the noise."""
LENGTHS = np.array([0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0])
"""Lengths of the kernel that are tried, in layers."""


def forecast(layers: Sequence[Cooling], *, depth: int = DEPTH, ahead: int = 1, ewma: bool = False) -> Cooling:
    """Return how the layer `ahead` of the last one will cool, by the last `depth` layers (oldest first).

    Times are on the last layer's clock. Raises UsageError for no layers, or layers of different locations.
    """
    last = list(layers)[-depth:] if depth > 0 else []
    if not last or ahead < 1 or len({len(one) for one in last}) != 1:
        raise UsageError("a forecast needs at least one layer, all of them with the same locations")
    values = np.stack([np.column_stack((one.b0, one.b1, one.temp0)) for one in last])
    covariance = np.mean([one.covariance for one in last], axis=0)
    noise = np.sqrt(np.maximum(covariance[:, [0, 4]], 1e-300))
    mean = values.mean(axis=0)
    off = (values[:, :, :2] - mean[:, :2]) / noise
    common = off.mean(axis=1, keepdims=True)
    if ewma:
        found, variance = _averaged(off)
    else:
        shared, shared_variance = _process(common, 1.0 / off.shape[1], ahead)
        own, own_variance = _process(off - common, 1.0, ahead)
        found, variance = shared + own, shared_variance + own_variance
    found = np.column_stack((mean[:, :2] + noise * found, mean[:, 2]))
    found[:, 1] = np.minimum(found[:, 1], 0.2 * values[-1, :, 1])
    freedom = np.sum([one.freedom for one in last], axis=0)
    return Cooling(
        b0=found[:, 0], b1=found[:, 1], t0=last[-1].t0, temp0=found[:, 2], covariance=variance * covariance,
        sigma2=np.sum([one.freedom * one.sigma2 for one in last], axis=0) / freedom, freedom=freedom,
    )  # fmt: skip


def _process(scaled: Floats, noise: float, ahead: int) -> tuple[Floats, float]:
    """The process' forecast (locations x 2), and its variance; `scaled`: layers x locations x 2, of that noise."""
    count = len(scaled)
    layer = np.arange(count, dtype=np.float64)[:, None]
    targets = scaled.reshape(count, -1)
    if count == 1:
        return scaled[0], noise
    # the likelihood of all targets is that of `count` ones with the same mean product: their number matters no more
    level, turned = np.linalg.eigh(targets @ targets.T * (count / targets.shape[1]))
    alike = turned * np.sqrt(np.maximum(level, 0.0))
    process = GaussianProcessRegressor(ConstantKernel(1.0) * RBF(1.0), alpha=noise, optimizer=None).fit(layer, alike)
    options = [np.log([noise * amplitude, length]) for amplitude in AMPLITUDES for length in LENGTHS]
    likelihood = [process.log_marginal_likelihood(theta, clone_kernel=False) for theta in options]
    amplitude, length = np.exp(options[int(np.argmax(likelihood))])
    chosen = GaussianProcessRegressor(ConstantKernel(amplitude) * RBF(length), alpha=noise, optimizer=None)
    chosen.fit(layer, np.eye(count))  # linear in the targets: what it makes of unit vectors is what each layer counts
    sums, spread = chosen.predict(np.array([[count - 1.0 + ahead]]), return_std=True)
    of_mean = noise * (1.0 - float(sums.sum())) ** 2 / count  # the mean that was taken off has noise, too
    forecast = np.tensordot(np.ravel(sums), scaled, axes=1)
    return np.asarray(forecast), float(np.ravel(spread)[0]) ** 2 + of_mean


def _averaged(scaled: Floats) -> tuple[Floats, float]:
    """The moving average (locations x 2), and its variance in noises: by what layers scatter, at least the noise."""
    sums = EWMA_WEIGHT * (1.0 - EWMA_WEIGHT) ** np.arange(len(scaled) - 1.0, -1.0, -1.0)
    sums[0] /= EWMA_WEIGHT  # the oldest stands for all before it
    scatter = max(1.0, float(np.mean(scaled**2)) * len(scaled) / max(len(scaled) - 1, 1))
    return np.tensordot(sums, scaled, axes=1), scatter * float(np.sum(sums**2))
