"""What people are told of heat is what happened."""

from __future__ import annotations

import numpy as np
import pytest

from gcodectl.cli.heat import heat_rows
from gcodectl.thermal.surface import Band
from gcodectl.thermal.tally import Count, Tally


@pytest.mark.parametrize(
    ("cold", "by", "said"), [(1312, 61.0, "waited for"), (29037, 20.0, "waited for"), (29037, 61.0, "as the file has")]
)
def test_locations_that_the_plan_made_colder_are_not_told_to_run_as_sliced(cold: int, by: float, said: str) -> None:
    sliced, planned = Count(hot=149, cold=cold, cold_by=by), Count(cold=29037, cold_by=61.0)
    tally = Tally(Band(), 0.9, locations=32758, beneath=30555, sliced=sliced, planned=planned)
    (row,) = (row for row in heat_rows(tally) if "too cold (" in row)
    assert said in row
    assert ("as the file has" in row) == (said == "as the file has")


def test_rounding_is_not_counted_as_too_hot() -> None:
    count = Count()
    count.add(np.array([119.0, 119.98, 135.0, 150.01, 151.0]), Band())
    assert (count.hot, count.cold) == (1, 1)
