"""Machine profiles: the built-in ones, files of one's own, and what is wrong with a wrong one."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gcodectl.config import Machine, load_machine, machine_names
from gcodectl.errors import UsageError


def test_the_built_in_machines() -> None:
    assert machine_names() == ("filament", "pellet", "syringe")
    for name in machine_names():
        assert load_machine(name).name == name
    assert load_machine("syringe").area == pytest.approx(math.pi * 7.9**2)


def test_a_file_gives_what_it_says_and_the_rest_is_as_usual(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("nozzle = 1\nmax_speed = [1, 2, 3]\ndialect = 'klipper'\n")
    assert load_machine(str(path)) == Machine("mine", dialect="klipper", nozzle=1.0, max_speed=(1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("nozle = 1", "no such setting as 'nozle'; there are name, dialect"),
        ("nozzle = '1'", "nozzle takes a number, not '1'"),
        ("nozzle = true", "nozzle takes a number"),
        ("nozzle = -1", "nozzle is -1.0; it must be a positive number"),
        ("nozzle = nan", "positive number"),
        ("max_flow = 0", "max_flow is 0.0"),
        ("max_speed = 3", "max_speed takes 3 numbers"),
        ("max_speed = [1, 2]", "max_speed takes 3 numbers"),
        ("max_speed = [1, 2, 'x']", "max_speed takes 3 numbers"),
        ("dialect = 'heidenhain'", "none of marlin, klipper, reprapfirmware"),
        ("nozzle = ", "mine.toml"),
        ("name = ''\nnozzle = \xff", "mine.toml"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(UsageError) as caught:
        load_machine(str(path))
    assert said in str(caught.value)


@pytest.mark.parametrize("name", ["none", "none.toml", ""])
def test_a_machine_that_is_not_there(name: str) -> None:
    with pytest.raises(UsageError, match="there is no machine"):
        load_machine(name)
