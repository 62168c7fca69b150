"""Measurement noise: what a camera reads of a road's flow is off by an offset a print and by AR(3) noise along it.

    measured = true (1 + offset + x[i])     offset: one draw a print
    x[i] = -(a1 x[i-1] + a2 x[i-2] + a3 x[i-3]) + e[i],   e white, Gaussian     one draw a bin along the road

Burg's method finds a1..a3: order by order, the reflection coefficient that makes the forward and the backward
prediction errors together smallest, which never gives an unstable filter. Several prints are fitted at once by adding
their sums.

         f[i] --(+)-- f'[i] = f[i] + r b[i-1]       r = -2 sum f[i] b[i-1] / sum (f[i]^2 + b[i-1]^2)
                 X r
         b[i-1]-(+)-- b'[i] = b[i-1] + r f[i]

The numbers of `ROAD_WIDTHS` come from 9 prints of one slice by direct ink writing, 30 cross-sections each, whose
widths in pixels are published with Piovarci et al., "Closed-Loop Control of Additive Manufacturing via Reinforcement
Learning" (2022), which models them the same way (its eqs. (5) to (8)). Each print's widths are divided by their mean:
what is left is relative, hence free of the pixel, and the spread of the nine means is the offset. A width at constant
height is as good as a bead, so relative width stands for relative flow. Rounding to whole pixels is in them (0.02 of
the 0.14), and so are real faults of those prints: it is a rough camera on a rough process, and `scaled` makes a
better one. The distance of the cross-sections is not published: we take one sample as one 1 mm bin, the scoring's, so
that the noise remembers some 2 mm of road; at v mm/s one sample lasts 1 / v seconds. `tests/plants/test_noise.py`
fits the numbers again where the data is at hand.

Sources: J. P. Burg, "Maximum Entropy Spectral Analysis" (1975); Marple, IEEE Trans. ASSP 28 (1980).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.signal import lfilter

from gcodectl.columns import Floats, Ints
from gcodectl.errors import UsageError


def fit_burg(x: Floats, order: int) -> tuple[Floats, float]:
    """Return a[order] of x[i] = -sum a[m] x[i - 1 - m] + e[i], and the variance of e, by Burg's method.

    x: one record [n], or several of equal length [records, n]; zero mean is assumed. Raises UsageError where a record
    has no more than `order` samples.
    """
    records = np.atleast_2d(np.asarray(x, dtype=np.float64))
    if not 0 < order < records.shape[1]:
        raise UsageError(
            f"a noise model of order {order} needs more than {order} samples; there are {records.shape[1]}"
        )
    forward, backward = records[:, 1:], records[:, :-1]
    a = np.ones(1)
    variance = float(np.mean(records**2))
    for _ in range(order):
        power = float(np.sum(forward**2 + backward**2))
        reflection = -2.0 * float(np.sum(forward * backward)) / power if power > 0 else 0.0
        padded = np.append(a, 0.0)
        a = padded + reflection * padded[::-1]
        variance *= 1.0 - reflection**2
        forward, backward = (forward + reflection * backward)[:, 1:], (backward + reflection * forward)[:, :-1]
    return a[1:], variance


@dataclasses.dataclass(frozen=True)
class MeasurementNoise:
    """Relative error of a measured flow; sampled with the caller's random generator."""

    coefficients: tuple[float, ...]
    """a1.. of the AR model."""
    variance: float
    """Of its white input."""
    offset: float
    """Standard deviation of a print's offset, relative."""
    spacing: float = 1.0
    """Distance along the road from sample to sample, mm."""

    @property
    def deviation(self) -> float:
        """Standard deviation of the AR part once it has settled, relative."""
        impulse = lfilter([1.0], [1.0, *self.coefficients], np.eye(1, 4096)[0])
        return float(np.sqrt(self.variance * np.sum(impulse**2)))

    def scaled(self, factor: float) -> MeasurementNoise:
        """Return the noise of a camera `factor` times as bad."""
        return dataclasses.replace(self, variance=self.variance * factor**2, offset=self.offset * factor)

    def sample(self, n: int, rng: np.random.Generator) -> Floats:
        """Return the relative error of `n` bins of one print: an offset, and AR noise that has settled before."""
        sampled: Floats = rng.normal(0.0, self.offset) + self._road(n, rng)
        return sampled

    def along(self, s: Floats, rng: np.random.Generator) -> Floats:
        """Return the relative error at the places s[n] of one print, mm along the road, constant within a bin.

        At speed v, `s = v * t` makes it a noise over time whose memory is that of the bins, over v.
        """
        bins: Ints = np.floor((s - np.min(s, initial=np.inf)) / self.spacing).astype(np.int64)
        sampled: Floats = self.sample(int(bins.max(initial=-1)) + 1, rng)[bins]
        return sampled

    def _road(self, n: int, rng: np.random.Generator) -> Floats:
        settle = 500
        white = rng.normal(0.0, np.sqrt(self.variance), n + settle)
        road: Floats = np.asarray(lfilter([1.0], [1.0, *self.coefficients], white), dtype=np.float64)
        return road[settle:]


ROAD_WIDTHS = MeasurementNoise((-0.58509, -0.00130, 0.03669), variance=0.012652, offset=0.19576)
"""Fitted to the measured widths, see above; relative deviation 0.14 along the road, 0.20 from print to print."""


def fit_noise(widths: Floats, order: int = 3, spacing: float = 1.0) -> MeasurementNoise:
    """Return the noise of `widths` [prints, sections], any unit: AR within the prints, offset between them."""
    means = widths.mean(axis=1)
    a, variance = fit_burg(widths / means[:, None] - 1.0, order)
    offset = float(np.std(means / means.mean(), ddof=1))
    return MeasurementNoise(tuple(float(one) for one in a), variance, offset, spacing)
