"""What every plant must hold to, and how one is named."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcodectl.errors import UsageError
from plant_models.builtin import RECIPES
from plant_models.plant import Plant, load_plant, plant_names

DT = 0.01


def pulse(flow: float) -> np.ndarray:
    """Rest, a wandering push, a retract, a push again, rest."""
    wander = flow * (1 + 0.5 * np.sin(np.arange(150) * 0.2))
    return np.concatenate([np.zeros(20), wander, np.full(20, -3 * flow), np.full(60, 2 * flow), np.zeros(50)])


@pytest.mark.parametrize("name", plant_names())
def test_builtins_are_plants_that_leave_their_arguments_alone(name: str) -> None:
    plant = load_plant(name)
    assert isinstance(plant, Plant)
    state, u = plant.initial(), pulse(RECIPES[name].flow)
    before, u_before = state.copy(), u.copy()
    state.flags.writeable = u.flags.writeable = False
    after, q = plant.run(state, u, DT)
    assert q.shape == u.shape
    assert np.isfinite(q).all()
    assert np.isfinite(after).all()
    np.testing.assert_array_equal(state, before)
    np.testing.assert_array_equal(u, u_before)
    np.testing.assert_array_equal(plant.run(state, u, DT)[1], q)


@pytest.mark.parametrize("name", plant_names())
@settings(max_examples=12, deadline=None)
@given(
    cuts=st.lists(st.integers(0, 300), max_size=6).map(sorted), parameters=st.sampled_from(((1.0, 1.0), (1.15, 0.85)))
)
def test_pieces_give_exactly_the_flow_of_one_run(name: str, cuts: list[int], parameters: tuple[float, float]) -> None:
    plant = load_plant(name, seed=3, gain=parameters[0], lag=parameters[1])
    u = pulse(RECIPES[name].flow)
    end, whole = plant.run(plant.initial(), u, DT)
    state, pieces = plant.initial(), []
    for piece in np.split(u, cuts):
        state, q = plant.run(state, piece, DT)
        pieces.append(q)
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
    np.testing.assert_array_equal(state, end)


@pytest.mark.parametrize("name", plant_names())
def test_a_plant_scales_with_its_nominal_flow(name: str) -> None:
    small, large = load_plant(name, flow=2.0), load_plant(name, flow=600.0)
    q_small = small.run(small.initial(), pulse(2.0), DT)[1]
    q_large = large.run(large.initial(), pulse(600.0), DT)[1]
    np.testing.assert_allclose(q_large, 300 * q_small, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", plant_names())
def test_gain_and_lag_do_what_they_say(name: str) -> None:
    flow = RECIPES[name].flow

    def settled(plant: Plant) -> tuple[float, float]:
        """Steady flow, and the time from the step to half of it after a stay at 0.7 of the nominal flow."""
        state, _ = plant.run(plant.initial(), np.full(15000, 0.7 * flow), DT)
        start = plant.run(state, np.full(1, 0.7 * flow), DT)[1][0]
        _, q = plant.run(state, np.full(15000, flow), DT)
        return float(q[-1]), float(np.argmax(q > (start + q[-1]) / 2))

    if "drift" in RECIPES[name].parameters:
        plain, more, slow = (load_plant(name, drift=0.0, **extra) for extra in ({}, {"gain": 1.15}, {"lag": 2.0}))
    else:
        plain, more, slow = load_plant(name), load_plant(name, gain=1.15), load_plant(name, lag=2.0)
    assert settled(more)[0] == pytest.approx(1.15 * settled(plain)[0], rel=0.02)
    assert settled(slow)[0] == pytest.approx(settled(plain)[0], rel=1e-3)
    assert settled(slow)[1] > 1.3 * settled(plain)[1]


@pytest.mark.parametrize("name", ["syringe", "syringe-drift", "pneumatic", "melt", "pellet"])
def test_the_seed_decides_what_is_random(name: str) -> None:
    u = np.full(500, RECIPES[name].flow)

    def flow(seed: int) -> np.ndarray:
        plant = load_plant(name, seed=seed, drift=0.05)
        return plant.run(plant.initial(), u, DT)[1]

    np.testing.assert_array_equal(flow(1), flow(1))
    assert np.abs(flow(1) - flow(2)).max() > 1e-3 * RECIPES[name].flow


def test_an_unknown_name_lists_the_plants() -> None:
    with pytest.raises(UsageError, match=r"no plant 'clay'.*paste-a.*syringe-thixo"):
        load_plant("clay")


def test_an_unknown_parameter_lists_the_parameters() -> None:
    with pytest.raises(UsageError, match=r"'viscosity'; there are K, tau, dead, gain, lag"):
        load_plant("paste-a", viscosity=3.0)


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("paste-a", "tau", 0.0),
        ("paste-a", "gain", float("nan")),
        ("syringe", "n", 1.5),
        ("syringe", "n", 0.0),
        ("syringe", "P_y", -1.0),
        ("syringe", "dead", -0.1),
        ("syringe", "backlash", -0.1),
        ("syringe", "drift", -0.1),
        ("syringe", "drive_lag", -1.0),
        ("syringe", "max_flow", -1.0),
        ("syringe", "primed", 1.1),
        ("pneumatic", "vacuum", -1.0),
        ("melt", "tau", -1.0),
        ("pellet", "zeta", 0.0),
        ("pellet", "drift_period", 0.0),
    ],
)
def test_a_number_that_makes_no_sense_is_refused(name: str, parameter: str, value: float) -> None:
    with pytest.raises(UsageError, match="it must"):
        load_plant(name, **({"drift": 0.1} if parameter == "drift_period" else {}), **{parameter: value})


FILE = """
from plant_models.linear import Linear

class Mine(Linear):
    def __init__(self, K=2.0, tau=1.0):
        super().__init__(K, tau)

def make(seed, flow=7.0, tau=1.0):
    return Linear(flow, tau + seed)

def nothing():
    return 5

ready = Linear(3.0, 1.0)
number = 5
"""


@pytest.fixture
def plant_file(tmp_path: Path) -> str:
    path = tmp_path / "mine.py"
    path.write_text(FILE, encoding="utf-8")
    return str(path)


def test_a_file_gives_its_class_its_function_or_its_plant(plant_file: str) -> None:
    def steady(plant: Plant) -> float:
        return float(plant.run(plant.initial(), np.ones(4000), DT)[1][-1])

    assert steady(load_plant(f"{plant_file}:Mine")) == pytest.approx(2.0)
    assert steady(load_plant(f"{plant_file}:Mine", K=4.0)) == pytest.approx(4.0)
    assert steady(load_plant(f"{plant_file}:ready")) == pytest.approx(3.0)
    assert steady(load_plant(f"{plant_file}:make", seed=1)) == pytest.approx(7.0)
    assert steady(load_plant(f"{plant_file}:make", flow=2.0, tau=0.5)) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("attribute", "parameters", "message"),
    [
        (":Yours", {}, r"has no 'Yours'; it has Mine, make, nothing, ready"),
        ("", {}, r"say which plant .* it has Mine, make, nothing, ready"),
        (":", {}, r"has no ''; it has Mine"),
        (":number", {}, "is no plant: it needs initial"),
        (":nothing", {}, "is no plant: it needs initial"),
        (":Mine", {"viscosity": 1.0}, r"no such parameter as 'viscosity'; there are K, tau"),
        (":ready", {"gain": 1.15}, "takes no gain"),
        (":make", {"tau": -5.0}, "must be a positive number"),
    ],
)
def test_a_file_that_has_no_such_plant(
    plant_file: str, attribute: str, parameters: dict[str, float], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        load_plant(plant_file + attribute, **parameters)


def test_a_file_that_is_missing_or_broken(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no plant file"):
        load_plant(f"{tmp_path}/none.py:Mine")
    (tmp_path / "broken.py").write_text("1 / 0", encoding="utf-8")
    with pytest.raises(UsageError, match="does not load: ZeroDivisionError"):
        load_plant(f"{tmp_path}/broken.py:Mine")
    (tmp_path / "empty.py").write_text("def make(a, b): return a", encoding="utf-8")
    with pytest.raises(UsageError, match="cannot be called: "):
        load_plant(f"{tmp_path}/empty.py:make")
    (tmp_path / "bare.py").write_text("number = 5", encoding="utf-8")
    with pytest.raises(UsageError, match="it has nothing that could be a plant"):
        load_plant(f"{tmp_path}/bare.py:make")
