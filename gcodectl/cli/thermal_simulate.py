"""`gcodectl thermal simulate`: the loop closed layer by layer, from readings to a plan to the next layer's heat.

a twin of the part each:   fixed   the published layer time and speed
                           plan    readings of the layers that lie there -> fits -> forecast -> plan
                           knows   the same plan, by the part's own law instead of a forecast
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

from gcodectl.columns import Floats

if TYPE_CHECKING:
    from gcodectl.thermal.control import Past
    from gcodectl.thermal.cooling import Cooling
    from plant_models.cooling import CoolingPart

WARM_UP = 3
"""Layers that are laid at the fixed time before there is something to forecast from."""
JUMP = 8.0
"""degC from one reading to the next: no noise does that, a later road does."""
Policy = Callable[["CoolingPart"], Floats]
"""When each location of the next layer is to be passed, s."""


@dataclasses.dataclass
class Grown:
    """What came of a policy, layer by layer."""

    times: list[float] = dataclasses.field(default_factory=list)
    """s from start to start."""
    costs: list[float] = dataclasses.field(default_factory=list)
    """(4.24), its weights 1."""
    hot: list[float] = dataclasses.field(default_factory=list)
    cold: list[float] = dataclasses.field(default_factory=list)
    """Shares of locations outside the band."""
    met: Floats = dataclasses.field(default_factory=lambda: np.zeros(0))
    passed: Floats = dataclasses.field(default_factory=lambda: np.zeros(0))
    """Of the last layer: degC beneath, and s."""

    def table(self, since: int) -> dict[str, Any]:
        """For JSON; means from layer `since` on."""
        return {
            "layer_times": self.times, "costs": self.costs, "too_hot": self.hot, "too_cold": self.cold,
            "mean_time": float(np.mean(self.times[since:])), "mean_cost": float(np.mean(self.costs[since:])),
            "outside": float(np.mean(np.add(self.hot, self.cold)[since:])),
        }  # fmt: skip


def simulate_part(name: str, layers: int, seed: int, plot: Path | None, *, through_camera: bool, as_json: bool) -> None:
    """Print a part by every policy, and say what came of it."""
    import json

    from gcodectl.errors import UsageError
    from plant_models.cooling import cooling_part

    if layers <= WARM_UP:
        raise UsageError(
            f"--layers {layers}: the first {WARM_UP} are laid at the fixed time; lay {WARM_UP + 1} or more"
        )
    parts = {policy: cooling_part(name, seed) for policy in ("fixed", "plan", "knows")}
    planner = _Planner(through_camera)
    policies: dict[str, Policy] = {"fixed": at_fixed_time, "plan": planner, "knows": knowing}
    grown = {policy: grow(parts[policy], layers, policies[policy]) for policy in parts}
    since = WARM_UP
    part = parts["plan"]
    if plot is not None:
        from gcodectl.report.heat import plot_layers

        shown = {
            policy: {
                "times": one.times,
                "costs": one.costs[since:],
                "temperatures": one.met,
                "speeds": _speeds(one, part),
            }
            for policy, one in grown.items()
        }
        plot_layers(plot, shown, part.s, part.band, f"{name}, seed {seed}, {layers} layers")
        typer.echo(f"gcodectl: wrote {plot}", err=True)
    tables = {policy: one.table(since) for policy, one in grown.items()}
    if as_json:
        typer.echo(
            json.dumps({"part": name, "seed": seed, "layers": layers, "counted_from": since, "policies": tables})
        )
        return
    typer.echo(f"{name}, seed {seed}: {layers} layers on the first, counted from number {since + 1}, the first planned")
    fixed = tables["fixed"]
    for policy, one in tables.items():
        saved, gained = 1.0 - one["mean_time"] / fixed["mean_time"], 1.0 - one["mean_cost"] / fixed["mean_cost"]
        against = f"   {-saved:+.0%} time, {-gained:+.0%} objective" if policy != "fixed" else ""
        typer.echo(
            f"  {policy:6} {one['mean_time']:7.1f} s a layer, objective {one['mean_cost']:9.1f}, "
            f"{one['outside']:6.2%} of locations outside the band{against}"
        )


def grow(part: CoolingPart, layers: int, policy: Policy) -> Grown:
    """Lay layers on a part by a policy."""
    out = Grown()
    for _ in range(layers):
        start = float(part.deposited[0])
        passed = policy(part)
        met = part.print_layer(passed)
        out.times.append(float(passed[0]) - start)
        out.costs.append(float(np.sum((met - part.band.best) ** 2)) + out.times[-1])
        out.hot.append(float((met > part.band.high).mean()))
        out.cold.append(float((met < part.band.low).mean()))
        out.met, out.passed = met, passed
    return out


def at_fixed_time(part: CoolingPart) -> Floats:
    """The published policy."""
    return part.at_speed(float(part.deposited[0]) + part.setting.layer_time)


def knowing(part: CoolingPart) -> Floats:
    """The best plan by the part's own law."""
    from gcodectl.thermal.partitions import partition
    from gcodectl.thermal.speed import plan_speeds

    start = float(part.deposited[0])
    truth = part.truth()
    surface = truth.replace(t0=truth.t0 - start)
    partitions = partition(surface, part.head, part.band)
    return start + plan_speeds(surface, partitions, part.head, part.band, earliest=part.free_from - start).times


class _Planner:
    """Plans from readings of the layers that lie there; the first WARM_UP at the fixed time."""

    def __init__(self, through_camera: bool) -> None:
        self.through_camera = through_camera
        self.past: list[Past] = []
        self.delay: Floats | None = None
        """How long after the last location each one was heated again, s; NaN: never."""
        self.eye: Any = None
        """The camera, and the road that it looks at."""
        self.where: Any = None
        """Where the last layer was in the frame."""

    def __call__(self, part: CoolingPart) -> Floats:
        """Plan the next layer, then see how the one beneath cools until that comes."""
        from gcodectl.thermal.control import Past, plan_layer

        start = float(part.deposited[0])
        passed = at_fixed_time(part)
        if len(self.past) >= WARM_UP:
            made = plan_layer(
                self.past, part.s, part.deposited - start, self._heated(part) - start, part.head, part.band,
                earliest=part.free_from - start,
            )  # fmt: skip
            passed = made.plan.times + start
        self.past.append(Past(self._seen(part, passed), part.deposited))
        return passed

    def _heated(self, part: CoolingPart) -> Floats:
        laid, delay = part.deposited, self.delay
        return laid if delay is None else np.where(np.isnan(delay), laid, laid[-1] + delay)

    def _seen(self, part: CoolingPart, until: Floats) -> Cooling:
        """How the lying layer cooled, as seen until the next one covered it; takes note of what was heated again."""
        from gcodectl.thermal.cooling import fit

        times = np.arange(np.ceil(part.deposited[0]), until[0] if self.through_camera else until[-1])
        times, readings, again = (self._filmed if self.through_camera else self._read)(part, times)
        readings = np.where(times < until[:, None], readings, np.nan)
        before = np.full(len(part.s), np.nan) if self.delay is None else self.delay
        self.delay = np.where(np.isnan(before), again, before)
        return fit(times, readings, part.band.ambient, self._heated(part))

    def _read(self, part: CoolingPart, times: Floats) -> tuple[Floats, Floats, Floats]:
        """Readings that nothing hides, and how long after the last location each was heated again."""
        readings = part.readings(times)
        with np.errstate(invalid="ignore"):
            jumps = np.diff(readings, axis=1) > JUMP
        last = jumps.shape[1] - 1 - jumps[:, ::-1].argmax(axis=1)
        again = np.where(jumps.any(axis=1), times[1:][last] - part.deposited[-1], np.nan)
        for step in (1, -1, 1, -1):  # beside one that jumps the road touches as well, if too little to be told
            again = np.where(np.isnan(again), np.roll(again, step), again)
        return times, readings, again

    def _filmed(self, part: CoolingPart, times: Floats) -> tuple[Floats, Floats, Floats]:
        """The same through the camera: its frames tracked as a recording's are."""
        from gcodectl.errors import InputError
        from gcodectl.thermal.perspective import fit_perspective
        from gcodectl.thermal.road import Road
        from gcodectl.thermal.track import track
        from plant_models.cooling_camera import EMISSIVITY, Camera

        if self.eye is None:
            ring = np.array([*part.setting.outline, part.setting.outline[0]])
            self.eye = Camera(part), Road.along(ring, part.setting.bead)
            self.where = fit_perspective(*self.eye[0].matches())[0]
        camera, road = self.eye
        found = track(camera.frames(times), road, self.where, part.band, EMISSIVITY)
        if not found:
            raise InputError("the camera saw no layer being laid", source=f"layer {part.layers - 1}")
        self.where, cleaned = found[-1].registered, found[-1].cleaned
        seen = np.flatnonzero(np.isfinite(found[-1].raw).any(axis=1))
        nearest = np.abs(part.s[:, None] - road.s[seen][None, :]).argmin(axis=1)
        again = np.full(len(seen), np.nan)
        again[cleaned.heated] = cleaned.cooling.t0[cleaned.heated] - part.deposited[-1]
        return found[-1].times, cleaned.temperatures[nearest], again[nearest]


def _speeds(one: Grown, part: CoolingPart) -> Floats:
    return np.asarray(np.gradient(part.s, one.passed))
