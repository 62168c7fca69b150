"""Lines eased to what the firmware takes: the bounds, and the debts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcodectl.columns import Floats
from gcodectl.config import load_machine
from gcodectl.gcode.bounds import (
    AT_ONCE,
    BACK_ACCEL,
    BACK_SPEED,
    BEAD,
    CORNER,
    FORTH_ACCEL,
    FORTH_SPEED,
    KEEP,
    LEAST_STEPS,
    N_BOUNDS,
    bounds_of,
)
from gcodectl.gcode.ease import MOST_OWED, eased_kernel, fewest_steps_kernel, repaid_kernel
from gcodectl.gcode.packed import AREA as AREA_COLUMN
from gcodectl.gcode.packed import DISTANCE, KIND, N_STATE, NOMINAL, OWED, RATIO, X0, X1, E, e_digits_kernel, new_state
from gcodectl.records import Kind

AREA = 2.0
PATH = 0.1


def unlimited() -> Floats:
    """A state in which the firmware takes everything."""
    state = np.zeros(N_STATE)
    state[:N_BOUNDS], state[AREA_COLUMN], state[AT_ONCE] = np.inf, AREA, 0.0
    return state


def line(
    volume: float,
    entry: float = 10.0,
    accel: float = 0.0,
    before: float = 0.0,
    owed: float = 0.0,
    nominal: float = 1e9,
    **limits: float,
) -> float:
    """What is said on 0.1 mm at 10 mm/s, as a ratio of E to path, debts included."""
    names = {"corner": CORNER, "bead": BEAD, "speed": FORTH_SPEED, "accel": FORTH_ACCEL,
             "back_speed": BACK_SPEED, "back_accel": BACK_ACCEL, "at_once": AT_ONCE}  # fmt: skip
    state = unlimited()
    for name, value in limits.items():
        state[names[name.removeprefix("most_")]] = value
    state[RATIO], state[OWED], state[NOMINAL] = before, owed, nominal
    both = [f(volume, PATH, entry, 10.0, accel, state) for f in (eased_kernel, eased_kernel.py_func)]
    assert both[0] == both[1]
    return float((both[0] + owed) / (PATH * AREA))


def test_what_may_be_said_is_said_as_it_is() -> None:
    assert line(0.123456) == pytest.approx(0.123456 / 0.2)
    assert line(0.02, corner=2.0, owed=0.001) == pytest.approx(0.105)


def test_every_limit_holds() -> None:
    assert line(1.0, most_bead=2.0) == pytest.approx(1.0)
    assert line(1.0, most_speed=3.0) == pytest.approx(0.3)
    assert line(1.0, accel=100.0, most_accel=50.0) == pytest.approx(0.5)
    assert line(-1.0, accel=100.0, most_back_accel=50.0) == pytest.approx(-0.5)
    assert line(-1.0, most_back_speed=3.0) == pytest.approx(-0.3)
    assert line(1.0, corner=1.0, before=0.2) == pytest.approx(0.3)
    assert line(-1.0, corner=1.0, before=0.2) == pytest.approx(0.1)
    assert line(1.0, entry=0.0, corner=1.0) == pytest.approx(5.0)  # from rest E may begin at any speed


def test_a_bead_may_be_as_thick_as_it_likes_where_there_is_next_to_nothing_in_the_line() -> None:
    assert line(0.5, most_bead=2.0, most_at_once=0.6) == pytest.approx(2.5)
    assert line(1.0, most_bead=2.0, most_at_once=0.6) == pytest.approx(3.0)
    assert line(1.0, most_bead=8.0, most_at_once=0.6) == pytest.approx(4.0)


def test_no_more_is_owed_for_a_junction_than_a_moment_of_flow_and_what_is_refused_is_never_said() -> None:
    debt = MOST_OWED * 4.0 / (PATH * AREA)
    assert line(1.0, corner=1.0, nominal=4.0) == pytest.approx(5.0 - debt)
    assert line(-1.0, corner=1.0, nominal=4.0) == pytest.approx(-5.0 + debt)
    assert line(1.0, corner=1.0, nominal=4.0, most_bead=2.0) == pytest.approx(1.0)


@given(st.floats(-50, 50), st.floats(0.01, 5))
def test_a_debt_is_paid_no_faster_than_it_can_be_taken_back(owed: float, step: float) -> None:
    x = repaid_kernel.py_func(owed, step)
    assert x == repaid_kernel(owed, step)
    assert abs(x) <= abs(owed) + 1e-12
    ramp = np.arange(abs(x), 0.0, -step).sum()
    assert ramp <= abs(owed) * (1 + 1e-9) + 0.126 * step  # the formula is that of whole steps


@settings(max_examples=50)
@given(st.lists(st.sampled_from([0.0, 0.02, 0.2, 1.0, -0.1]), min_size=1, max_size=30), st.floats(0.2, 5.0))
def test_no_volume_is_lost_and_no_step_too_large(volumes: list[float], corner: float) -> None:
    state = unlimited()
    state[CORNER], state[NOMINAL] = corner, 1e9
    total, ratios = 0.0, [0.0]
    for volume in [*volumes, *[0.0] * 4000]:
        said = eased_kernel(volume, PATH, 10.0, 10.0, 0.0, state)
        moved = said + state[OWED]
        total += moved
        state[OWED] += volume - moved
        state[RATIO] = moved / (PATH * AREA)
        ratios.append(float(state[RATIO]))
    assert np.abs(np.diff(ratios)).max() <= corner / 10.0 * (1 + 1e-9)
    assert total + state[OWED] == pytest.approx(sum(volumes), abs=1e-9)
    assert abs(state[OWED]) < 1e-6
    # debts do not ring: what is said beyond what was ever asked for is bounded by what was asked for and one step
    span = max([0.0, *volumes]) - min([0.0, *volumes])
    assert np.abs(ratios).max() <= 3.0 * span / (PATH * AREA) + corner / 10.0


def test_steps_limit_the_number_of_lines() -> None:
    marlin, klipper = new_state(load_machine("syringe")), new_state(load_machine("syringe-klipper"))
    assert marlin[LEAST_STEPS] == 6
    for state in (marlin, klipper):
        state[X0 : X1 + 3] = 0.0
        state[X1], state[DISTANCE], state[E], state[KIND] = 1.0, 1.0, 0.001, int(Kind.LINE)
    for kernel in (fewest_steps_kernel, fewest_steps_kernel.py_func):
        assert kernel(marlin) == pytest.approx(6 / 80)
        assert kernel(klipper) == 0.0
    marlin[E] = 1.0
    assert fewest_steps_kernel(marlin) == pytest.approx(6 / 3200)
    marlin[KIND], marlin[E], marlin[DISTANCE] = int(Kind.ARC), 0.0, 10.0
    assert fewest_steps_kernel(marlin) == pytest.approx(6 / 4000)


def test_bounds_are_the_machines() -> None:
    bounds = bounds_of(load_machine("filament-klipper"))
    assert bounds[CORNER] == KEEP
    assert bounds[FORTH_SPEED] == bounds[FORTH_ACCEL] == np.inf
    assert bounds[BACK_ACCEL] == pytest.approx(KEEP * 330)
    assert bounds[BEAD] == pytest.approx(KEEP * 0.64)
    assert bounds[AT_ONCE] == pytest.approx(KEEP * 0.64 * 0.4)
    assert bounds_of(load_machine("pellet"))[FORTH_ACCEL] == pytest.approx(KEEP * 500)


@pytest.mark.parametrize(("nozzle", "digits"), [(0.4, [5, 7, 7]), (0.84, [5, 6, 6]), (5.0, [5, 5, 5])])
def test_e_has_the_digits_that_a_short_line_needs(nozzle: float, digits: list[int]) -> None:
    for kernel in (e_digits_kernel, e_digits_kernel.py_func):
        assert [kernel(area, nozzle) for area in (2.405, 196.07, 314.16)] == digits
