"""`gcodectl thermal plan`: the next layer, planned on the one that a recording ends with."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from gcodectl.thermal.control import LayerPlan
    from gcodectl.thermal.road import Road

PUBLISHED = (135.0, 360.0, 136.0)
"""A large head's slowest and fastest, mm/s, and acceleration, mm/s^2, where no profile says (table 4.1)."""


def plan_frames(frames: Path, scene: Path, profile: Path | None, plot: Path | None, *, as_json: bool) -> None:
    """Plan, and say so."""
    import json

    from gcodectl.cli.common import heat_profile
    from gcodectl.cli.thermal import tracked
    from gcodectl.thermal.control import ALPHA, Past, plan_layer
    from gcodectl.thermal.fitted import whole_cooling
    from gcodectl.thermal.problem import Weights
    from gcodectl.thermal.surface import Head

    layers, road, band = tracked(frames, scene, profile)
    known = heat_profile(profile)
    head = (known.head if known is not None else None) or Head(*PUBLISHED)
    cooling = whole_cooling(layers[-1])
    made = plan_layer(
        [Past(cooling, cooling.t0)], road.s, cooling.t0, cooling.t0, head, band, earliest=float(layers[-1].times[-1]),
        alpha=known.alpha if known is not None else ALPHA, weights=Weights(start=known.time if known else 1.0),
    )  # fmt: skip
    if plot is not None:
        from gcodectl.report.heat import plot_plan
        from gcodectl.thermal.layer_time import print_time

        middle = float((made.partitions.length.sum()) / (made.plan.end - made.plan.start))
        steady = print_time(cooling.surface(road.s), middle, band)
        others = {f"one speed, {middle:.0f} mm/s, from {steady.time:.1f} s": steady.temperatures}
        plot_plan(plot, road.s, made.plan, made.partitions, band, others)
        typer.echo(f"gcodectl: wrote {plot}", err=True)
    found = table(made, road, float(layers[-1].times[-1]))
    typer.echo(json.dumps({"frames": str(frames), "layers": len(layers), **found}) if as_json else _rows(found))


def table(made: LayerPlan, road: Road, last: float) -> dict[str, Any]:
    """A plan for JSON; `last`: time of the last frame, s."""
    import numpy as np

    plan, parts = made.plan, made.partitions
    of = np.repeat(np.arange(len(parts)), np.diff(np.append(parts.first, len(road))))
    mean = np.bincount(of, plan.temperatures) / np.bincount(of)
    return {
        "start": plan.start, "wait": plan.start - last, "end": plan.end, "cost": plan.cost, "widened": plan.widened,
        "coolest": float(plan.temperatures.min()), "hottest": float(plan.temperatures.max()),
        "complaint": plan.complaint(),
        "partitions": [
            {
                "from": float(begin), "to": float(begin + length), "speed": float(speed), "arrives": float(arrives),
                "mean": float(warm), "ruled": kept.name.lower(),
            }
            for begin, length, speed, arrives, warm, kept in zip(
                parts.begin, parts.length, plan.speeds, plan.borders[:-1], mean, _ruled(plan.ruled), strict=True
            )
        ],
    }  # fmt: skip


def _ruled(values: Any) -> Any:
    from gcodectl.thermal.speed import Ruled

    return [Ruled(value) for value in values]


def _rows(found: dict[str, Any]) -> str:
    """The plan in lines for people."""
    rows = [
        f"begin at {found['start']:.1f} s, {found['wait']:.1f} s after the last frame; done at {found['end']:.1f} s; "
        f"roads land on {found['coolest']:.1f} to {found['hottest']:.1f} degC",
        "     from mm     to mm      mm/s   at s   degC   ruled by",
    ]
    for one in found["partitions"]:
        numbers = f"{one['from']:12.1f}{one['to']:10.1f}{one['speed']:10.1f}{one['arrives']:7.1f}{one['mean']:7.1f}"
        rows.append(f"{numbers}   {one['ruled']}")
    return "\n".join(rows + ([found["complaint"]] if found["complaint"] else []))
