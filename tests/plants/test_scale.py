"""The simulated scale, and what lies on it."""

from __future__ import annotations

import numpy as np
import pytest

from gcodectl.config import load_machine
from gcodectl.errors import UsageError
from plant_models.plant import load_plant
from plant_models.recorded import laid
from plant_models.scale import weigh


def test_it_shows_whole_steps_about_the_weight():
    rng = np.random.default_rng(0)
    shown = [weigh(150.0, 1.2, 0.002, rng) for _ in range(400)]
    assert all(len(one.split(".")[1]) == 3 for one in shown)
    grams = np.array([float(one) for one in shown])
    assert (grams / 0.002) == pytest.approx(np.round(grams / 0.002), abs=1e-6)
    assert grams.mean() == pytest.approx(0.18, abs=0.0003)
    assert grams.std() == pytest.approx(0.8 * 0.002, rel=0.15)


def test_coarse_and_fine_ones_show_their_digits():
    assert "." not in weigh(50_000.0, 1.0, 1.0, np.random.default_rng(1))
    assert len(weigh(50_000.0, 1.0, 0.0001, np.random.default_rng(1)).split(".")[1]) == 4


@pytest.mark.parametrize(("density", "step"), [(0.0, 0.1), (-1.0, 0.1), (1.0, 0.0), (float("nan"), 0.1)])
def test_what_is_no_scale(density, step):
    with pytest.raises(UsageError, match="must be a positive number"):
        weigh(1.0, density, step, np.random.default_rng(0))


def test_all_that_is_pushed_is_laid_where_the_file_waits_for_it():
    machine = load_machine("syringe")
    data = b"G28\nM83\nG1 X20 E0.2 F600\nG1 X40 E0.1\nG4 P9000\n"
    linear = load_plant("linear", flow=5.0)
    assert laid(data, machine, linear) == pytest.approx(0.3 * machine.area, rel=0.01)
