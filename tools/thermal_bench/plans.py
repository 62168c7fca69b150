"""The control's cells that no plant is printed for: the published grid, and the measured hexagon.

    published grid   print times 165-195 s by 0.5, speeds 15-40 px/s by 1, 7 partitions, 15 px/s^2, a location every
                     5 px (2.82 px an inch: 850 in/min are 40 px/s); and all of it four times finer
    hexagon          25 measured partitions, each cooling as its own location does; the layer beneath was laid at
                     20 mm/s, the next follows at once, entered at 20 mm/s. A partition's T is known from its end on,
                     and its mean is taken over its way: so 20 mm/s throughout cost the 1546.7 that is published

Nothing is said of the hexagon's speed limits but the rules; 10 to 60 mm/s do not bind under the one, and 5 to 100 mm/s
(beyond what the acceleration allows on one partition from 20 mm/s: 84) are named beside the other. CPU seconds of one
core, kernels compiled before.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gcodectl.columns import Floats
from gcodectl.thermal.dynamic import Route, dynamic
from gcodectl.thermal.graph import Graph, Lattice, graph
from gcodectl.thermal.partitions import Partitions, partition
from gcodectl.thermal.problem import Weights, cost_at, drive, pose
from gcodectl.thermal.relaxation import lower_bound
from gcodectl.thermal.shortest import shortest
from gcodectl.thermal.speed import plan_speeds
from gcodectl.thermal.surface import Band, Head, Surface
from plant_models.cooling import cooling_part

Cell = dict[str, Any]
PIXELS = 40.0 / (850.0 / 60.0)
"""px an inch."""
HEAD = Head(15.0, 40.0, 15.0)
USUAL = 535.0 / 60.0 * PIXELS
FIXED_SPEED, RULE, ACCEL = 20.0, 0.05, 50.0


def hexagon_folder() -> Path | None:
    """Return where the measured hexagon is; None: nowhere."""
    beside = Path(__file__).resolve().parents[2].parent / "shared" / "data"
    folder = Path(os.environ.get("GCODECTL_DATA", beside)) / "lfam_hexagon"
    return folder if folder.is_dir() else None


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return what comes of it, and the CPU seconds it takes, the better of two runs."""
    found, spent = None, math.inf
    for _ in range(2):
        begun = time.process_time()
        found = work()
        spent = min(spent, time.process_time() - begun)
    return found, spent


def wall_in_pixels(seed: int, step: float) -> Surface:
    """The simulated wall's layer, a location every `step` px."""
    part = cooling_part("wall", seed)
    true, scale = part.truth(), PIXELS / 25.4
    s = np.arange(0.0, 88.0 * PIXELS, step)
    b0, b1 = (np.interp(s, true.s * scale, values) for values in (true.b0, true.b1))
    return Surface(s=s, b0=b0, b1=b1, t0=s / USUAL, temp0=np.full(len(s), part.band.deposition))


def size_cell(seed: int, fine: int) -> Cell:
    """Both searches on the published grid, or one finer in each direction; and how good the refined plan is."""
    surface, band = wall_in_pixels(seed, 5.0 / fine), Band()
    parts = partition(surface, HEAD, band, most=7, gain=0.0)
    problem = pose(surface, parts, HEAD, band, Weights(), None, math.inf, 0.0)
    border = np.zeros(len(parts) + 1, dtype=np.int64)
    lattice = Lattice(165.0, 0.5 / fine, border, 60 * fine + 1, 15.0, 1.0 / fine, border, 25 * fine + 1)

    def solved(solver: Callable[[Graph], Route]) -> Callable[[], Route]:
        return lambda: solver(graph(problem, lattice))

    exact, dp_s = timed(solved(dynamic))
    found, astar_s = timed(solved(shortest))
    cell = {
        "part": "published grid", "seed": seed, "finer": fine, "partitions": len(parts), "dp_cpu_s": dp_s,
        "astar_cpu_s": astar_s, "dp_cost": exact.cost, "difference": abs(exact.cost - found.cost),
        "dp_nodes": exact.nodes, "astar_nodes": found.nodes,
        "exact_cost": cost_at(problem, *drive(problem, found.start, found.speeds)),
    }  # fmt: skip
    if fine == 1:
        plan, plan_s = timed(lambda: plan_speeds(surface, parts, HEAD, band))
        instant = plan_speeds(surface, parts, Head(15.0, 40.0, math.inf), band)
        bound = lower_bound(problem, cells=100_000)
        cell |= {
            "plan_cpu_s": plan_s, "plan_cost": plan.cost, "gap_to_instant": plan.cost / instant.cost - 1.0,
            "gap_to_bound": plan.cost / bound - 1.0,
        }  # fmt: skip
    return cell


def hexagon(folder: Path, slowest: float, fastest: float) -> tuple[Surface, Partitions, float]:
    """The measured layer, a location every 11 mm, and when it is done."""
    table = np.loadtxt(folder / "cooling_parameters.csv", delimiter=",", skiprows=1)
    length, row = np.loadtxt(folder / "partitions.csv", delimiter=",", skiprows=1, usecols=(1, 2), unpack=True)
    b0, b1, temp0 = table[row.astype(int), 1:].T
    of = np.repeat(np.arange(len(length)), np.round(length / 11.0).astype(int))
    begin = np.cumsum(length) - length
    surface = Surface(
        s=np.linspace(5.5, 11.0 * len(of) - 5.5, len(of)),
        b0=b0[of],
        b1=b1[of],
        t0=(begin + length)[of] / FIXED_SPEED,
        temp0=temp0[of],
    )
    limits: tuple[Floats, Floats] = np.full(len(length), slowest), np.full(len(length), fastest)
    first = np.searchsorted(of, np.arange(len(length)))
    return surface, Partitions(first, begin, length, *limits, np.zeros(len(length))), float(length.sum()) / FIXED_SPEED


def hexagon_cells(folder: Path) -> list[Cell]:
    """The measured hexagon: fixed speed, under the rule of 5 %, and with acceleration alone."""
    band, weights = Band(low=60.0, best=120.0, high=190.0), Weights(0.0, 1.0, of_mean=True)
    cells = []
    for name, slowest, fastest, accel, change in (
        ("rule", 10.0, 60.0, math.inf, RULE), ("acceleration", 5.0, 100.0, ACCEL, math.inf),
        ("acceleration, wide", 2.0, 150.0, ACCEL, math.inf),
    ):  # fmt: skip
        surface, parts, laid = hexagon(folder, slowest, fastest)
        head = Head(slowest, fastest, accel)
        problem = pose(surface, parts, head, band, weights, FIXED_SPEED, change, 0.0)
        fixed = cost_at(problem, *drive(problem, laid, np.full(len(parts), FIXED_SPEED)))

        def planned(
            surface: Surface = surface, parts: Partitions = parts, head: Head = head, laid: float = laid,
            change: float = change,
        ) -> Any:  # fmt: skip
            return plan_speeds(surface, parts, head, band, weights, entry=FIXED_SPEED, earliest=laid, change=change)

        plan, spent = timed(planned)
        cells.append(
            {
                "part": "hexagon", "seed": 0, "rule": name, "slowest": slowest, "fastest": fastest,
                "fixed": fixed - laid, "objective": plan.cost - laid, "layer_time": plan.end - plan.start,
                "cpu_s": spent,
            }
        )  # fmt: skip
    return cells
