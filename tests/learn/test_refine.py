"""The refined plan: its gradient, its limits, and that it is better than the inversion's."""

from __future__ import annotations

import numpy as np
import pytest

from gcodectl.columns import Floats
from gcodectl.flow.flow_model import STATE, FlowModel
from gcodectl.flow.inversion import Inversion
from gcodectl.learn.reference import Routine, training_routine, with_levels
from gcodectl.learn.refine import Refinement, adjoint_kernel, refined, slopes_kernel
from gcodectl.learn.segmentation import find_segments

DT = 0.02
MODELS = {
    "linear": FlowModel("linear", K=0.9, flow=4.0, store=4.0, delay=0.13),
    "plunger": FlowModel("plunger", K=1.0, flow=4.0, store=5.0, threshold=1.5, power=2.2),
    "backlash": FlowModel("backlash", K=1.0, flow=4.0, store=4.0, threshold=0.5, power=1.6, gap=0.8, delay=0.05),
    "pressure": FlowModel("pressure", K=1.2, flow=4.0, store=4.0, threshold=1.0, power=1.5, lag=1.0, pull=8.0),
    "screw": FlowModel("screw", K=1.3, flow=4.0, store=2.0, power=1.8, leak=0.3, swing=0.2, damping=0.5),
}  # fmt: skip


def routine() -> Routine:
    return with_levels(training_routine(4.0, lag=1.0, speed=7.0, dt=DT))


def rms(model: FlowModel, u: Floats, reference: Floats) -> float:
    return float(np.sqrt(np.mean((model.predict(u, DT) - reference) ** 2)))


@pytest.mark.parametrize("name", MODELS)
def test_the_gradient_is_the_costs(name: str) -> None:
    model, reference = MODELS[name], routine().q_ref
    rng = np.random.default_rng(1)
    u = np.maximum(reference + np.convolve(rng.normal(0.0, 8.0, len(reference)), np.ones(9) / 9.0, "same"), -7.9)
    problem = Refinement(model, reference, DT, rest=0.2 * model.threshold - 0.1)
    cost, gradient = problem.cost(u)
    assert cost >= rms(model, u, reference) ** 2 * (1.0 - 1e-12)
    for _ in range(5):
        way = rng.normal(size=len(u))
        ahead, behind = (problem.cost(u + sign * 1e-5 * way)[0] for sign in (1.0, -1.0))
        assert gradient @ way == pytest.approx((ahead - behind) / 2e-5, rel=2e-3, abs=1e-4 * np.linalg.norm(gradient))


@pytest.mark.parametrize("name", MODELS)
def test_the_plan_is_better_than_the_inversions_and_within_the_limits(name: str) -> None:
    model, reference = MODELS[name], routine().q_ref
    inversion = Inversion(model, 20.0, 400.0, DT)
    plan = refined(inversion, reference)
    assert rms(model, plan, reference) < 0.99 * rms(model, inversion.along(reference), reference)
    assert np.abs(plan).max() <= 20.0 + 1e-9
    assert np.abs(np.diff(plan)).max() <= 400.0 * DT * (1 + 1e-9)


def test_a_plan_begins_at_rest() -> None:
    """Of a paste that oozes at rest: what is stored for that is taken back first, and as quickly as the plunger can."""
    paste = FlowModel("plunger", K=1.0, flow=5.0, store=11.0, threshold=-1.7, power=2.2)
    task = with_levels(training_routine(5.0, lag=3.0, dt=0.01))
    plan = refined(Inversion(paste, 25.0, 2000.0, 0.01), task.q_ref)
    assert plan[:5].min() < 0.0
    assert np.abs(np.diff(plan, prepend=0.0)).max() <= 20.0 * (1 + 1e-9)


def test_what_cannot_be_bettered_stays() -> None:
    """Where nothing is to flow, the inversion's plan is exact: back to the pre-charge, and rest."""
    inversion, nothing = Inversion(MODELS["linear"], 20.0, 400.0, DT), np.zeros(200)
    assert np.array_equal(refined(inversion, nothing), inversion.along(nothing))


def test_no_void_is_drawn_to_stop_flow_at_once() -> None:
    """A model says that nothing flows below its threshold; what a plan leaves there is air in a nozzle."""
    model, reference = MODELS["linear"], routine().q_ref
    plan = refined(Inversion(model, 20.0, 400.0, DT), reference)
    lag, stored = model.store / model.flow, [0.0]
    for rate in plan:  # a linear extruder, whose flow may be negative
        stored.append(stored[-1] + DT * (model.K * rate - stored[-1] / lag))
    assert min(stored) / lag > -0.3 * model.flow


@pytest.mark.parametrize("name", ["backlash", "screw"])
def test_kernels_give_the_same_without_the_jit(name: str) -> None:
    model = MODELS[name]
    u, price, worth = np.random.default_rng(2).normal(2.0, 4.0, (3, 40))
    found = []
    for forwards, backwards in (
        (slopes_kernel, adjoint_kernel), (slopes_kernel.py_func, adjoint_kernel.py_func)
    ):  # fmt: skip
        q, stored, gradient = np.empty((3, 40))
        slopes = np.empty((40, STATE + 1, STATE + 1))
        forwards(model.at_rest, np.empty(STATE), np.full(STATE + 1, 1e-4), u, DT, model.parameters, q, stored, slopes)
        backwards(price, worth, slopes, np.empty(STATE), np.empty(STATE), gradient)
        found.append((q, stored, slopes, gradient))
    for compiled, plain in zip(*found, strict=True):
        assert np.array_equal(compiled, plain)


@pytest.mark.parametrize("name", MODELS)
def test_a_refined_signal_ends_where_the_inversions_does(name: str) -> None:
    """Basis signals are cut from it: what rings along a road would make them as long as the road."""
    model, pulse = MODELS[name], training_routine(4.0, lag=3.0, speed=7.0, dt=DT)
    inversion = Inversion(model, 20.0, 400.0, DT)
    lengths = [
        [last - first for first, last in (found.start, found.corner, found.stop)]
        for found in (find_segments(u, pulse) for u in (inversion.along(pulse.q_ref), refined(inversion, pulse.q_ref)))
    ]
    assert all(after <= before + 0.35 / DT for before, after in zip(*lengths, strict=True))
