"""What `filter` and `check` say of the heat beneath a part's roads, in lines for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcodectl.thermal.tally import Count, Tally

COLDER = 0.5
"""degC by which the coldest must have become colder to be told."""


def heat_rows(tally: Tally) -> list[str]:
    """What was found, and what was done about it; what could not be mended, once."""
    from gcodectl.cli.common import duration

    if not tally.beneath:
        return [
            f"heat: no road lies on another that is {tally.bead:.3g} mm wide: nothing to plan; roads of another width "
            "are told by the profile's bead"
        ]
    planned, band = tally.planned, tally.band
    rows = [
        f"heat: {tally.beneath} of {tally.locations} locations lie on others",
        f"heat: as sliced {found_there(tally.sliced, tally)}",
        f"heat: planned   {found_there(planned, tally)}; {tally.slowed} layers slowed by {duration(tally.slowed_s)}, "
        f"{tally.waits} waited for, {duration(tally.wait_s)}",
    ]
    if tally.slowest >= tally.fastest:
        rows.append(
            f"heat: the file lays at {tally.fastest:.3g} mm/s at the most, and the profile's [head] slowest is "
            f"{tally.slowest:g}: nothing can be slowed; a lower slowest mends it, or no [head]: then roads keep half "
            "of their speed at least"
        )
    if planned.hot:
        rows.append(_stays_hot(tally))
    if planned.cold:
        colder = planned.cold > tally.sliced.cold or planned.cold_by > tally.sliced.cold_by + COLDER
        why = (
            f"as sliced {tally.sliced.cold} were, by up to {tally.sliced.cold_by:.1f}; they cooled while what is "
            "hottest beneath the same layer was slowed or waited for: a layer that cools as unevenly cannot be had "
            "inside the band; slice its slow-cooling parts apart, or let more be too hot (a higher high or alpha)"
            if colder
            else "slowing cannot mend that, they run as fast as the file has them; slice with higher speeds"
        )
        rows.append(
            f"heat: {planned.cold} locations are too cold (under {band.low:g} degC), by up to {planned.cold_by:.1f}: "
            f"{why}"
        )
    return rows


def _stays_hot(tally: Tally) -> str:
    """Why locations stay too hot, and what mends it."""
    planned, why = tally.planned, []
    if tally.stuck:
        all_of = "" if tally.stuck == planned.hot else f"for {tally.stuck} of them "
        why.append(
            f"{all_of}the head may go no slower, and the file has no place off the road to wait at: a lower slowest, a "
            "longer path a layer, or a retract or travel between layers mends it"
        )
    if tally.stuck < planned.hot:
        all_of = f"{planned.hot - tally.stuck} of them" if tally.stuck else "they"
        why.append(
            f"{all_of} are within a layer's share of alpha, or the rest of their layer would become too cold if they "
            "were waited for: slice slow-cooling parts apart; a lower alpha lets fewer be"
        )
    return (
        f"heat: {planned.hot} locations stay too hot (over {tally.band.high:g} degC), by up to {planned.hot_by:.1f}: "
        + "; ".join(why)
    )


def found_there(count: Count, tally: Tally) -> str:
    """Shares out of the band, and the mean."""
    of = tally.beneath
    return f"{count.hot / of:.1%} too hot, {count.cold / of:.1%} too cold, {count.total / of:.1f} degC on average"
