"""Kinds of drive: what moves the material, and whose calibrations say anything of whose.

A plunger is told a volume rate and delivers it, late; an air pressure is told a pressure, and the flow grows with a
power of what it is above the yield; a screw slips; a filament melts. The same twelve numbers mean another thing to
each of them: pushouts that plungers need gave an air pressure some thirty times the flow that was asked for. So a
guess is made of calibrations of the same kind alone, and where there are none it is refused.

    tool="10cc syringe"      syringe pump          words of `KINDS`, the first line that holds one of them
    tool="air-fed syringe"   air pressure
    tool="my robot"          my robot              a word that tells no kind is a kind of its own
    no tool                  not known             taken for the store's only kind, and said
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from gcodectl.calibrate.calibration import Attributes, Calibration
from gcodectl.errors import UnsafeError, UsageError

KINDS = (
    ("screw", {"auger", "cavity", "pellet", "pellets"}),
    ("air pressure", {"air", "pressure", "pneumatic", "compressed", "pressurised", "pressurized"}),
    ("syringe pump", {"syringe", "plunger", "piston"}),
    ("screw", {"screw"}),
    ("filament", {"filament", "bowden", "fdm", "fff"}),
)
NOT_TOLD = "a tool that is not told"


def drive_of(tool: str | None) -> str | None:
    """Return the kind of drive that a tool's name tells; None where there is no name."""
    if tool is None or not tool.strip():
        return None
    words = set(re.findall(r"[a-z0-9]+", tool.lower()))
    return next((kind for kind, told in KINDS if words & told), " ".join(tool.lower().split()))


def by_drive(calibrations: Sequence[Calibration]) -> dict[str | None, list[Calibration]]:
    """Return the calibrations of each kind of drive, in the order in which they came."""
    found: dict[str | None, list[Calibration]] = {}
    for one in calibrations:
        found.setdefault(drive_of(one.attributes.tool), []).append(one)
    return found


def same_drive(calibrations: Sequence[Calibration], attributes: Attributes) -> tuple[list[Calibration], list[str]]:
    """Return the calibrations that `attributes` can be guessed from, and what there is to say of that.

    Raises UnsafeError where the kind of drive is not among the known ones, UsageError where it is not told and the
    known ones are of several kinds.
    """
    known, asked = by_drive(calibrations), drive_of(attributes.tool)
    told = {one.attributes.tool for one in calibrations if one.attributes.tool}
    if asked is not None and asked not in known:
        if set(known) - {None}:
            raise UnsafeError(
                f"nothing is known of {asked} tools, only of {_listed(calibrations)}: what one kind of drive needs can "
                "push another far beyond its road; add calibrations of such a tool first, or learn without a guess"
            )
        return list(calibrations), [f"no known calibration tells its tool: whether they hold for {asked} is not known"]
    if asked is None:
        kinds = [kind for kind in known if kind is not None]
        if len(kinds) > 1:
            raise UsageError(f"for which tool? the known ones are {', '.join(sorted(told))}: give tool=NAME")
        return list(calibrations), [f"no tool is told: taken for {kinds[0]}, as the known ones are"] if kinds else []
    apart = len(calibrations) - len(known[asked])
    return known[asked], [f"{apart} calibrations of other tools are left out"] if apart else []


def _listed(calibrations: Sequence[Calibration]) -> str:
    times = Counter(drive_of(one.attributes.tool) or NOT_TOLD for one in calibrations)
    return ", ".join(f"{kind} ({many})" for kind, many in times.most_common())
