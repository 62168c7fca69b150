"""The simulated surface: what lies on the plate cools location by location, and every layer a little differently.

    dT/dt = b0 + b1 (T - T_env)        b1(s, layer) = b1 exp(SPREAD z(s) + drift(layer) + small change)
    b0 - b0_mean = -SLOPE (b1 - b1_mean)            the measured pairs lie on one line: where it cools fast, it also
                                                    stops early, so that curves fan out only slowly
    z(s)   __    __            __       _           + smooth noise along the path; corners slow (all but the one
             \\__/  \\__________/  \\_____/            where the path starts and ends), long edges fast
    drift  trend per layer + random walk            of b1; b0 follows with the setting's own pivot

    T |\\           |\\             |\\  deposited again: T = T_dep
      | '.   .      | '.   .      |      heated again by a later segment that touches: T += contact (T_dep - T)
      |   '-.|'--.._|   '-.|'--.._|
      +-----------------------------------> t

Scale and slope are those of 54 locations of a measured hexagon: log(-b1) scatters by 0.23, b0 = -121 b1 - 0.54 fits
b0 with r = -0.998. Nothing is copied from it. log(-b1) scatters by 0.10 to 0.15 here: the wall's published window of
print times allows no more. A controller may look at what a printer's does: `road` (`s`, `points`), the band, the head,
the times it chose, `free_from`, and frames of `plant_models.cooling_camera` or `readings`. `temperatures` and `truth`
are for judges, and for the controller that knows.

    part = cooling_part("wall", seed=3)                # its first layer lies there, laid from t = 0 at the usual speed
    beneath = part.print_layer(part.at_speed(250.0))   # the next one starts at 250 s; degC just before it came

Source of the law: Fathizadan, dissertation (2022), eq. (3.1); of the bumps and the heating again: section 4.1.3.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Bools, Floats
from gcodectl.errors import UsageError
from gcodectl.thermal.road import Road
from gcodectl.thermal.surface import Band, Head, Surface
from plant_models.cooling_setting import Setting, setting_of

SPREAD = 0.23
"""Unit in which log(-b1) varies along the path."""
SLOPE = 121.0
"""K; of the line that b0 and b1 lie on."""
_OFF_LINE = 0.02
"""degC/s; what b0 has beside that line."""
_CHANGE = 0.01
"""Standard deviation of log(-b1) of one location from layer to layer, drift aside."""
_CORNER, _LONG, _SHORT, _SMOOTH = -1.5, 0.4, -0.3, 0.35
"""In units of SPREAD: at a corner, on the longest edge, on the shortest, and the standard deviation of the rest."""
_REACH = 3.0
"""Bead widths over which a corner is felt."""
_TOUCH = 1.5
"""Bead widths within which a later segment heats."""
LAYERS = 400
"""How many layers the drift is drawn for."""


@dataclasses.dataclass(frozen=True)
class _Laid:
    """One layer as it was laid: its law, and when each location was deposited and heated again (inf: never)."""

    b0: Floats
    b1: Floats
    at: Floats
    again: Floats


class CoolingPart:
    """A part that grows layer by layer; deterministic for a seed. Times are s on one clock, lengths mm."""

    def __init__(self, setting: Setting, seed: int = 0) -> None:
        self.setting, self.seed = setting, seed
        ring = np.array([*setting.outline, setting.outline[0]], dtype=np.float64)
        self.road = Road.along(ring, setting.bead)
        self.s, self.points = self.road.s, self.road.xy
        self.corners = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
        self.length = float(self.corners[-1])
        self._log_rate, self._b0_aside = self._fields()
        steps = np.random.default_rng([seed, 1]).normal(setting.trend, setting.walk, LAYERS)
        steps[0] = 0.0
        self._drift = np.cumsum(steps)
        self._layers: list[_Laid] = []
        self._lay(self.at_speed(0.0))

    @property
    def band(self) -> Band:
        """What the new road wants."""
        return self.setting.band

    @property
    def head(self) -> Head:
        """What the head can do, mm and s."""
        return self.setting.head

    @property
    def layers(self) -> int:
        """How many lie there."""
        return len(self._layers)

    @property
    def deposited(self) -> Floats:
        """When each location of the top layer was deposited: the controller's own doing."""
        return self._layers[-1].at

    @property
    def free_from(self) -> float:
        """When the head is done with the layer, later segments included: none may start before."""
        return float(self._tour()[0][-1])

    def at_speed(self, start: float, speed: float | None = None) -> Floats:
        """Return when each location is passed by a head that starts at `start` at one speed (None: the usual one)."""
        return np.asarray(start + self.s / (speed or self.setting.speed))

    def print_layer(self, times: Floats) -> Floats:
        """Lay a layer over the top one, each location at its time; return what lay there just before, degC.

        Raises UsageError unless there is a time for each location, they rise, and none is before `free_from`.
        """
        at = np.asarray(times, dtype=np.float64)
        if at.shape != self.s.shape or not np.isfinite(at).all() or np.any(np.diff(at) <= 0):
            raise UsageError(f"a layer of this part takes {len(self.s)} times that rise, one a location")
        if at[0] < self.free_from - 1e-9:
            raise UsageError(
                f"the head is at work on the layer until {self.free_from:.2f} s; {at[0]:.2f} s is too early"
            )
        before = self.temperatures(at)
        self._lay(at)
        return before

    def temperatures(self, times: Floats | float, layer: int = -1) -> Floats:
        """Return the true temperature of each location of a layer, degC: at one time, at its own, or [n, times].

        `times`: a number, one a location, or a row of shape (1, times) for all. NaN before it was deposited.
        """
        laid = self._layers[layer]
        t = np.asarray(times, dtype=np.float64)
        rows = (slice(None),) + (None,) * (t.ndim - 1)
        env, top = self.band.ambient, self.band.deposition
        at, again, b1 = laid.at[rows], laid.again[rows], laid.b1[rows]
        rest = (env - laid.b0 / laid.b1)[rows]
        once = rest + (top - rest) * np.exp(b1 * np.maximum(t - at, 0.0))
        heated = np.isfinite(again)
        since = np.where(heated, again, at)
        then = rest + (top - rest) * np.exp(b1 * (since - at))
        then = then + self._contact[rows] * (top - then)
        twice = rest + (then - rest) * np.exp(b1 * np.maximum(t - since, 0.0))
        return np.asarray(np.where(t < at, np.nan, np.where(heated & (t >= again), twice, once)))

    def truth(self, layer: int = -1, laid: Floats | None = None) -> Surface:
        """Return how a layer cools, each location from when it was last heated.

        `laid`: for a layer that is still to come (`layers` is the next one), when it will be deposited.
        """
        one = self._law(layer if layer >= 0 else self.layers + layer, laid) if laid is not None else self._layers[layer]
        env, top = self.band.ambient, self.band.deposition
        rest = env - one.b0 / one.b1
        t0: Floats = np.where(np.isfinite(one.again), one.again, one.at)
        then = rest + (top - rest) * np.exp(one.b1 * (t0 - one.at))
        temp0 = np.where(np.isfinite(one.again), then + self._contact * (top - then), top)
        return Surface(s=self.s, b0=one.b0, b1=one.b1, t0=t0, temp0=temp0)

    def readings(self, times: Floats, noise: float = 1.0) -> Floats:
        """Return temperatures [n, times] of the top layer as an unhindered camera would have them: with noise, degC."""
        rng = np.random.default_rng([self.seed, 2, self.layers])
        true = self.temperatures(np.asarray(times, dtype=np.float64)[None, :])
        return np.asarray(true + noise * rng.standard_normal(true.shape))

    def head_at(self, t: float, layer: int = -1) -> Floats | None:
        """Return where the head stands while it prints a layer, mm, shape (2,); None where it is parked."""
        when, where = self._tour(layer)
        if not when[0] <= t <= when[-1]:
            return None
        return np.array([np.interp(t, when, where[:, 0]), np.interp(t, when, where[:, 1])])

    def _tour(self, layer: int = -1) -> tuple[Floats, Floats]:
        """Return when and where the head is in a layer: on the outline, then on what comes later."""
        at = self._layers[layer].at
        rest = self.length - self.s[-1]
        end = at[-1] + rest * (at[-1] - at[-2]) / (self.s[-1] - self.s[-2])
        start = np.array(self.setting.outline[:1])
        if not self.setting.later:
            return np.append(at, end), np.concatenate([self.points, start])
        later = np.concatenate([start, np.array(self.setting.later)])
        steps = np.linalg.norm(np.diff(later, axis=0), axis=1)
        when = end + np.concatenate([[0.0], np.cumsum(steps)]) / self.setting.later_speed
        return np.concatenate([at, when]), np.concatenate([self.points, later])

    def _lay(self, at: Floats) -> None:
        self._layers.append(self._law(self.layers, at))

    def _law(self, layer: int, at: Floats) -> _Laid:
        """Return the law of a layer, laid at these times."""
        one = self.setting
        rng = np.random.default_rng([self.seed, 3, layer])
        usual = one.b1 * np.exp(self._log_rate)
        b1 = usual * np.exp(self._drift[min(layer, LAYERS - 1)] + _CHANGE * self._smooth(rng))
        b0 = one.b0 - SLOPE * (usual - one.b1) - one.pivot * (b1 - usual) + self._b0_aside
        return _Laid(b0, b1, np.array(at), np.where(self._touched, at[-1] + self._delay, np.inf))

    def _fields(self) -> tuple[Floats, Floats]:
        """Return log(b1 / mean b1) of each location, and b0 beside the line; find where later segments touch."""
        rng = np.random.default_rng([self.seed, 0])
        edges = np.diff(self.corners)
        edge = np.searchsorted(self.corners, self.s, side="right") - 1
        size = (edges - edges.min()) / max(float(np.ptp(edges)), 1e-9)
        z = (_SHORT + (_LONG - _SHORT) * size)[edge] + _SMOOTH * self._smooth(rng)
        for corner in self.corners[1:-1]:
            away = (self.s - corner) / (_REACH * self.setting.bead)
            z = z + (_CORNER - z) * np.exp(-(away**2))
        self._touched, self._delay, self._contact = self._contacts()
        return SPREAD * z, _OFF_LINE * abs(self.setting.b1) / 0.0125 * self._smooth(rng)

    def _smooth(self, rng: np.random.Generator) -> Floats:
        """Return noise along the closed path, standard deviation 1, smooth over a fifteenth of it."""
        count = len(self.s)
        waves = np.fft.rfftfreq(count, 1.0 / count)
        spectrum = np.fft.rfft(rng.standard_normal(count)) * np.exp(-0.5 * (waves * 2 * np.pi / 15 / 2) ** 2)
        smooth: Floats = np.fft.irfft(spectrum, count)
        weight = np.exp(-((waves * 2 * np.pi / 15 / 2) ** 2)) * np.where((waves == 0) | (2 * waves == count), 1, 2)
        return np.asarray(smooth / np.sqrt(weight.sum() / count))

    def _contacts(self) -> tuple[Bools, Floats, Floats]:
        """Return which locations a later segment touches, how long after the last location, and how hard."""
        one, count = self.setting, len(self.s)
        delay, contact = np.zeros(count), np.zeros(count)
        if not (one.later and one.contact):
            return contact > 0, delay, contact
        path = np.concatenate([np.array(one.outline[:1]), np.array(one.later)])
        rib = Road.along(path, one.bead, one.bead / 4)
        away = np.linalg.norm(self.points[:, None, :] - rib.xy[None, :, :], axis=2)
        away[:, rib.s < one.bead * _REACH] = np.inf  # it sets out from the outline's end: that is no contact
        nearest = away.argmin(axis=1)
        gap = away[np.arange(count), nearest] / one.bead
        contact = np.where(gap < _TOUCH, one.contact * np.clip((_TOUCH - gap) / (_TOUCH - 1.0), 0.0, 1.0), 0.0)
        seam = (self.length - self.s[-1]) / one.speed
        return contact > 0, seam + rib.s[nearest] / one.later_speed, contact


def cooling_part(name: str, seed: int = 0) -> CoolingPart:
    """Return a stock part, its first layer laid from t = 0; UsageError that lists what there is."""
    return CoolingPart(setting_of(name), seed)
