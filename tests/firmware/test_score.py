"""The score of prints whose outcome is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paths import AREA, MACHINE, make, road, subdivide

from gcodectl.columns import Floats
from gcodectl.errors import InputError
from gcodectl.records import Moves, Signal
from plant_models.bead import find_roads
from plant_models.firmware import Execution, execute
from plant_models.score import Score, score

PART = [*road([(0, 0), (20, 0), (20, 20), (0, 20), (0, 1)]), *road([(4, 4), (12, 4), (12, 12)])]
DT = 0.002


def first_order(u: Floats, tau: float, dt: float = DT) -> Floats:
    """Answer u as 1 / (tau s + 1) does, exactly for steps held over dt."""
    q, state, keep = np.empty_like(u), 0.0, np.exp(-dt / tau)
    for i, value in enumerate(u[0]):
        # The mean over the sample, so that volume is kept.
        q[0, i] = value + (state - value) * (1 - keep) * tau / dt
        state = value + (state - value) * keep
    return q


def printed(original: Moves, execution: Execution, tau: float = 0.0, tail: float = 10.0) -> Score:
    u = execution.command(DT, tail)
    q = first_order(u.values, tau) if tau else u.values
    return score(find_roads(execute([original], MACHINE).segments, 1.0), execution, Signal(0.0, DT, q, u.channels))


def test_a_perfect_extruder_lays_a_perfect_bead():
    moves = make(PART)
    result = printed(moves, execute([moves], MACHINE))
    assert result.rmse < 0.003
    assert result.off_path < 0.001
    assert result.unvisited == 0
    assert result.target_volume == pytest.approx(95 * 0.54)
    assert result.on_road == pytest.approx(1, abs=1e-3)
    assert result.table()["bins"] == 95
    assert (result.roads, result.bins) == (2, 95)


def test_a_lag_is_seen_and_matched_pressure_advance_mends_it():
    moves = make(PART)
    lagging = printed(moves, execute([moves], MACHINE), tau=0.3)
    mended = printed(moves, execute([moves], MACHINE, pressure_advance=0.3, smooth_time=0.01), tau=0.3)
    assert lagging.rmse > 0.1
    assert lagging.off_path > 0.03
    assert mended.rmse < 0.2 * lagging.rmse
    assert mended.off_path < 0.3 * lagging.off_path
    assert lagging.worst < -0.5
    assert lagging.worst_line in (2, 7)


def test_too_much_is_a_bias():
    moves = make(PART)
    louder = moves.replace(e=moves.e * 1.1)
    result = printed(moves, execute([louder], MACHINE))
    assert result.bias == pytest.approx(0.1, abs=0.002)
    assert result.rmse == pytest.approx(0.1, abs=0.003)


def test_what_a_move_of_e_alone_lays_is_off_path():
    moves = make([*PART, {"e": 0.01, "feed": 1}])
    result = printed(make(PART), execute([moves], MACHINE))
    assert result.off_path == pytest.approx(0.01 * AREA / result.target_volume, rel=0.02)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(1, 30), min_size=1, max_size=10))
def test_cutting_moves_in_pieces_leaves_the_score(pieces: list[int]):
    moves = make(PART)
    whole, cut = printed(moves, execute([moves], MACHINE)), printed(moves, execute([subdivide(moves, pieces)], MACHINE))
    assert cut.rmse == pytest.approx(whole.rmse, abs=2e-3)
    assert cut.off_path == pytest.approx(whole.off_path, abs=1e-4)
    assert cut.time_s == pytest.approx(whole.time_s, rel=1e-2)


def test_a_moved_part_and_an_empty_target_are_noticed():
    moves = make(PART)
    moved = moves.replace(p0=moves.p0 + 0.5, p1=moves.p1 + 0.5)
    with pytest.raises(InputError, match="never passed over"):
        printed(moves, execute([moved], MACHINE))
    with pytest.raises(InputError, match="nothing to score"):
        printed(make([{"to": (5, 5)}]), execute([moves], MACHINE))
