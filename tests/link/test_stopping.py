"""What switches the heaters off."""

import pytest

from gcodectl.link.replies import Heat
from gcodectl.link.stopping import heaters_off


@pytest.mark.parametrize(
    ("told", "tools"),
    [
        ("", []),
        ("T B", []),
        ("T T0", []),
        ("T T0 T1", [b"M104 T0 S0", b"M104 T1 S0"]),  # M104 alone is for the tool in use, which need not be the first
        ("T1 B C", [b"M104 T1 S0"]),
    ],
)
def test_every_heater_that_was_told_of_is_switched_off(told: str, tools: list[bytes]) -> None:
    heats = {name: Heat(200.0, 200.0) for name in told.split()}
    chamber = [b"M141 S0"] if "C" in told else []
    assert heaters_off(heats) == [b"M104 S0", *tools, b"M140 S0", *chamber]
