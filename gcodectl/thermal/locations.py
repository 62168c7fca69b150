"""Locations: places at equal steps along everything that is deposited, and how a part cools there.

    rows       |--------|---|----------------|  travel  |-----|        deposition only; travels have no locations
    locations   .   .   . | .   .   .   .   .             .   .        every half bead of path, counted on over the file

How a place cools is told by the heat profile: by the measured place nearest to it; else by its corner's numbers within
`reach` of a turn of more than TURN; else by the numbers for all.
"""

from __future__ import annotations

import math

import numpy as np

from gcodectl.columns import Bools, Floats, Ints
from gcodectl.path import ARC, points_kernel, tangents
from gcodectl.records import Moves
from gcodectl.thermal.beneath import B0, B1, HELD, S, X
from gcodectl.thermal.profile import HeatProfile

TURN = math.radians(30.0)


class Sampler:
    """Finds the locations of chunk after chunk; any chunking gives the same."""

    def __init__(self, step: float) -> None:
        self.step = step
        self.path = 0.0
        """mm deposited so far."""

    def sample(self, moves: Moves) -> tuple[Floats, Ints]:
        """The locations of some moves, shape (n, HELD) with x, y, z and s filled in, and the row of each."""
        lays = moves.deposits
        lengths = np.where(lays, moves.length, 0.0)
        marks = np.cumsum(np.concatenate([[self.path], lengths]))
        begins, ends = marks[:-1], marks[1:]
        first, last = np.floor(begins / self.step) + 1.0, np.floor(ends / self.step)
        counts = np.where(lays, np.maximum(last - first + 1.0, 0.0), 0.0).astype(np.int64)
        row = np.repeat(np.arange(len(moves)), counts)
        number = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
        s = (first[row] + number) * self.step
        out = np.zeros((len(row), HELD))
        out[:, S] = s
        if len(row):
            points = np.empty((len(row), 3))
            share = np.clip((s - begins[row]) / lengths[row], 0.0, 1.0)
            points_kernel(
                moves.p0[row], moves.p1[row], moves.center[row], moves.sweep[row], moves.plane[row],
                moves.kind[row] == ARC, share, points,
            )  # fmt: skip
            out[:, X : X + 3] = points
        if len(moves):
            self.path = float(marks[-1])
        return out, row


def corners(moves: Moves, path0: float) -> Floats:
    """Where along the path of deposition, which begins at `path0` mm, it turns by more than TURN; mm."""
    rows = np.flatnonzero(moves.deposits)
    if len(rows) < 2:
        return np.zeros(0)
    laid = moves[rows]
    start, end = tangents(laid)
    goes_on = (np.abs(laid.p0[1:] - laid.p1[:-1]) < 1e-6).all(axis=1)
    cosine = np.clip((end[:-1] * start[1:]).sum(axis=1), -1.0, 1.0)
    turns: Bools = goes_on & (np.arccos(cosine) > TURN)
    return np.asarray(path0 + np.cumsum(laid.length)[:-1][turns])


def cooling(locations: Floats, turns: Floats, profile: HeatProfile) -> None:
    """Fill in how each location cools; `turns` are the corners of its path, mm."""
    locations[:, B0], locations[:, B1] = profile.b0, profile.b1
    if len(profile.at):
        from scipy.spatial import cKDTree

        _, nearest = cKDTree(profile.at[:, :2]).query(locations[:, X : X + 2])
        locations[:, B0 : B1 + 1] = profile.at[nearest, 2:]
    elif profile.corner is not None and len(turns):
        after = np.searchsorted(turns, locations[:, S])
        padded = np.concatenate([[-np.inf], turns, [np.inf]])
        near = np.minimum(locations[:, S] - padded[after], padded[after + 1] - locations[:, S])
        locations[near <= profile.corner.reach, B0 : B1 + 1] = profile.corner.b0, profile.corner.b1
