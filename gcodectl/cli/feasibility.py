"""What `gcodectl check` says of a file's lines and its machine's firmware: counts by rule, and the first of each."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gcodectl.config import Machine
    from gcodectl.motion.feasible import Findings

SHOWN = 3
"""Findings of each rule that are shown."""
REMEDIES = {
    "bead": "set max_extrude_cross_section (max_bead) to what the nozzle may lay, or lay less in the line",
    "E in one line": "split the move, or raise max_extrude_only_distance or EXTRUDE_MAXLENGTH (e_longest)",
}
"""What to do about lines that are refused, by rule."""
SLOWED = {
    "E speed step": {
        "klipper": "raise instantaneous_corner_velocity in [extruder] (e_corner_speed)",
        "marlin": "raise the E of M205 (e_corner_speed)",
        "reprapfirmware": "raise the E of M566 (e_corner_speed)",
    },
    "E acceleration": {
        "klipper": "raise max_extrude_only_accel (e_accel)",
        "marlin": "raise the E of M201 (e_max_accel)",
        "reprapfirmware": "raise the E of M201 (e_max_accel)",
    },
    "E speed": {
        "klipper": "raise max_extrude_only_velocity (e_max_speed)",
        "marlin": "raise the E of M203 (e_max_speed)",
        "reprapfirmware": "raise the E of M203 (e_max_speed)",
    },
}
"""What to do about lines that slow the machine down, by rule and dialect."""


@dataclasses.dataclass
class Tally:
    """Findings counted by rule, as they come."""

    machine: Machine
    rules: dict[str, dict[str, Any]] = dataclasses.field(default_factory=dict)

    def add(self, found: Findings) -> None:
        """Count some more."""
        import numpy as np

        from gcodectl.motion.feasible import Rule

        for rule in map(Rule, np.flatnonzero(np.bincount(found.rule)).tolist()):
            some = found[found.rule == rule]
            entry = self.rules.setdefault(
                rule.label, {"effect": rule.effect.name.lower(), "count": 0, "unit": rule.unit, "first": []}
            )
            entry["count"] += len(some)
            excess = some.limit / np.maximum(some.value, 1e-12) if rule == Rule.MERGED else some.value / some.limit
            entry["worst"] = max(entry.get("worst", 0.0), float(excess.max()))
            more = some[: SHOWN - len(entry["first"])]
            entry["first"] += [
                {"line": int(line), "value": float(value), "limit": float(limit)}
                for line, value, limit in zip(more.line, more.value, more.limit, strict=True)
            ]

    def count(self, effect: str) -> int:
        """How many findings end in `effect`."""
        return sum(entry["count"] for entry in self.rules.values() if entry["effect"] == effect)

    def table(self) -> dict[str, Any]:
        """The result for JSON."""
        counts = {effect: self.count(effect) for effect in ("refused", "slowed", "blurred")}
        return {"firmware": self.machine.dialect, **counts, "rules": self.rules}

    def rows(self) -> list[str]:
        """The result in lines for people."""
        said = {"refused": "would refuse", "slowed": "would slow down", "blurred": "would blur"}
        if not self.rules:
            return [f"  firmware  {self.machine.dialect} takes every line as it is"]
        rows = []
        for label, entry in sorted(self.rules.items(), key=lambda item: list(said).index(item[1]["effect"])):
            lines = f"{entry['count']} line{'s' if entry['count'] > 1 else ''}"
            what = f"{self.machine.dialect} {said[entry['effect']]} {lines} by {label}"
            rows.append(f"  firmware  {what}, at worst {entry['worst']:.3g} times off")
            rows += [
                f"            line {one['line']}: {one['value']:.3g} {entry['unit']}, {one['limit']:.3g} allowed"
                for one in entry["first"]
            ]
            if label in SLOWED:
                rows.append(f"            {SLOWED[label][self.machine.dialect]} both there and in the machine profile")
        return rows

    def refusal(self, source: str) -> str | None:
        """The sentence that ends the program where the firmware would refuse a line; None where it would not."""
        for label, remedy in REMEDIES.items():
            if label in self.rules:
                entry = self.rules[label]
                one, others = entry["first"][0], self.count("refused") - 1
                more = f", here and in {others} more" if others else ""
                return (
                    f"{source}: line {one['line']}: {self.machine.dialect} would refuse {label} {one['value']:.4g} "
                    f"{entry['unit']}, {one['limit']:.4g} at most{more}: {remedy}"
                )
        return None
