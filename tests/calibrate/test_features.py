from __future__ import annotations

import numpy as np
import pytest
from known import by_rule

from gcodectl.calibrate.calibration import PARAMETERS, Attributes, Parameters
from gcodectl.calibrate.features import coded, decoded, make_features, targets


def test_columns_are_what_differs_and_what_names_share():
    known = [
        Attributes("fab epoxy", nozzle_diameter=0.8, elasticity="low", tool="syringe"),
        Attributes("clear epoxy", nozzle_diameter=0.4, elasticity="high", tool="syringe"),
        Attributes("play doh", nozzle_diameter=1.6, tool="syringe"),
    ]
    features = make_features(known)
    assert features.names == ("nozzle_diameter", "elasticity", "word=epoxy")
    rows = features.of(known)
    assert rows[:, 0] == pytest.approx(np.log([0.8, 0.4, 1.6]))
    assert rows[:, 1].tolist() == [0.0, 1.0, 0.5]  # not known: the mean of the known
    assert rows[:, 2].tolist() == [1.0, 1.0, 0.0]
    assert features.of([Attributes("new")])[0, 0] == pytest.approx(np.log([0.8, 0.4, 1.6]).mean())


def test_what_is_learned_leads_back_to_the_parameters():
    for one in by_rule(3, 2):
        values = {name: coded(name, one.attributes, one.parameters) for name in PARAMETERS}
        found = decoded({name: value for name, value in values.items() if not np.isnan(value)}, one.attributes)
        for name in PARAMETERS:
            assert getattr(found, name) == pytest.approx(getattr(one.parameters, name))


def test_what_is_not_known_is_no_target():
    one = by_rule(1, 1)[0]
    assert np.isnan(coded("inputspeed", Attributes("x"), one.parameters))
    assert np.isnan(coded("acceldelay", one.attributes, Parameters(acceldelay=0.1)))
    assert coded("pushouttime", one.attributes, Parameters(pushouttime=0.0)) == pytest.approx(np.log(0.01))
    assert set(targets([one])) == set(PARAMETERS)
