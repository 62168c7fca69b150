import dataclasses
import math

import numpy as np
import pytest
from following import lag

from gcodectl.errors import UsageError
from gcodectl.motion.follow import Follow, quality_named, seconds_kernel, share_of


def rise(follow: Follow, tool: int, flow: float) -> float:
    return float(seconds_kernel(follow.flow, follow.rise, tool, flow))


def fall(follow: Follow, tool: int, flow: float) -> float:
    return float(seconds_kernel.py_func(follow.flow, follow.fall, tool, flow))


def test_times_between_levels_and_beyond_them() -> None:
    follow = Follow(np.array([1.0, 2.0]), np.array([0.1, 0.4]), np.array([0.1, 0.2]), 1.0, 1.0)
    flows = (0.0, 0.5, 1.5, 2.0, 4.0)
    assert [rise(follow, 0, flow) for flow in flows] == pytest.approx([0.0, 0.1, 0.25, 0.4, 0.8])
    assert [fall(follow, 0, flow) for flow in flows] == pytest.approx([0.0, 0.1, 0.15, 0.2, 0.4])
    assert rise(follow, 0, math.nan) == 0.0


def test_every_tool_has_its_own_times_and_the_last_stands_for_the_rest() -> None:
    follow = Follow(np.array([[1.0, 2.0], [1.0, 3.0]]), np.array([[1, 2.0], [10, 30]]), np.ones((2, 2)), 1.0, 0.5)
    assert [rise(follow, tool, 2.0) for tool in (0, 1, 7, -1)] == [2.0, 20.0, 20.0, 2.0]


def test_the_lag_by_hand_is_what_its_law_says() -> None:
    follow = lag(1.0, tau=2.0, cap=25.0)
    assert rise(follow, 0, 5.0) == pytest.approx(2 * math.log(25 / 20))
    assert fall(follow, 0, 5.0) == pytest.approx(2 * math.log(30 / 25))


@pytest.mark.parametrize(
    "wrong",
    [
        {"flow": [[2.0, 1.0]]}, {"flow": [[0.0, 1.0]]}, {"rise": [[0.1]]}, {"rise": [[0.2, 0.1]]},
        {"fall": [[0.1, math.inf]]}, {"fall": [[-0.1, 0.2]]}, {"start": -1.5}, {"stop": math.nan}, {"peak": 0.0},
    ],
)  # fmt: skip
def test_what_is_no_such_table_is_refused(wrong: dict[str, object]) -> None:
    fine = Follow(np.array([[1.0, 2.0]]), np.array([[0.1, 0.2]]), np.array([[0.1, 0.2]]), 0.5, 0.5)
    with pytest.raises(UsageError, match="what an extruder can follow"):
        dataclasses.replace(fine, **{name: np.array(v) if isinstance(v, list) else v for name, v in wrong.items()})


def test_quality_has_three_names_and_all_numbers_between() -> None:
    assert [quality_named(text) for text in ("TIME", "balanced", "Bead", "0.25")] == [0.0, 0.5, 1.0, 0.25]
    for text in ("", "best", "1.1", "-0.1", "nan"):
        with pytest.raises(UsageError, match="TIME, BALANCED, BEAD"):
            quality_named(text)


def test_no_quality_no_time() -> None:
    # BALANCED gives a ramp the time that the extruder takes at its cap, BEAD twice that
    assert [share_of(quality) for quality in (0.0, 0.5, 1.0)] == [0.0, 1.0, 2.0]
    assert lag(0.0).neutral
    assert not lag(0.5).neutral
