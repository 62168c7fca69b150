"""Fronts of error against time: expert by its list of accelerations, ours by quality.

    rmse |x                       a point is on the front where no other is both better and faster;
         | `-x                    at equal time: the best that was tried and took at most 1 % longer
         |    `--x----x
         +---------------- time

Expert's front costs nothing: its search tries every acceleration, corner speed and handling of retractions anyhow. Ours
has a point for each of QUALITIES.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gcodectl.errors import GcodectlError
from gcodectl.flow.library import BasisSet
from plant_models.bench_cases import Case
from plant_models.score import Score

EQUAL = 1.01
"""Times within this factor are equal."""
QUALITIES = (0.0, 0.25, 0.5, 0.75, 1.0)
SHOWN = (
    ("syringe-mid", "star"),
    ("syringe-mid", "short-travels"),
    ("syringe-slow", "dashes"),
    ("syringe-dead", "star"),
    ("melt-bowden", "mixed-speeds"),
    ("paste-a", "short-travels"),
)
"""Plant and part of the cells that are looked at more closely; the first of all where none of these is there."""

Point = dict[str, float]


def tried_front(tried: Sequence[Score]) -> list[Point]:
    """Return the scores that no other beats in both rmse + off_path and time, fastest first."""
    points = [point(one) for one in tried]
    points.sort(key=lambda one: (one["time_s"], cost(one)))
    front: list[Point] = []
    for one in points:
        if not front or cost(one) < cost(front[-1]):
            front.append(one)
    return front


def equal_time(front: Sequence[Point], time_s: float) -> Point | None:
    """Return the best point of a front that takes no longer than `time_s`; None where all do."""
    there = [one for one in front if one["time_s"] <= EQUAL * time_s]
    return min(there, key=cost) if there else None


def point(score: Score) -> Point:
    """Return what a front shows of a score."""
    return {"time_s": score.time_s, "rmse": score.rmse, "off_path": score.off_path}


def cost(one: Point) -> float:
    """Return what tuning makes least."""
    return one["rmse"] + one["off_path"]


def few(cases: Sequence[Case]) -> list[int]:
    """Return which of the cases are looked at more closely."""
    return [i for i, case in enumerate(cases) if (case.plant, case.part) in SHOWN] or [0]


def measured_fronts(
    cases: Sequence[Case], libraries: Mapping[str, Sequence[BasisSet]], cells: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return expert's front and ours, from the first seed's library, for a few of the cells."""
    from flow_bench.cell import Station  # it scores with this file's fronts

    fronts: list[dict[str, Any]] = []
    for number in few(cases):
        case, cell = cases[number], cells[number]
        station = Station(case, (), 0)
        one = libraries[case.plant][0]
        ours: list[dict[str, float]] = []
        for quality in QUALITIES:
            try:
                score = station.learned(one, "", None, quality).nominal
            except GcodectlError:
                continue  # the cell itself says that ours failed, and why
            ours.append({**point(score), "quality": quality})
        none = cell["columns"]["none"]["time_s"]
        fronts.append(
            {"plant": case.plant, "part": case.part, "none_time_s": none, "expert": cell["expert_front"], "ours": ours}
        )
    return fronts
