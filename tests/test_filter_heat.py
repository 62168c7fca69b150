"""The filter by heat: what the firmware's own timeline meets beneath, and what must not change."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from filtering import CORPUS, needs_corpus
from heating import LARGE, PELLETS, PROFILE, corpus_file, extruded, heated, met, rings

from gcodectl.cli.common import material_sets
from gcodectl.config import load_machine
from gcodectl.pipeline import Options, read_moves, time_moves
from gcodectl.records import Moves
from gcodectl.thermal.profile import Corner, HeatProfile
from gcodectl.thermal.surface import Band, Head

LAYERS = 5
BAND = PROFILE.band


def outside(data: bytes, b0: object = PROFILE.b0, b1: object = PROFILE.b1) -> tuple[float, float]:
    """Shares of locations too hot and too cold."""
    found = met(data, b0, b1, LAYERS)  # type: ignore[arg-type]
    return float((found > BAND.high).mean()), float((found < BAND.low).mean())


def test_layers_that_would_lie_on_what_is_too_hot_are_slowed_and_waited_for() -> None:
    sliced = rings(LAYERS)
    assert outside(sliced.encode()) == (1.0, 0.0)
    out, summary = heated(sliced)
    assert outside(out) == (0.0, 0.0)
    found = met(out, PROFILE.b0, PROFILE.b1, LAYERS)
    assert abs(found.mean() - BAND.best) < 4.0
    heat = summary.heat
    assert heat is not None
    assert (heat.sliced.hot, heat.planned.hot, heat.planned.cold) == (heat.beneath, 0, 0)
    assert heat.waits == LAYERS - 1
    assert summary.limited_by["heat beneath"] > 0
    assert heat.planned.total / heat.beneath == pytest.approx(found.mean(), abs=0.5)
    assert extruded(out) == pytest.approx(extruded(sliced.encode()), rel=1e-6)


def test_waits_stand_between_retract_and_push_at_the_highest_place() -> None:
    lines = heated(rings(3))[0].decode().splitlines()
    waits = [k for k, line in enumerate(lines) if line.startswith("G4")]
    assert len(waits) == 2
    for k in waits:
        before = lines[:k]
        last_pull = max(n for n, line in enumerate(before) if line.startswith("G1 E-2"))
        assert not any(re.match(r"G1 E\d", line) for line in before[last_pull:])
        heights = [float(line.split("Z")[1].split()[0]) for line in lines[last_pull : k + 3] if " Z" in line]
        assert heights[-2] > heights[-1] or heights[-1] == max(heights)
    assert lines.count("G1 E2 F1800") == 3


def test_slowing_comes_first_and_keeps_to_the_heads_range() -> None:
    slow = dataclasses.replace(PROFILE, head=Head(12.0, 400.0, 200.0))
    out, summary = heated(rings(LAYERS), slow)
    heat = summary.heat
    assert heat is not None
    assert outside(out) == (0.0, 0.0)
    assert heat.waits == 1, "only the first layer that lies on another waits: the others come slowly enough"
    moves = Moves.concat(list(read_moves([out], Options(LARGE))))
    feeds = moves.feed[moves.deposits]
    assert 12.0 - 0.01 <= feeds.min() < 30.0
    assert feeds.max() <= 200.0
    assert min(Moves.concat(list(read_moves([heated(rings(3))[0]], Options(LARGE)))).feed[3:]) >= 20.0 - 0.01


def test_without_a_word_of_the_head_every_row_keeps_half_of_what_the_file_asks_for() -> None:
    out, summary = heated(rings(LAYERS), dataclasses.replace(PROFILE, head=None))
    assert outside(out) == (0.0, 0.0)
    assert summary.limited_by["heat beneath"] > 0
    moves = Moves.concat(list(read_moves([out], Options(LARGE))))
    assert moves.feed[moves.deposits].min() == pytest.approx(100.0, abs=0.05)
    hasty = heated(rings(3).replace("F12000", "F90000"), dataclasses.replace(PROFILE, head=None))[1].heat
    assert hasty is not None
    assert hasty.slowed > 0, "what the machine cannot do is not what it is half of"


def test_without_a_place_off_the_road_there_is_only_slowing_and_what_stays_hot_is_counted() -> None:
    vase = ["G21", "G90", "M83", "G1 X0 Y0 Z5 F6000"]
    for turn in range(1, 5):
        for k, (x, y) in enumerate([(900, 0), (900, 600), (0, 600), (0, 0)], start=1):
            vase.append(f"G1 X{x} Y{y} Z{5 * turn + 5 * k / 4:g} E250 F12000")
    out, summary = heated("\n".join([*vase, ""]))
    heat = summary.heat
    assert heat is not None
    assert b"G4" not in out
    assert heat.planned.hot > 0
    assert heat.planned.hot_by < heat.sliced.hot_by
    assert heat.slowed >= 3


def test_what_is_too_cold_runs_as_the_file_has_it() -> None:
    out, summary = heated(rings(3, speed=8.0), dataclasses.replace(PROFILE, b0=0.5))
    assert summary.heat is not None
    assert summary.heat.planned.cold == summary.heat.beneath > 0
    assert summary.heat.planned.cold_by == pytest.approx(summary.heat.sliced.cold_by)
    assert out.startswith(rings(3, speed=8.0).encode())


def test_hot_corners_are_not_waited_for_until_all_else_is_too_cold() -> None:
    profile = HeatProfile(b0=0.5, b1=-0.03, bead=20.0, corner=Corner(1.0, -0.0095, 60.0))
    sliced = rings(4, speed=60.0)
    out, summary = heated(sliced, profile)
    heat = summary.heat
    assert heat is not None
    assert heat.sliced.cold > heat.sliced.hot > 0, "slow corners, and all else long cold"
    assert out.startswith(sliced.encode())
    assert (heat.planned.hot, heat.planned.cold, heat.waits) == (heat.sliced.hot, heat.sliced.cold, 0)


def test_the_first_layer_and_bridges_have_no_limit() -> None:
    out, summary = heated(rings(1))
    assert summary.heat is not None
    assert summary.heat.beneath == 0
    assert out.startswith(rings(1).encode())
    apart = rings(2).replace("Z10 ", "Z35 ").replace("Z20.0", "Z45.0").replace("Z10.0", "Z35.0")
    assert heated(apart)[1].heat.beneath == 0  # type: ignore[union-attr]


def test_corners_that_cool_slowly_are_planned_for() -> None:
    corner = Corner(0.95, -0.0082, 80.0)
    profile = dataclasses.replace(PROFILE, corner=corner)
    place = np.linspace(0.02, 0.98, 97) * 3000.0
    near = np.abs(place[:, None] - np.array([900.0, 1500.0, 2400.0])).min(axis=1) <= 80.0
    b0, b1 = np.where(near, corner.b0, PROFILE.b0), np.where(near, corner.b1, PROFILE.b1)
    knows, guesses = (
        met(heated(rings(LAYERS), profile)[0], b0, b1, LAYERS),
        met(heated(rings(LAYERS))[0], b0, b1, LAYERS),
    )
    assert knows.max() <= BAND.high
    assert knows.max() < guesses.max() - 2.0


def test_measured_places_are_planned_for() -> None:
    at = np.array([[450.0, 0.0, 1.007, -0.01003], [450.0, 600.0, 0.9, -0.0078]])
    profile = dataclasses.replace(PROFILE, at=at)
    place = np.linspace(0.02, 0.98, 97) * 3000.0
    far = (place > 1200.0) & (place < 2700.0)
    found = met(heated(rings(LAYERS), profile)[0], np.where(far, 0.9, 1.007), np.where(far, -0.0078, -0.01003), LAYERS)
    assert found.max() <= BAND.high
    assert found.min() >= BAND.low


@pytest.mark.parametrize("size", [1, 70])
def test_any_chunking_gives_the_same_bytes(size: int) -> None:
    short = rings(3)
    assert heated(short, size=size)[0] == heated(short)[0]


def test_learned_material_keeps_its_limits_and_the_heats() -> None:
    sets = material_sets(["pellet"], 5.0)
    machine = dataclasses.replace(LARGE, nozzle=5.0, max_flow=7000.0, max_flow_slew=70_000.0)
    profile = dataclasses.replace(PROFILE, head=Head(15.0, 400.0, 200.0))
    sliced = rings(3, speed=20.0)
    out, summary = heated(sliced, profile, machine=machine, sets=sets)
    assert summary.heat is not None
    assert summary.heat.sliced.hot > 0 == summary.heat.planned.hot
    found = met(out, PROFILE.b0, PROFILE.b1, 3, machine)
    assert found.max() <= BAND.high
    moves = Moves.concat(list(read_moves([out], Options(machine))))
    flows = (moves.e * moves.area / np.maximum(moves.length, 1e-9) * moves.feed)[moves.deposits]
    assert flows.max() <= machine.max_flow * 1.01
    unheeded = heated(sliced, None, machine=machine, sets=sets)[0]
    assert extruded(out, machine) == pytest.approx(extruded(unheeded, machine), rel=0.02)


@needs_corpus
@pytest.mark.parametrize("name", PELLETS)
def test_real_files_end_no_hotter_and_lay_the_same(name: str) -> None:
    machine = load_machine("pellet")
    data = corpus_file(CORPUS, name)
    profile = dataclasses.replace(PROFILE, bead=0.0, head=Head(5.0, 100.0, 500.0))
    out, summary = heated(data, profile, machine=machine)
    heat = summary.heat
    assert heat is not None
    assert heat.sliced.hot > 0.9 * heat.beneath
    assert heat.planned.hot < 0.06 * heat.beneath
    assert extruded(out, machine) == pytest.approx(extruded(data, machine), rel=1e-5)
    if len(data) < 50_000:
        assert heated(data, profile, machine=machine, size=5000)[0] == out
    *_, (_, _, phases) = time_moves(read_moves([out], Options(machine)), machine)
    assert float(phases.t[-1] + phases.duration[-1]) == pytest.approx(summary.time_s, rel=0.02)


def test_roads_are_as_wide_as_the_slicer_marks_them_where_no_profile_says() -> None:
    unsaid = dataclasses.replace(PROFILE, bead=0.0)
    marked = rings(2).replace(";LAYER_CHANGE", ";LAYER_CHANGE\n;WIDTH:8.5")
    for text, bead in ((marked, 8.5), (rings(2), 1.4 * LARGE.nozzle), (";\n" * 30 + marked, 8.5)):
        heat = heated(text, unsaid, size=50)[1].heat
        assert heat is not None
        assert heat.bead == pytest.approx(bead)
        assert heat.planned.hot < heat.sliced.hot


def test_the_band_is_narrowed_by_what_is_not_known() -> None:
    vague = dataclasses.replace(PROFILE, sigma=6.0, band=Band(120.0, 135.0, 150.0))
    hottest = [row["hottest"] for row in heated(rings(3), vague)[1].heat.rows]  # type: ignore[union-attr]
    assert max(hottest) <= vague.hottest + 0.1 < BAND.high - 9.0
