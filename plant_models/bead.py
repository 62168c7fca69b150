"""The bead: roads cut into bins, and the volume that a flow leaves in each of them.

    road      an unbroken run of segments with path and E > 0; it ends at a travel, a retraction, a tool change,
              a barrier or a jump. Pauses (G4) do not end it, but what flows in them is off path.
    bin       `width` mm of a road (all bins of a road are equally long; a road under 1.5 mm is one bin)
    S         the place along all roads laid end to end, mm: bins are intervals of S

          road 0                road 1
    |----|----|----|----|  |-----|-----|     edges of the bins, S
                         ^ travel: on no road

While the machine moves on a road at a known S, max(q, 0) falls into the bin below; everything else is off path.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.jit import jit
from gcodectl.records import Signal
from plant_models.firmware import Execution
from plant_models.gantry import PATH, PAUSE, Segments, carry_marks

SHORT_ROAD = 1.5
"""mm; a road under it is one bin."""
FINE_NOZZLE = 0.6
"""mm; below it a nozzle lays melt, and bins are finer."""
JUMP = 0.01
"""mm; roads do not reach over a greater gap."""


def bin_width(nozzle: float) -> float:
    """Return the width of the bins, mm: 1, or 0.4 for melt nozzles."""
    return 0.4 if nozzle < FINE_NOZZLE else 1.0


@dataclasses.dataclass(frozen=True)
class Roads:
    """The roads of a file and their bins."""

    path: Segments
    """Every segment with path, travels too, in order."""
    road: Ints
    """Road of each of them; -1 for a travel."""
    begin: Floats
    """S at each segment's start; of a travel, where the next road begins."""
    edges: Floats
    """S at the borders of the bins, mm, one more than bins."""
    target: Floats
    """Volume that each bin should hold, mm^3."""
    bin_road: Ints
    bin_segment: Ints
    """The segment (row of `path`) at the bin's middle."""
    middle: Floats
    """X, Y, Z of the bin's middle, mm, shape (bins, 3)."""

    @property
    def length(self) -> float:
        """Length of all roads, mm."""
        return float(self.edges[-1])


def on_road(segments: Segments) -> Bools:
    """Return which segments lay a bead: they have path and push."""
    return np.asarray((segments.kind == PATH) & (segments.volume > 0))


def find_roads(segments: Segments, width: float) -> Roads:
    """Find the roads of `segments` and cut them into bins of about `width` mm."""
    moving = segments[segments.kind != PAUSE]
    broken = carry_marks(segments.broken, segments.kind != PAUSE)[segments.kind != PAUSE]
    laid = on_road(moving)
    follows = np.zeros(len(moving), dtype=np.bool_)
    near = np.linalg.norm(moving.p0[1:] - moving.p1[:-1], axis=1) <= JUMP
    follows[1:] = laid[1:] & laid[:-1] & near & ~broken[1:] & (moving.tool[1:] == moving.tool[:-1])
    number = np.where(laid, np.cumsum(laid & ~follows) - 1, -1)
    has_path = moving.kind == PATH
    path, road = moving[has_path], number[has_path].astype(np.int64)
    lengths = np.where(road >= 0, path.length, 0.0)
    ends = np.cumsum(lengths)
    begin = ends - lengths
    edges, bin_road = _bins(road, lengths, width)
    volume = np.concatenate([[0.0], np.cumsum(np.where(road >= 0, path.volume, 0.0))])
    target = np.diff(np.interp(edges, np.concatenate([[0.0], ends]), volume)) if len(bin_road) else np.zeros(0)
    centre = (edges[1:] + edges[:-1]) / 2
    roads_only = np.flatnonzero(road >= 0)
    where = roads_only[np.clip(np.searchsorted(ends[roads_only], centre), 0, max(len(roads_only) - 1, 0))]
    part = (centre - begin[where]) / path.length[where]
    middle = path.p0[where] + part[:, None] * (path.p1[where] - path.p0[where])
    return Roads(path, road, begin, edges, target, bin_road, where, middle)


def _bins(road: Ints, lengths: Floats, width: float) -> tuple[Floats, Ints]:
    """Return the borders of all bins, and the road of each bin."""
    total = np.bincount(road[road >= 0], weights=lengths[road >= 0]) if (road >= 0).any() else np.zeros(0)
    count = np.where(total < SHORT_ROAD, 1, np.maximum(1, np.round(total / width))).astype(np.int64)
    bin_road = np.repeat(np.arange(len(total)), count)
    widths = np.repeat(total / np.maximum(count, 1), count)
    edges = np.concatenate([[0.0], np.cumsum(widths)])
    return edges, bin_road


def pieces(roads: Roads) -> tuple[Floats, Floats, Ints, Ints]:
    """Return the ends (mm, shape (n, 3)), bin and layer of the pieces that bins cut the roads' segments into."""
    laid = np.flatnonzero(roads.road >= 0)
    cuts = np.unique(np.concatenate([roads.edges, roads.begin[laid]]))
    middle = (cuts[1:] + cuts[:-1]) / 2
    segment = laid[np.clip(np.searchsorted(roads.begin[laid], middle, side="right") - 1, 0, max(len(laid) - 1, 0))]
    of_bin = np.clip(np.searchsorted(roads.edges, middle, side="right") - 1, 0, len(roads.target) - 1)
    run = roads.path[segment]
    ends = [
        run.p0 + ((place - roads.begin[segment]) / run.length)[:, None] * (run.p1 - run.p0)
        for place in (cuts[:-1], cuts[1:])
    ]
    return ends[0], ends[1], of_bin.astype(np.int64), run.layer.astype(np.int64)


@jit
def deposit_kernel(
    segment: Ints,
    t: Floats,
    duration: Floats,
    s: Floats,
    v: Floats,
    a: Floats,
    length: Floats,
    low: Floats,
    high: Floats,
    channel: Ints,
    flow: Floats,
    dt: float,
    edges: Floats,
    laid: Floats,
) -> float:
    """Add what falls into each bin to `laid`; returns the volume that falls elsewhere while the machine runs.

    `low` and `high` are S at a segment's ends (NaN: on no road); flow[channel, n] is held for dt.
    """
    off, last, bins = 0.0, flow.shape[1] - 1, len(laid)
    for i in range(len(t)):
        j = segment[i]
        begin, end = t[i], t[i] + duration[i]
        n, now, b = min(int(begin / dt), last), begin, -1
        while now < end:
            after = end if n == last else min(end, (n + 1) * dt)
            if after <= now:
                n += 1
                continue
            for c in range(flow.shape[0]):
                volume = max(flow[c, n], 0.0) * (after - now)
                if c != channel[j] or np.isnan(low[j]) or bins == 0:
                    off += volume
                    continue
                x0, x1 = now - begin, after - begin
                slope = (high[j] - low[j]) / length[j]
                s0 = low[j] + slope * (s[i] + (v[i] + 0.5 * a[i] * x0) * x0)
                s1 = low[j] + slope * (s[i] + (v[i] + 0.5 * a[i] * x1) * x1)
                if b < 0:
                    b = min(max(np.searchsorted(edges, s0, side="right") - 1, 0), bins - 1)
                share = volume / (s1 - s0) if s1 - s0 > 1e-12 else 0.0
                left = volume
                while b < bins - 1 and s1 > edges[b + 1]:
                    part = min(share * max(edges[b + 1] - max(s0, edges[b]), 0.0), left)
                    laid[b] += part
                    left -= part
                    b += 1
                laid[b] += left
            now = after
            n += 1
    return off


def deposit(roads: Roads, execution: Execution, low: Floats, high: Floats, flow: Signal) -> tuple[Floats, float]:
    """Return the volume in each bin and the volume off path, mm^3, what flows after the end included.

    `low` and `high`: S at the ends of each segment of `execution`, NaN where it is on no road (see plant_models.match).
    """
    laid = np.zeros(len(roads.target))
    run, phases = execution.segments, execution.phases
    channel = np.searchsorted(flow.channels, run.tool).astype(np.int64)
    off = deposit_kernel(
        phases.segment, phases.t, phases.duration, phases.s, phases.v, phases.a, run.length, low, high, channel,
        flow.values, flow.dt, roads.edges, laid,
    )  # fmt: skip
    times = flow.t0 + flow.dt * np.arange(flow.values.shape[1] + 1)
    after = np.diff(np.maximum(times, execution.duration))
    return laid, float(off) + float((np.maximum(flow.values, 0.0) * after).sum())
