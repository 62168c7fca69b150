"""What a printer has told of itself: what it can, and how warm it is."""

from __future__ import annotations

from collections.abc import Mapping

from gcodectl.link.replies import Heat, Reply


class Known:
    """Capabilities (M115) and heaters of one printer."""

    def __init__(self) -> None:
        self.capabilities: set[str] = set()
        self.heats: dict[str, Heat] = {}

    @property
    def emergency_parser(self) -> bool:
        """Whether M108, M112 and M410 act when they arrive."""
        return "EMERGENCY_PARSER" in self.capabilities

    @property
    def reports(self) -> bool:
        """Whether it can report its temperatures by itself (M155)."""
        return "AUTOREPORT_TEMP" in self.capabilities

    @property
    def cold(self) -> bool:
        """Whether it has said of every heater that it has no target."""
        return is_cold(self.heats)

    def can(self, reply: Reply) -> None:
        """Take a line of its capabilities, such as `Cap:EMERGENCY_PARSER:1`."""
        _, name, value = (reply.text + "::").split(":")[:3]
        if value.strip() == "1":
            self.capabilities.add(name.strip())

    def forget_targets(self) -> None:
        """Take no heater's target as known any more."""
        self.heats = {name: Heat(heat.now) for name, heat in self.heats.items()}


def is_cold(heats: Mapping[str, Heat]) -> bool:
    """Whether a report of temperatures says that no heater has a target."""
    return bool(heats) and all(heat.cold for heat in heats.values())
