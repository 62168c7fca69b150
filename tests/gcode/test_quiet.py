"""Quiet chunks: their rows are skipped where nothing changes, and what goes on from them is as if they were written."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from filtering import DATA, NEUTRAL, composed, options, syringe

from gcodectl.columns import Floats
from gcodectl.gcode import emit as stage
from gcodectl.gcode.packed import OWED, Table, new_state, table_of
from gcodectl.gcode.quiet import quiet_rows
from gcodectl.records import Command, Composed

FILES = [DATA / name for name in ("box_abs.gcode", "arcs_rel.gcode", "box_two_tools.gcode")]


def written(parts: list[Composed], skips: bool, monkeypatch: pytest.MonkeyPatch) -> tuple[bytes, Floats]:
    """What is written of some chunks, and the state behind them, with and without skipping rows."""
    states: list[Floats] = []

    def rows(table: Table, steady: Floats, state: Floats) -> int:
        states.append(state)
        return quiet_rows(table, steady, state) if skips else 0

    monkeypatch.setattr(stage, "quiet_rows", rows)
    out = b"".join(stage.emit(iter(parts), syringe(), np.ones(1)))
    return out, states[-1]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_skipped_rows_leave_what_written_ones_do(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = path.read_bytes()
    whole = composed(data, dataclasses.replace(NEUTRAL, keep_retracts=True))
    rows = len(whole.moves)
    for cut in (rows // 3, rows // 2, rows):
        parts = [_slice(whole, 0, cut), _slice(whole, cut, rows)] if cut < rows else [whole]
        (out, state), (plain, wanted) = (written(parts, skips, monkeypatch) for skips in (True, False))
        assert out == plain == data
        assert np.array_equal(state[OWED:], wanted[OWED:], equal_nan=True)
        table = table_of(whole)
        assert (
            quiet_rows(table, np.ones(1), new_state(syringe())) > 0.3 * rows
        )  # behind the last road there are comments, by the hundred


def test_no_rows_are_skipped_where_something_changes() -> None:
    data = (DATA / "box_abs.gcode").read_bytes()
    table = table_of(composed(data, options()))
    assert quiet_rows(table, np.ones(1), new_state(syringe())) == 0
    still = table_of(composed(data, dataclasses.replace(NEUTRAL, keep_retracts=True)))
    assert quiet_rows(still, np.full(1, 0.9), new_state(syringe())) == 0
    owing = new_state(syringe())
    owing[OWED] = 1.0
    assert quiet_rows(still, np.ones(1), owing) == 0


def _slice(whole: Composed, first: int, last: int) -> Composed:
    """Some rows of a chunk and their phases, without samples, as a neutral material has them."""
    moves = whole.moves[first:last]
    mine = (whole.profile.row >= moves.row[0]) & (whole.profile.row <= moves.row[-1])
    nothing = np.zeros(0)
    command = Command(0.0, whole.command.dt, nothing, nothing)
    return Composed(moves, whole.speeds[first:last], whole.profile[mine], whole.tasks, command)
