"""The rotary head: who is in place when, and what the others leave behind."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcodectl.errors import UsageError
from plant_models.actuator import Direct
from plant_models.head import Head, place_kernel
from plant_models.plant import load_plant

DT = 0.01


def test_a_switch_takes_its_time() -> None:
    head = Head([Direct(), Direct()], switch=0.05)
    tool = np.repeat([0, 1, 0], [3, 9, 2])
    _, over = head.over(head.initial(), tool, DT)
    np.testing.assert_array_equal(over, [0] * 3 + [-1] * 5 + [1] * 4 + [-1] * 2)
    _, over = head.over(head.initial(1), tool, DT)
    assert over[0] == -1


@pytest.mark.parametrize("dt", [0.001, 0.004, 0.01, 0.1])
def test_the_dwell_is_one_second_at_any_sample(dt: float) -> None:
    head = Head([Direct()] * 4)
    _, over = head.over(head.initial(), np.full(2000, 3), dt)
    assert (over == -1).sum() == round(1.0 / dt)
    assert set(over[over >= 0]) == {3}


def test_every_plunger_follows_its_own_row() -> None:
    head = Head([Direct(), Direct(), Direct()])
    u = np.arange(12.0).reshape(3, 4)
    _, q = head.run(head.initial(), u, np.array([0, 0, 2, 2]), DT)
    np.testing.assert_array_equal(q, u)


def test_a_system_that_was_not_stopped_oozes_while_another_prints() -> None:
    head = Head([load_plant("syringe"), load_plant("syringe-fast")])
    u = np.zeros((2, 2000))
    u[0, :1000] = 5.0
    u[1, 1100:] = 5.0
    tool = np.repeat([0, 1], 1000)
    state, q = head.run(head.initial(), u, tool, DT)
    _, over = head.over(head.initial(), tool, DT)
    oozed = q[0, over != 0].sum() * DT
    assert oozed > 2.0
    assert q[1, -1] == pytest.approx(5.0, rel=1e-3)
    assert q[1, :1100].sum() == 0.0
    alone = load_plant("syringe")
    np.testing.assert_array_equal(alone.run(alone.initial(), u[0], DT)[1], q[0])
    assert len(state) > 2


@settings(deadline=None, max_examples=20)
@given(st.lists(st.integers(0, 300), max_size=5).map(sorted))
def test_pieces_give_exactly_the_flow_of_one_run(cuts: list[int]) -> None:
    head = Head([load_plant("syringe-dead"), load_plant("paste-a"), load_plant("syringe-thixo")])
    rng = np.random.default_rng(6)
    u, tool = rng.uniform(-5.0, 10.0, (3, 300)), np.repeat(rng.integers(0, 3, 6), 50)
    end, whole = head.run(head.initial(), u, tool, DT)
    state, pieces = head.initial(), []
    for begin, stop in zip([0, *cuts], [*cuts, 300], strict=True):
        state, q = head.run(state, u[:, begin:stop], tool[begin:stop], DT)
        pieces.append(q)
    np.testing.assert_array_equal(np.concatenate(pieces, axis=1), whole)
    np.testing.assert_array_equal(state, end)


def test_only_what_the_head_carries_can_be_asked_for() -> None:
    head = Head([Direct(), Direct()])
    with pytest.raises(UsageError, match="no T2; it carries T0 to T1"):
        head.run(head.initial(), np.zeros((2, 3)), np.array([0, 1, 2]), DT)
    with pytest.raises(UsageError, match="1 to 4 systems, not 5"):
        Head([Direct()] * 5)
    with pytest.raises(UsageError, match="switch is -1"):
        Head([Direct()], switch=-1.0)


def test_the_kernel_does_the_same_in_plain_python() -> None:
    tool = np.repeat([0, 2, 1, 1], 7)
    fast, slow = np.empty_like(tool), np.empty_like(tool)
    assert place_kernel(0, 0.0, tool, DT, 0.03, fast) == place_kernel.py_func(0, 0.0, tool, DT, 0.03, slow)
    np.testing.assert_array_equal(slow, fast)
