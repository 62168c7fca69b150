"""Machine profiles: the built-in ones, files of one's own, and what is wrong with a wrong one."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from gcodectl.config import Machine, load_machine, machine_names
from gcodectl.errors import UsageError


def test_the_built_in_machines() -> None:
    assert machine_names() == ("filament", "filament-klipper", "pellet", "syringe", "syringe-klipper")
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
        ("e_max_speed = -1", "e_max_speed is -1.0; it must be a positive number"),
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


def test_the_firmwares_limits_are_those_it_ships_with_unless_the_profile_says_so() -> None:
    marlin = Machine("m").e_limits
    assert (marlin.corner_speed, marlin.max_speed, marlin.max_accel, marlin.longest) == (5, 25, 10_000, 200)
    assert marlin.max_bead == math.inf
    assert Machine("m", e_max_speed=60.0, max_bead=2.0).e_limits == dataclasses.replace(
        marlin, max_speed=60.0, max_bead=2.0
    )
    duet = Machine("m", dialect="reprapfirmware").e_limits
    assert (duet.corner_speed, duet.max_speed, duet.max_accel, duet.longest) == (5, 100, 500, math.inf)


def test_klippers_limits_follow_from_the_nozzle() -> None:
    machine = Machine("m", dialect="klipper", nozzle=0.4, barrel_diameter=1.75, max_speed=(300.0, 200.0, 10.0))
    limits = machine.e_limits
    assert limits.max_bead == pytest.approx(4 * 0.16)
    assert limits.max_speed == pytest.approx(300 * 0.64 / machine.area)
    assert (limits.corner_speed, limits.max_accel, limits.longest) == (1, math.inf, 50)
    assert machine.most_at_once == pytest.approx(0.4 * 0.64)
    assert machine.carried_flow == pytest.approx(100 * 0.4 * 0.64)
    assert dataclasses.replace(machine, dialect="marlin").carried_flow == math.inf
    named = dataclasses.replace(machine, max_bead=5.0, e_corner_speed=3.0).e_limits
    assert (named.max_bead, named.corner_speed, named.max_speed) == (5, 3, limits.max_speed)


@pytest.mark.parametrize("name", ["none", "none.toml", ""])
def test_a_machine_that_is_not_there(name: str) -> None:
    with pytest.raises(UsageError, match="there is no machine"):
        load_machine(name)


@pytest.mark.parametrize("name", machine_names())
def test_built_in_machines_ramp_as_firmware_does(name: str) -> None:
    # as good as no limit of jerk: what is planned is what the firmware does
    assert load_machine(name).jerk >= 1e6
