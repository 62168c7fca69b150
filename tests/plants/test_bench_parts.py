"""The bench's parts: drawn for every machine, with the roads, flow and time that they should have."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from gcodectl.config import load_machine
from plant_models.bead import find_roads, on_road
from plant_models.bench_cases import PLANTS, SECONDS, SHOPS, begin_of, cases, shop_parts
from plant_models.drawn_parts import DRAWN
from plant_models.gantry import E_ONLY, Firmware, cut
from plant_models.planner import plan
from plant_models.plant import plant_names
from plant_models.printing import nominal_flow
from plant_models.reading import read_moves

ROADS = {
    "fig9": 1, "tic-tac-toe": 11, "short-travels": 10, "dots": 30, "spiral": 1, "zigzag": 2, "mixed-speeds": 8,
    "two-tools": 8, "star": 3, "dashes": 20, "islands": 9, "comb": 1,
}  # fmt: skip
STAR = Path(__file__).resolve().parents[1] / "data" / "star_rel.gcode"


def segments_of(data, machine):
    return cut(read_moves(data, machine), machine, Firmware())


@pytest.mark.parametrize("shop", SHOPS.values(), ids=list(SHOPS))
def test_every_drawn_part_suits_every_machine(shop):
    machine, style = load_machine(shop.machine), shop.style()
    assert set(DRAWN) == set(ROADS)
    for name, draw in DRAWN.items():
        segments = segments_of(draw(style), machine)
        roads = find_roads(segments, 1.0)
        assert int(roads.bin_road[-1]) + 1 == ROADS[name], name
        laid = segments[on_road(segments)]
        bead = style.flow / style.speed
        np.testing.assert_allclose(laid.volume / laid.length, bead, rtol=0.02, err_msg=name)
        if name != "mixed-speeds":
            assert nominal_flow(segments) == pytest.approx(style.flow, rel=0.02), name
        phases = plan(segments, Firmware())
        assert 5 < phases.t[-1] < 90, name


def test_sizes_stretch_what_is_drawn():
    shop = SHOPS["pellet"]
    small, large = (segments_of(DRAWN["dots"](style), load_machine("pellet")) for style in
                    (SHOPS["syringe"].style(), shop.style()))  # fmt: skip
    lengths = [one.length[on_road(one)] for one in (small, large)]
    np.testing.assert_allclose(lengths[1], shop.size * lengths[0], rtol=1e-3)


def test_islands_retract_and_two_tools_change():
    machine, style = load_machine("syringe"), SHOPS["syringe"].style()
    islands = segments_of(DRAWN["islands"](style), machine)
    alone = islands.volume[islands.kind == E_ONLY]
    assert len(alone) == 17
    assert alone.sum() == pytest.approx(-0.5 * style.flow, rel=1e-2)
    assert sorted(set(segments_of(DRAWN["two-tools"](style), machine).tool.tolist())) == [0, 1]


def test_the_beginning_of_a_file_ends_with_a_road():
    machine = load_machine("syringe")
    data = STAR.read_bytes()
    begun = begin_of(data, machine, SECONDS)
    assert data.startswith(begun)
    assert len(begun) < len(data)
    took = plan(segments_of(begun, machine), Firmware())
    assert SECONDS - 2 < took.t[-1] + took.duration[-1] < 2 * SECONDS
    assert begin_of(data, machine, 1e6) == data


def test_cases_are_what_their_machine_prints():
    found = cases(("paste-a", "melt"), 5.0, None, STAR)
    assert {one.plant for one in found} == {"paste-a", "melt"}
    assert len([one for one in found if one.part == "star_rel"]) == 1
    assert all(one.machine.max_flow == pytest.approx(5 * one.flow) for one in found)
    assert {one.name for one in PLANTS} <= set(plant_names())


def test_the_corpus_brings_its_parts():
    corpus = os.environ.get("GCODECTL_CORPUS")
    if not corpus:
        pytest.skip("GCODECTL_CORPUS is not set: no sliced files to print")
    for shop in SHOPS.values():
        parts = shop_parts(shop, Path(corpus))
        assert len(parts) == len(DRAWN) + len(shop.sliced)
