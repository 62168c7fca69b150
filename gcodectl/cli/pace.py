"""Pace: the sentence that says where a firmware's rules for E, not the plunger, set how long starts and stops take."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcodectl.flow.inversion import Inversion
    from gcodectl.pipeline import Options

WORTH = 0.1
"""s; what a start would have to be shorter for it to be said."""
CORNER = {
    "klipper": "instantaneous_corner_velocity in [extruder]",
    "marlin": "the E of M205 (DEFAULT_EJERK)",
    "reprapfirmware": "the E of M566",
}
"""What sets by how much E's speed may step at a junction, by dialect."""


def pace_rows(options: Options) -> list[str]:
    """Say, for every material that is slowed down, by which rule of the firmware, what that costs, and the remedy."""
    seen = {one: None for one in options.inversions if one is not None}
    return [row for one in seen if (row := _row(one, options))]


def _row(one: Inversion, options: Options) -> str | None:
    machine, flow = options.machine, one.model.flow
    now, thick = one.transit(flow)[0], dataclasses.replace(one, carried=math.inf)
    free = dataclasses.replace(thick, max_flow_slew=machine.max_flow_slew).transit(flow)[0]
    if now - free < WORTH:
        return None
    without = thick.transit(flow)[0]
    if without - free >= WORTH:  # steps come first: they cost bead as well as time
        without = dataclasses.replace(one, max_flow_slew=machine.max_flow_slew).transit(flow)[0]
        why = (
            f"lets E's speed step by {machine.e_limits.corner_speed:g} mm/s at a junction "
            f"({one.max_flow_slew:.0f} mm^3/s^2; the plunger could change its rate by {machine.max_flow_slew:.0f})"
        )
        remedy = f"raise {CORNER[machine.dialect]}, and e_corner_speed in the machine profile"
    else:
        why = f"takes no more than {one.carried:.0f} mm^3/s in short lines (the plunger could give {one.able:.0f})"
        remedy = "raise max_extrude_cross_section in [extruder], and max_bead in the machine profile"
    return (
        f"{machine.dialect} {why}: a start at {flow:g} mm^3/s takes {now:.2f} s of its road, "
        f"{without:.2f} s without that limit; to change it, {remedy}"
    )
