from __future__ import annotations

import pytest

from gcodectl.calibrate.calibration import Attributes, Calibration, Parameters, from_words
from gcodectl.errors import UsageError


def test_words_become_a_calibration_with_their_units():
    one = from_words(
        {"material": "clay", "nozzle_diameter": "0.84mm", "age": "24 h", "elasticity": "LOW", "phases": "2",
         "start_error": "VERY_EARLY", "pushouttime": ".4 s", "acceldelay": "-0.1"}, "here",
    )  # fmt: skip
    assert one.attributes == Attributes(
        "clay", phases=2, elasticity="low", age=24.0, nozzle_diameter=0.84, start_error="very early"
    )
    assert one.parameters == Parameters(pushouttime=0.4, acceldelay=-0.1)
    assert one.source == "here"
    assert not one.attributes.good_enough


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"material": "x", "viscosity": "3"}, "no attribute or parameter 'viscosity'; there are material, phases"),
        ({"nozzle_diameter": "0.8"}, "give material=NAME"),
        ({"material": "x", "nozzle_diameter": "0.8 in"}, "its unit is mm: please convert"),
        ({"material": "x", "pushouttime": "400 ms"}, "its unit is s"),
        ({"material": "x", "nozzle_diameter": "wide"}, "must be a number of mm"),
        ({"material": "x", "path_width": "0"}, "path_width is 0 mm; it must be positive"),
        ({"material": "x", "elasticity": "some"}, "one of low, medium, high"),
        ({"material": "x", "stop_error": "tardy"}, "one of very early, early, ok, late, very late"),
        ({"material": "x", "phases": "1.5"}, "whole number"),
        ({"material": "x", "outputdecel": "-30"}, "outputdecel is -30 mm/s^2; it must be positive"),
        ({"material": " "}, "material's name"),
    ],
)
def test_what_is_wrong_is_said(words, said):
    with pytest.raises(UsageError, match=said.replace("^", "\\^")):
        from_words(words)


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"path_width": "0.8"}, "path_width is '0.8'; it must be a number"),
        ({"phases": True}, "phases is True; it must be a number"),
        ({"tool": 3}, "tool is 3; it must be a name"),
        ({"material": None}, "material is None; it must be a name"),
        ({"elasticity": ["low"]}, "one of low, medium, high"),
    ],
)
def test_what_is_of_the_wrong_type_is_said(told, said):
    with pytest.raises(UsageError, match=said):
        Attributes(**{"material": "x", **told})


def test_a_material_is_the_same_however_it_is_written():
    names = {Calibration(Attributes(name), Parameters()).material for name in ("Fab Epoxy", "fab  epoxy ")}
    assert names == {"fab epoxy"}


def test_numbers_must_be_finite():
    with pytest.raises(UsageError, match="it must be a number"):
        Parameters(acceldelay=float("nan"))
    assert Parameters(pushouttime=0.0).pushouttime == 0.0
