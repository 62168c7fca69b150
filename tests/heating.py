"""How the tests of heat make their G-code: rings of road on each other, by a large machine; and what lies beneath."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np

from gcodectl.columns import Floats
from gcodectl.config import Machine
from gcodectl.pipeline import Options, filter_stream
from gcodectl.summary import Summary
from gcodectl.thermal.profile import HeatProfile
from gcodectl.thermal.surface import Head
from plant_models.firmware import execute
from plant_models.reading import read_moves

LARGE = Machine(
    "large", dialect="klipper", barrel_diameter=20.0, nozzle=14.0, max_speed=(400.0, 400.0, 20.0), accel=200.0,
    travel_accel=500.0, jerk=1e6, corner_speed=8.0, max_flow=2e5, max_flow_slew=1e6, max_bead=1e6, e_longest=1e9,
    e_max_speed=1e5, e_max_accel=1e6, e_accel=1e4,
)  # fmt: skip
PROFILE = HeatProfile(b0=1.007, b1=-0.01003, bead=20.0, sigma=1.0, head=Head(100.0, 400.0, 200.0))
RING = ((0.0, 0.0), (900.0, 0.0), (900.0, 600.0), (0.0, 600.0), (0.0, 0.0))
HEIGHT, AREA = 5.0, 100.0


def rings(
    layers: int = 4, speed: float = 200.0, ring: tuple[tuple[float, float], ...] = RING, lift: bool = True
) -> str:
    """G-code of `layers` rings, each begun behind a retract, a lift and a travel (`lift`), or behind a step alone."""
    rows = ["G21", "G90", "M83", f"G1 X{ring[0][0]} Y{ring[0][1]} Z30 F6000"]
    for layer in range(layers):
        z = HEIGHT * (layer + 1)
        rows.append(";LAYER_CHANGE")
        if lift:
            rows += ["G1 E-2 F1800", f"G1 Z{z + 10} F1200", f"G1 X{ring[0][0]} Y{ring[0][1]} F6000", f"G1 Z{z} F1200"]
            rows.append("G1 E2 F1800")
        else:
            rows.append(f"G1 Z{z} F1200")
        for (x0, y0), (x, y) in pairwise(ring):
            e = math.hypot(x - x0, y - y0) * AREA / LARGE.area
            rows.append(f"G1 X{x} Y{y} E{e:.4f} F{60 * speed}")
    return "\n".join([*rows, "G1 E-2 F1800", "G1 Z200", ""])


def heated(
    data: str | bytes, profile: HeatProfile | None = PROFILE, size: int = 1 << 20, **more: object
) -> tuple[bytes, Summary]:
    """Filter with a heat profile; chunks end with a line."""
    data = data.encode() if isinstance(data, str) else data
    lines, chunks = data.splitlines(keepends=True), []
    while lines:
        chunk = [lines.pop(0)]
        while lines and sum(map(len, chunk)) < size:
            chunk.append(lines.pop(0))
        chunks.append(b"".join(chunk))
    summary = Summary()
    how = Options(**{"machine": LARGE, "heat": profile, **more})  # type: ignore[arg-type]
    return b"".join(filter_stream(chunks, how, summary)), summary


def met(data: bytes, b0: Floats | float, b1: Floats | float, layers: int, machine: Machine = LARGE) -> Floats:
    """What the firmware's own timeline of a file of rings meets beneath, degC, [layers - 1, places along the ring].

    Written apart from the filter: times are the virtual firmware's, the law is (3.2), places are shares of the ring.
    """
    execution = execute([read_moves(data, machine)], machine)
    segments, phases = execution.segments, execution.phases
    lays = (segments.e > 0) & (segments.length > 0) & (segments.p0[:, 2] == segments.p1[:, 2])
    height = np.round(segments.p1[:, 2], 3)
    passed = []
    for z in np.unique(height[lays])[:layers]:
        rows = np.flatnonzero(lays & (height == z))
        begin = np.zeros(len(segments))
        begin[rows] = np.cumsum(segments.length[rows]) - segments.length[rows]
        mine = np.flatnonzero(np.isin(phases.segment, rows))
        path, t = begin[phases.segment[mine]] + phases.s[mine], phases.t[mine]
        whole = segments.length[rows].sum()
        path, t = np.append(path, whole), np.append(t, phases.t[mine[-1]] + phases.duration[mine[-1]])
        passed.append(np.interp(np.linspace(0.02, 0.98, 97) * whole, path, t))
    age = np.diff(np.array(passed), axis=0)
    rest = 24.0 - np.asarray(b0) / np.asarray(b1)
    return np.asarray(rest + (250.0 - rest) * np.exp(np.asarray(b1) * age))


def extruded(data: bytes, machine: Machine = LARGE) -> float:
    """E that a file lays along its roads, mm."""
    moves = read_moves(data, machine)
    return float(moves.e[(moves.e > 0) & (moves.length > 0)].sum())


PELLETS = ("pellet_box_prusaslicer.gcode", "pellet_vase_prusaslicer.gcode")


def corpus_file(folder: Path | None, name: str) -> bytes:
    assert folder is not None
    return (folder / name).read_bytes()
