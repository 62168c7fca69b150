"""A print: an execution, the plants of its tools behind their plungers, and what comes out of the nozzles."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.errors import InputError, UsageError
from gcodectl.records import Signal
from plant_models.bead import Roads, bin_width, find_roads, on_road
from plant_models.drifted import load_drifted
from plant_models.firmware import Execution, run
from plant_models.gantry import Firmware, Segments
from plant_models.match import Places
from plant_models.plant import Plant
from plant_models.plunger import Plunger
from plant_models.score import Score, score

TAIL = 10.0
"""Seconds of ooze counted after the end."""
DT = 0.002
"""s, the sampling time of u and q."""


def nominal_flow(segments: Segments) -> float:
    """Return the median, by volume, of what the roads ask for at full speed, mm^3/s; InputError for no road."""
    laid = segments[on_road(segments)]
    if not len(laid):
        raise InputError("there is no road in this file (no move with both path and E > 0), so no nominal flow either")
    flow = laid.volume / laid.length * laid.speed
    order = np.argsort(flow)
    half = np.searchsorted(np.cumsum(laid.volume[order]), laid.volume.sum() / 2)
    return float(flow[order][min(half, len(order) - 1)])


def capped(machine: Machine, flow: float, cap: float | None) -> Machine:
    """Return `machine` with its plunger capped at `cap` times `flow`, where a cap is given."""
    if cap is None:
        return machine
    if not cap > 0:
        raise UsageError(f"--cap is {cap:g}; it must be a positive multiple of the nominal flow")
    return dataclasses.replace(machine, max_flow=cap * flow)


@dataclasses.dataclass(frozen=True)
class Bench:
    """All that stays the same when the same part is printed in several ways."""

    machine: Machine
    roads: Roads
    """ORIGINAL's."""
    plants: Mapping[int, Plant]
    """Plant of each tool, its plunger's limits included."""
    firmware: Firmware = dataclasses.field(default_factory=Firmware)
    dt: float = DT
    tail: float = TAIL

    def flow(self, command: Signal) -> Signal:
        """Return q for u, mm^3/s, a channel a tool; every plant starts at rest."""
        values = np.empty_like(command.values)
        for channel, tool in enumerate(command.channels):
            plant = self.plants[tool] if tool in self.plants else self.plants[min(self.plants)]
            _, values[channel] = plant.run(plant.initial(), command.values[channel], command.dt)
        return dataclasses.replace(command, values=values)

    def printed(self, execution: Execution) -> tuple[Signal, Signal]:
        """Return u, before the plunger's limits, and q of an execution and of the tail after it."""
        command = execution.command(self.dt, self.tail)
        return command, self.flow(command)

    def judge(self, execution: Execution, places: Places | None = None) -> Score:
        """Print and score an execution; `places`: where its segments lie (`match`), where that is known already."""
        return score(self.roads, execution, self.printed(execution)[1], places)

    def run(self, segments: Segments, advance: float = 0.0, gain: float = 1.0) -> Execution:
        """Execute segments with pressure advance (s) and a flow multiplier."""
        return dataclasses.replace(run(segments, self.firmware, advance), gain=gain)


def set_up(
    original: Segments,
    machine: Machine,
    plant: str,
    *,
    tool_plants: Mapping[int, str] | None = None,
    seed: int = 0,
    firmware: Firmware | None = None,
    dt: float = DT,
    flow: float | None = None,
    gain: float = 1.0,
    lag: float = 1.0,
) -> Bench:
    """Make the bench for ORIGINAL: its roads, and a plant a tool behind a plunger with the machine's limits.

    The plants are made for `flow`, mm^3/s (None: each for its own, whatever the part: a paste does not change with what
    is printed of it); `gain` and `lag` make them drifted ones. InputError where there is no road.
    """
    nominal_flow(original)  # says so where there is none
    tools = sorted({*np.unique(original.tool).tolist(), *(tool_plants or {})})
    plants = {
        int(tool): Plunger(
            load_drifted((tool_plants or {}).get(tool, plant), seed=seed + number, flow=flow, gain=gain, lag=lag),
            machine.max_flow,
            machine.max_flow_slew,
        )
        for number, tool in enumerate(tools)
    }
    roads = find_roads(original, bin_width(machine.nozzle))
    return Bench(machine, roads, plants, firmware or Firmware(), dt)


def reference(bench: Bench, original: Segments) -> tuple[Execution, Floats]:
    """Return ORIGINAL's execution and the flow that its roads should get, [channel, n], tail included, mm^3/s."""
    execution = bench.run(original)
    wanted = dataclasses.replace(
        execution, segments=original.replace(volume=np.where(on_road(original), original.volume, 0.0))
    )
    return execution, wanted.command(bench.dt, bench.tail).values
