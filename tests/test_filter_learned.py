"""The filter with a learned material, measured: path, E, F, lines a second, time, against what was composed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from filtering import OWN, body, composed, filtered, moves_of, options, syringe
from numpy.typing import NDArray

from gcodectl.columns import Floats, Ints
from gcodectl.gcode.changes import LOUD
from gcodectl.gcode.cuts import MISPLACED
from gcodectl.pipeline import Options
from gcodectl.records import Composed, Flag, Kind, Moves
from plant_models.firmware import execute

MATERIALS = {"box_two_tools.gcode": ("paste-a", "paste-b")}
EVERY = pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
POSITION = 0.001
"""mm; three digits, of two axes and of both ends of a line."""
PATH = (Kind.LINE, Kind.ARC)


@dataclass
class Case:
    """A file before and after, and how rows of both belong together."""

    before: Composed
    after: Moves
    out: bytes
    rows: list[tuple[int, int, int]]
    """(row on a path before, first row after that belongs to it or stands before it, last row after)."""

    def own(self, first: int, last: int) -> Ints:
        """Rows after, of first to last, that lie on a known path."""
        return first + np.flatnonzero(on_path(self.after)[first : last + 1])


def on_path(moves: Moves) -> NDArray[np.bool_]:
    return (moves.length > 0) & np.isfinite(moves.p0).all(axis=1)


def how(path: Path) -> Options:
    return options(*MATERIALS.get(path.name, ("paste-a",)))


@lru_cache
def case(path: Path) -> Case:
    data = path.read_bytes()
    before, out = composed(data, how(path)), filtered(data, how(path))
    after = moves_of(out, how(path))
    moves, rows, k = before.moves, [], 0
    for i in np.flatnonzero(on_path(moves)):
        first = k
        # where a part of a line ends, digits end too
        near = 2 * POSITION if moves.flags[i] & int(Flag.GOES_ON) else 1e-6
        while not (on_path(after)[k] and np.allclose(after.p1[k], moves.p1[i], atol=near)):
            k += 1
        rows.append((int(i), first, k))
        k += 1
    return Case(before, after, out, rows)


def gains(path: Path) -> Floats:
    """The plunger's rate a unit of flow, by tool, as the output's reference has it."""
    steady = how(path).bank.steady
    return np.ones(len(steady)) if how(path).inversions else steady


def timed(c: Case, i: int) -> tuple[Floats, Floats]:
    """Times of a move, densely, and how far along its path the plan is then."""
    p = c.before.profile[c.before.profile.row == c.before.moves.row[i]]
    times, places = [], []
    for k in range(len(p)):
        dt = np.linspace(0.0, p.duration[k], 40)
        times.append(p.t[k] + dt)
        places.append(p.s[k] + dt * (p.v[k] + dt * (p.a[k] / 2 + dt * p.j[k] / 6)))
    return np.concatenate(times), np.concatenate(places)


def plunged(c: Case, times: Floats) -> Floats:
    """Volume that the composed command has moved up to `times`, mm^3."""
    command = c.before.command
    edges = command.t0 + command.dt * np.arange(len(command.u) + 1)
    return np.interp(times, edges, np.concatenate([[0.0], np.cumsum(command.u) * command.dt]))


def plunged_reference(c: Case, times: Floats) -> Floats:
    """The same of the reference alone."""
    command = c.before.command
    edges = command.t0 + command.dt * np.arange(len(command.u) + 1)
    return np.interp(times, edges, np.concatenate([[0.0], np.cumsum(command.reference) * command.dt]))


def added_until(c: Case, times: Floats) -> Floats:
    """What the signals have added to the reference up to `times`, mm^3."""
    return plunged(c, times) - plunged_reference(c, times)


def ends(c: Case, i: int, first: int, last: int) -> tuple[Ints, Floats]:
    """Rows after that lay path of row `i`, and the time at which the plan comes to each one's end."""
    own = c.own(first, last)
    times, places = timed(c, i)
    gone = np.cumsum(c.after.length[own])
    return own, np.interp(gone / gone[-1] * places[-1], places, times)


def blur(c: Case, i: int, first: int, last: int) -> Floats:
    """Volume that the signal adds between places that the digits of X and Y cannot tell apart, a row of `ends`."""
    gone = np.cumsum(c.after.length[c.own(first, last)])
    times, places = timed(c, i)
    near = [np.interp(gone / gone[-1] * places[-1] + side, places, times) for side in (-POSITION, POSITION)]
    return np.abs(added_until(c, near[1]) - added_until(c, near[0]))


def quantum(moves: Moves) -> Floats:
    return 10.0 ** -np.maximum(moves.decimals[:, 1], 3) * moves.area


@EVERY
def test_the_path_is_the_same_and_every_stop_on_it_lies_on_the_original(path: Path) -> None:
    c = case(path)
    assert len(c.rows) > 3
    moves, after = c.before.moves, c.after
    assert np.allclose(moves.p1[-1], after.p1[-1], atol=1e-6, equal_nan=True)
    for i, first, last in c.rows:
        own = c.own(first, last)
        points = after.p1[own]
        assert np.isin(after.kind[own], PATH).all()
        if moves.kind[i] == Kind.ARC:
            assert (after.kind[own] == Kind.ARC).all()
            assert after.sweep[own].sum() == pytest.approx(moves.sweep[i], abs=1e-3)
            middle = moves.center[i]
            radius = np.hypot(*(moves.p0[i, :2] - middle))
            assert np.abs(np.hypot(*(points[:, :2] - middle).T) - radius).max() < 0.01
            assert np.abs(after.center[own] - middle).max() < 0.01
        else:
            along = moves.p1[i] - moves.p0[i]
            share = np.clip((points - moves.p0[i]) @ along / (along @ along), 0.0, 1.0)
            assert np.linalg.norm(points - (moves.p0[i] + share[:, None] * along), axis=1).max() < 0.01
            assert (np.diff(share) >= 0).all()
    assert after.length[np.isfinite(after.length)].sum() == pytest.approx(
        moves.length[np.isfinite(moves.length)].sum(), rel=1e-3
    )


@EVERY
def test_e_follows_the_composed_command(path: Path) -> None:
    c = case(path)
    volume = np.cumsum(c.after.e * c.after.area)
    step, kept = quantum(c.after), _kept(c)
    laid = np.where(c.before.moves.deposits, c.before.moves.e * c.before.moves.area, 0.0)
    gain = gains(path)[c.before.moves.tool * (len(how(path).sets) > 1)]
    reference = np.concatenate([[0.0], np.cumsum(gain * laid)])  # by path, as it is written; the command's is by cells
    for n, (i, first, last) in enumerate(c.rows[1:], 1):
        own, times = ends(c, i, first, last)
        before = c.rows[n - 1][2]
        if (np.isin(c.after.kind[before : last + 1], (Kind.TOOL, Kind.BARRIER))).any():
            continue  # what could not be said before a tool change is past
        start = ends(c, c.rows[n - 1][0], c.rows[n - 1][1], before)[1][-1]
        gone = np.cumsum(c.after.length[own])
        by_path = reference[i] + (reference[i + 1] - reference[i]) * gone / gone[-1] - reference[c.rows[n - 1][0] + 1]
        wanted = by_path + added_until(c, times) - added_until(c, np.array([start]))
        moved = volume[own] - volume[before]
        # two digits that a copied line may leave owing at either end, and one of rounding; and positions are rounded:
        # where a line ends by its words the plan is a little earlier or later than where it was cut
        most = 5.0 * step[last] + 1e-3 + kept[n] + blur(c, i, first, last)
        assert (np.abs(moved - wanted) <= most).all(), (path.name, c.after.line[last])
    changes = int((c.before.moves.kind == Kind.TOOL).sum())
    assert volume[-1] == pytest.approx(plunged(c, np.array([np.inf]))[0] + kept.sum(), abs=0.1 * (1 + changes))


def _kept(c: Case) -> Floats:
    """Volume of the slicer's own E-only moves that stay, by the row of path after them; a prime before the first."""
    moves = c.before.moves
    stays = (moves.e != 0) & (moves.length == 0) & (moves.end > moves.start)
    total = np.concatenate([[0.0], np.cumsum(np.where(stays, moves.e * moves.area, 0.0))])
    rows = [i for i, _, _ in c.rows]
    return np.diff(total[[0, *rows]], append=total[-1])[: len(rows)] if rows else np.zeros(0)


@EVERY
def test_no_line_misplaces_more_than_a_thousandth_of_a_second_of_flow(path: Path) -> None:
    c = case(path)
    moves, command = c.before.moves, c.before.command
    gain = gains(path)[moves.tool * (len(how(path).sets) > 1)]
    whole = 0.0
    for i, first, last in c.rows:
        if moves.e[i] <= 0 or c.before.speeds.distance[i] <= 0:
            continue
        nominal = moves.e[i] * moves.area[i] / moves.length[i] * c.before.speeds.cruise[i]
        own, stops = ends(c, i, first, last)
        times, places = timed(c, i)
        begins = np.append(times[0], stops[:-1])
        by_path = gain[i] * moves.e[i] * moves.area[i] / places[-1]
        for k, t0, t1, most in zip(own, begins, stops, blur(c, i, first, last), strict=True):
            # nearer to a move's ends, and in lines as short as may be, there is no room for a further cut
            edges = np.arange(np.ceil(t0 / command.dt), np.floor(t1 / command.dt) + 1) * command.dt
            if t1 - t0 < 0.05 or t0 < times[0] + 0.06 or t1 > times[-1] - 0.06 or not len(edges):
                continue
            s0, s1 = np.interp([t0, t1], times, places)
            share = (np.interp(edges, times, places) - s0) / (s1 - s0)
            said = (c.after.e * c.after.area)[k] - by_path * (s1 - s0)
            off = np.abs(added_until(c, edges) - added_until(c, np.array([t0])) - share * said).max()
            loud = np.abs(command.u - command.reference).max() / LOUD
            assert off < 1.02 * MISPLACED * max(nominal, loud) + 2.0 * quantum(c.after)[k] + most, c.after.line[k]
            whole += t1 - t0
    # arcs that are over sooner than that, and roads that are steady but for their ends
    assert whole > 1.0 or path.name in ("arcs_rel.gcode", "three_lines.gcode")


@EVERY
def test_lines_are_no_more_than_a_hundred_a_second(path: Path) -> None:
    c = case(path)
    for i, first, last in c.rows:
        own, times = ends(c, i, first, last)
        begins = np.append(timed(c, i)[0][0], times[:-1])
        if len(own) > 1:
            assert (times - begins).min() > 0.0085, c.after.line[own]
        assert len(own) <= max(1.0, (times[-1] - begins[0]) * 100 + 1e-6)
    standing = (c.after.length == 0) & (c.after.e != 0) & (c.after.feed > 0)
    made = standing & ~np.isin(c.after.line, _original_lines(c))
    assert (np.abs(c.after.e[made]) / c.after.feed[made] > 0.0085).all()


def _original_lines(c: Case) -> Ints:
    originals = {c.before.moves.raw(k).strip() for k in range(len(c.before.moves))}
    return np.array([k + 1 for k, line in enumerate(c.out.splitlines()) if line.strip() in originals])


@EVERY
def test_no_line_is_faster_than_the_slicer_said(path: Path) -> None:
    c = case(path)
    for i, first, last in c.rows:
        own = c.own(first, last)
        assert c.after.feed[own].max() <= c.before.moves.feed[i] + 0.06 / 60


@EVERY
def test_the_firmware_takes_as_long_as_the_plan_says(path: Path) -> None:
    c = case(path)
    run = execute([c.after], syringe())
    spent = np.zeros(len(c.after))
    np.add.at(spent, np.searchsorted(c.after.row, run.segments.row[run.phases.segment]), run.phases.duration)
    spent[~np.isfinite(c.after.p0).all(axis=1)] = 0.0  # from a place that is not known, as after a tool change
    first, last = c.rows[1][1], c.rows[-1][2]  # the first known move's own begin is where the plan's time begins
    profile = c.before.profile
    begin = timed(c, c.rows[1][0])[0][0]
    end = timed(c, c.rows[-1][0])[0][-1]
    held = profile.t[(profile.row > c.before.moves.row[c.rows[0][0]]) & (profile.t < end)]
    begin = min(begin, float(held.min())) if len(held) else begin
    assert spent[first : last + 1].sum() == pytest.approx(end - begin, rel=0.02)


@EVERY
def test_comments_resets_and_progress_stay_where_they_were(path: Path) -> None:
    c = case(path)
    data = path.read_text().splitlines()
    fixed = [line for line in data if line.startswith((";", "M", "G92", "T", "G28", "G90"))]
    out = body(c.out)
    assert [line for line in out if line.startswith((";", "M", "G92", "T", "G28", "G90"))] == fixed
    layer = -1
    for line in out:  # and every layer's moves stay in their layer
        layer += line.startswith(";LAYER_CHANGE")
    assert layer + 1 == sum(line.startswith(";LAYER_CHANGE") for line in data)
    for (i, _, last), (j, _, _) in zip(c.rows, c.rows[1:], strict=False):
        assert c.after.layer[last] == c.before.moves.layer[i]
        assert c.before.moves.layer[i] <= c.before.moves.layer[j]
