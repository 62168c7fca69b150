"""A drifted plant: more or less of it, sooner or later, built in or out of a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcodectl.errors import UsageError
from plant_models.drifted import Drifted, load_drifted
from plant_models.linear import Linear

STEP = np.concatenate([np.full(500, 5.0), np.zeros(500)])


def flow(plant, u=STEP):
    return plant.run(plant.initial(), u, 0.01)[1]


def test_a_drifted_lag_is_another_lag():
    drifted = Drifted(Linear(1.0, 0.5), 1.15, 0.85)
    np.testing.assert_allclose(flow(drifted), flow(Linear(1.15, 0.5 * 0.85)), rtol=1e-12)
    with pytest.raises(UsageError, match="gain"):
        Drifted(Linear(), 0.0, 1.0)


def test_built_in_plants_take_the_factors_themselves():
    np.testing.assert_allclose(flow(load_drifted("linear", gain=0.85, lag=1.15)), flow(Linear(0.85, 1.15)))
    assert isinstance(load_drifted("linear"), Linear)


def test_a_plant_out_of_a_file_is_wrapped(tmp_path: Path):
    file = tmp_path / "mine.py"
    file.write_text("from plant_models.linear import Linear\nplant = Linear(1.0, 0.5)\n")
    spec = f"{file}:plant"
    np.testing.assert_allclose(flow(load_drifted(spec, gain=1.15, lag=1.15)), flow(Linear(1.15, 0.575)), rtol=1e-12)
    np.testing.assert_allclose(flow(load_drifted(spec)), flow(Linear(1.0, 0.5)))
