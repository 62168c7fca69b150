"""The control's closed loop: a part grows layer by layer, and its next layer is planned from what was seen of the last.

print at the fixed times for WARM_UP layers (as published), then as planned; a twin of the part, cooling just the
same, is printed at the fixed times throughout

seen        readings of the lying layer, one a second, noise 1 degC, from where it was laid until the next came
heated      a location whose reading jumps was touched by a later segment; from then on its curve is fitted
judged      by the true temperatures beneath the new road, which the controller does not see
"""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.thermal.control import ALPHA, Past, expected, plan_layer
from gcodectl.thermal.cooling import Cooling, fit
from gcodectl.thermal.layer_time import layer_time
from gcodectl.thermal.problem import Weights
from plant_models.cooling import CoolingPart, cooling_part

Cell = dict[str, Any]
WARM_UP = 3
LAYERS = 13
"""Of the drifting wall."""
HURRY = 10.0
"""degC^2/s; the largest weight of time that chapter 3 tries."""
NOISE = 1.0
JUMP = 8.0
"""degC from one reading to the next: noise does that once in a hundred million, another road does."""


@dataclasses.dataclass(frozen=True)
class Laid:
    """A layer that was laid on another."""

    wait: float
    """s from the start of the one beneath to its own."""
    beneath: Floats
    """What it was laid on, degC."""
    cpu: float = 0.0
    widened: float = 0.0


def seen(part: CoolingPart, until: Floats, delay: Floats) -> tuple[Cooling, Floats]:
    """Return how the lying layer cooled until each location was covered, and when each was heated again.

    `until`: s; `delay`, and returned as now seen: s after the last location was laid, NaN: not heated again.
    """
    laid = part.deposited
    times = np.arange(np.ceil(laid[0]), until[-1])
    readings = np.where(times < until[:, None], part.readings(times, NOISE), np.nan)
    with np.errstate(invalid="ignore"):
        jumps = np.diff(readings, axis=1) > JUMP
    again = np.where(
        jumps.any(axis=1), times[1:][jumps.shape[1] - 1 - jumps[:, ::-1].argmax(axis=1)] - laid[-1], np.nan
    )
    for step in (1, -1, 1, -1):  # beside one that jumps, the road touches as well, if too little to be told from noise
        again = np.where(np.isnan(again), np.roll(again, step), again)
    delay = np.where(np.isnan(delay), again, delay)
    return fit(times, readings, part.band.ambient, heated_at(laid, delay)), delay


def heated_at(laid: Floats, delay: Floats) -> Floats:
    """Return when each location was heated last, s."""
    return np.where(np.isnan(delay), laid, laid[-1] + delay)


def printed(part: CoolingPart, layers: int, weights: Weights | None) -> list[Laid]:
    """Print layers, the first WARM_UP at the fixed time, the others as planned; no weights: at the fixed time too."""
    done: list[Laid] = []
    past: list[Past] = []
    delay = np.full(len(part.s), np.nan)
    for layer in range(layers):
        start = float(part.deposited[0])
        times, cpu, widened = part.at_speed(start + part.setting.layer_time), 0.0, 0.0
        if weights and layer >= WARM_UP:
            begun = time.process_time()
            laid = part.deposited
            made = plan_layer(
                past, part.s, laid - start, heated_at(laid, delay) - start, part.head, part.band,
                earliest=part.free_from - start, weights=weights,
            )  # fmt: skip
            cpu, widened = time.process_time() - begun, made.plan.widened
            times = made.plan.times + start
        if weights:
            found, delay = seen(part, times, delay)
            past.append(Past(found, part.deposited))
        done.append(Laid(float(times[0]) - start, part.print_layer(times), cpu, widened))
    return done


def objective(one: Laid, best: float) -> float:
    """The published objective (4.24), its weights 1: squares of all locations, and the start."""
    return float(np.sum((one.beneath - best) ** 2)) + one.wait


def drifting(seed: int) -> Cell:
    """13 layers that cool faster and faster: the fixed time, the forecast's, and that of one who knows the truth."""
    fixed, known, planned, average = (_timed(seed, by) for by in ("fixed", "known", "process", "ewma"))
    hurried = _timed(seed, "process", HURRY)
    part = cooling_part("drifting", seed)
    usual, band = part.setting.layer_time, part.band
    best = band.best

    def total(laid: list[Laid]) -> float:
        return sum(objective(one, best) for one in laid[WARM_UP:])

    def outside(laid: list[Laid]) -> float:
        beneath = np.stack([one.beneath for one in laid[WARM_UP:]])
        return float(max(np.mean(beneath < band.low), np.mean(beneath > band.high)))

    return {
        "part": "drifting", "seed": seed, "fixed_objective": total(fixed), "known_objective": total(known),
        "objective": total(planned), "ewma_objective": total(average), "over_known": total(planned) / total(known) - 1,
        "ewma_over_known": total(average) / total(known) - 1, "gain": 1 - total(planned) / total(fixed),
        "saved_last": 1 - float(np.mean([one.wait for one in planned[-3:]])) / usual,
        "known_saved_last": 1 - float(np.mean([one.wait for one in known[-3:]])) / usual,
        "saved": 1 - float(np.mean([one.wait for one in planned[WARM_UP:]])) / usual,
        "hurried_saved_last": 1 - float(np.mean([one.wait for one in hurried[-3:]])) / usual,
        "hurried_gain": 1 - total(hurried) / total(fixed), "outside": outside(planned),
        "hurried_outside": outside(hurried),
        "plan_cpu_s": float(np.median([one.cpu for one in planned[WARM_UP:]])),
    }  # fmt: skip


def _timed(seed: int, by: str, weight: float = 1.0) -> list[Laid]:
    """Print the drifting wall, each layer at one speed, its layer time chosen `by` one of the four."""
    part = cooling_part("drifting", seed)
    edge = 0.5 * float(part.corners[1])
    rows = np.array([int(np.abs(part.s - where).argmin()) for where in (part.corners[1], edge)])
    done: list[Laid] = []
    past: list[Past] = []
    for layer in range(LAYERS):
        start, wait, cpu = float(part.deposited[0]), part.setting.layer_time, 0.0
        if by != "fixed" and layer >= WARM_UP:
            begun = time.process_time()
            if by == "known":
                cooling = _known(part)
            else:
                cooling = expected(past, part.deposited, part.deposited, part.band, ewma=by == "ewma")
            wait = layer_time(cooling[rows], part.band, ALPHA, weight, earliest=part.free_from - start).time
            cpu = time.process_time() - begun
        times = part.at_speed(start + wait)
        if by in ("process", "ewma"):
            past.append(Past(seen(part, times, np.full(len(part.s), np.nan))[0], part.deposited))
        done.append(Laid(wait, part.print_layer(times)[rows], cpu))
    return done


def _known(part: CoolingPart) -> Cooling:
    """The lying layer's true curves, told as a fit that nothing is uncertain in but the reading."""
    true = part.truth()
    count = len(true)
    return Cooling(
        b0=true.b0, b1=true.b1, t0=true.t0, temp0=true.temp0, covariance=np.zeros((count, 9)),
        sigma2=np.full(count, NOISE**2), freedom=np.full(count, 10_000),
    )  # fmt: skip
