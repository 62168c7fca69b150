"""Coasting: the plunger stops a tuned distance before each road ends, and what is in the nozzle lays the rest.

    E > 0   ============|--------   E = 0 over the last `distance` mm, at most half of the road
                        coast

As in Cura and PrusaSlicer's forks: the path and its speeds stay as they are, the volume is simply left out.
"""

from __future__ import annotations

import numpy as np

from gcodectl.columns import Floats
from plant_models.bead import find_roads
from plant_models.gantry import PATH, Segments


def coast(segments: Segments, distance: float) -> Segments:
    """Return `segments` without E over the last `distance` mm of every road."""
    if distance <= 0:
        return segments
    keep = np.ones(len(segments))
    keep[segments.kind == PATH] = _kept(segments, distance)
    cut = (keep > 0) & (keep < 1)
    order = np.repeat(np.arange(len(segments)), 1 + cut)
    second = np.concatenate([[False], order[1:] == order[:-1]])
    first = cut[order] & ~second
    share = np.where(first, keep[order], np.where(second, 1 - keep[order], 1.0))
    pushes = np.where(second | (keep[order] == 0), 0.0, 1.0)
    out = segments[order]
    middle = out.p0 + keep[order][:, None] * (out.p1 - out.p0)
    return out.replace(
        p0=np.where(second[:, None], middle, out.p0),
        p1=np.where(first[:, None], middle, out.p1),
        length=out.length * share,
        e=out.e * share * pushes,
        volume=out.volume * share * pushes,
        rest=out.rest & ~second,
        broken=out.broken & ~second,
    )


def _kept(segments: Segments, distance: float) -> Floats:
    """Return which share of each segment with path keeps its E (1 on travels)."""
    roads = find_roads(segments, 1.0)
    laid = roads.road >= 0
    keep = np.ones(len(roads.road))
    if not laid.any():
        return keep
    length = roads.path.length[laid]
    total = np.bincount(roads.road[laid], weights=length)
    end = np.cumsum(total)[roads.road[laid]]
    stop = end - np.minimum(distance, total[roads.road[laid]] / 2)
    keep[laid] = np.clip((stop - roads.begin[laid]) / length, 0.0, 1.0)
    keep[laid] = np.where(keep[laid] * length < 1e-6, 0.0, np.where((1 - keep[laid]) * length < 1e-6, 1.0, keep[laid]))
    return keep
