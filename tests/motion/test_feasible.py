"""What a firmware would refuse, slow down or blur: every rule by a line that breaks it and one that just does not."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from moves import SYRINGE, Pen, chunked, pens, same

from gcodectl.config import Machine, load_machine
from gcodectl.motion.feasible import BUFFER, Effect, Findings, Rule, inspect
from gcodectl.motion.lookahead import plan
from gcodectl.motion.profile import profile
from gcodectl.records import Moves

KLIPPER = load_machine("syringe-klipper")
AREA = KLIPPER.area
THICKEST = 4 * KLIPPER.nozzle**2
FREE = Machine("free", max_flow=1e6, max_flow_slew=1e9, e_accel=50.0, e_steps_per_mm=1e9, max_lines_per_second=1e6)
"""Marlin, and nothing of the machine's own in the way."""


def found(moves: Moves, machine: Machine, size: int = 1000) -> Findings:
    timed = profile(plan(chunked(moves, size), machine), machine)
    return Findings.concat([findings for *_, findings in inspect(timed, machine)])


def by_rule(pen: Pen, machine: Machine) -> dict[Rule, tuple[float, float]]:
    """Value and limit of the first finding of each rule."""
    some = found(pen.moves(), machine)
    return {Rule(int(one)): (float(v), float(m)) for one, v, m in zip(some.rule, some.value, some.limit, strict=True)}


@pytest.mark.parametrize(("bead", "length", "refused"), [
    (0.99, 20, False), (1.01, 20, True),
    (3.0, 0.9 * KLIPPER.nozzle / 3, False), (3.0, 1.1 * KLIPPER.nozzle / 3, True),
])  # fmt: skip
def test_klipper_refuses_a_thick_bead_unless_it_is_tiny(bead: float, length: float, refused: bool) -> None:
    rules = by_rule(Pen(KLIPPER).road(length, 0, bead=bead * THICKEST), KLIPPER)
    assert (Rule.BEAD in rules) == refused
    if refused:
        assert rules[Rule.BEAD] == pytest.approx((bead * THICKEST, THICKEST))


def test_only_klipper_looks_at_the_bead_and_never_where_e_moves_alone() -> None:
    pen = Pen(KLIPPER).road(20, 0, bead=3 * THICKEST)
    assert Rule.BEAD not in by_rule(pen, SYRINGE)
    assert Rule.BEAD not in by_rule(Pen(KLIPPER).go(0, 0, 5, e=1.0), KLIPPER)


@pytest.mark.parametrize(("e", "machine", "refused"), [
    (51, KLIPPER, True), (49, KLIPPER, False), (-51, KLIPPER, True), (201, SYRINGE, True), (199, SYRINGE, False),
])  # fmt: skip
def test_e_in_one_line(e: float, machine: Machine, refused: bool) -> None:
    rules = by_rule(Pen(machine).push(e), machine)
    assert (Rule.LENGTH in rules) == refused


def test_marlin_counts_e_on_a_path_too_and_klipper_does_not() -> None:
    pen = Pen(area_of(2.0)).go(100, 0, e=210)
    assert by_rule(pen, FREE)[Rule.LENGTH] == (210, 200)
    free = dataclasses.replace(FREE, dialect="klipper", max_bead=1e9)
    assert Rule.LENGTH not in by_rule(pen, free)
    assert Rule.E_SPEED not in by_rule(Pen(FREE).go(20, 0, e=100), free)


def area_of(diameter: float) -> Machine:
    return dataclasses.replace(FREE, barrel_diameter=diameter)


def test_e_speed_and_acceleration() -> None:
    machine = dataclasses.replace(FREE, e_max_speed=2.0, e_max_accel=30.0)
    rules = by_rule(Pen(machine).go(100, 0, e=25), machine)
    assert rules[Rule.E_SPEED] == pytest.approx((2.5, 2.0))
    assert rules[Rule.E_ACCEL] == pytest.approx((0.25 * machine.accel, 30.0))
    assert not by_rule(Pen(machine).go(100, 0, e=5), machine)


def test_klippers_extrude_only_acceleration_holds_for_e_that_goes_back_on_a_path() -> None:
    rules = by_rule(Pen(KLIPPER).go(20, 0, e=-0.5).go(40, 0, e=0.02), KLIPPER)
    assert rules[Rule.E_ACCEL] == pytest.approx((0.025 * KLIPPER.accel, 7.2))


@pytest.mark.parametrize(("machine", "allowed"), [(FREE, 5.0), (dataclasses.replace(FREE, dialect="klipper"), 1.0)])
def test_a_step_of_e_at_a_junction(machine: Machine, allowed: float) -> None:
    for share, slowed in ((0.99, False), (1.01, True)):
        step = allowed * share / 10
        rules = by_rule(Pen(machine).go(50, 0, e=0.5).go(100, 0, e=50 * (0.01 + step)), machine)
        assert (Rule.E_STEP in rules) == slowed
        if slowed:
            assert rules[Rule.E_STEP] == pytest.approx((allowed * share, allowed))


def test_a_step_of_e_after_a_rest_is_none() -> None:
    machine = dataclasses.replace(FREE, dialect="klipper")
    pen = Pen(machine).go(50, 0, e=0.5)
    assert Rule.E_STEP in by_rule(pen.go(100, 0, e=10.0), machine)
    pen = Pen(machine).go(50, 0, e=0.5).barrier()
    assert Rule.E_STEP not in by_rule(pen.go(100, 0, e=10.0), machine)


def test_lines_come_too_fast_only_in_long_bursts() -> None:
    machine = dataclasses.replace(SYRINGE, steps_per_mm=(1e6, 1e6, 1e6))
    for lines, burst in ((BUFFER - 1, False), (4 * BUFFER, True)):
        pen = Pen(machine).road(20, 0)
        for _ in range(lines):
            pen.road(pen.at[0] + 0.05, 0)
        rules = by_rule(pen.road(60, 0), machine)
        assert (Rule.RATE in rules) == burst
    assert rules[Rule.RATE][0] == pytest.approx(10 / 0.05, rel=0.2)


def test_short_lines_are_merged_by_marlin_alone() -> None:
    for machine, merged in ((SYRINGE, True), (KLIPPER, False)):
        rules = by_rule(Pen(machine).road(0.074, 0), machine)
        assert (Rule.MERGED in rules) == merged
    assert rules.keys() <= {Rule.DIGITS}
    assert Rule.MERGED not in by_rule(Pen(SYRINGE).road(0.076, 0), SYRINGE)
    assert by_rule(Pen(SYRINGE).road(0.074, 0), SYRINGE)[Rule.MERGED] == pytest.approx((5.92, 6))


def test_an_arc_goes_as_far_as_it_is_long() -> None:
    whole = Pen(KLIPPER).arc((10.0, 0.0), 2 * math.pi, bead=1.5 * THICKEST)
    assert by_rule(whole, KLIPPER).keys() == {Rule.BEAD}


def test_e_digits() -> None:
    for places, blurred in ((3, True), (5, False)):
        rules = by_rule(Pen(SYRINGE).road(5, 0, decimals=(3, places)), SYRINGE)
        assert (Rule.DIGITS in rules) == blurred
        if blurred:
            e = 0.5 * 5 / SYRINGE.area
            assert rules[Rule.DIGITS] == pytest.approx((0.0005 / e, 0.01))


def test_findings_name_their_lines_in_order() -> None:
    pen = Pen(KLIPPER).plain().road(20, 0, bead=2 * THICKEST).road(40, 0).road(60, 0, bead=2 * THICKEST).push(60)
    some = found(pen.moves(), KLIPPER)
    refused = some[some.rule <= Rule.LENGTH]
    assert refused.line.tolist() == [2, 4, 5]
    assert refused.row.tolist() == [1, 3, 4]
    assert [Rule(int(one)).effect for one in refused.rule] == [Effect.REFUSED] * 3


def test_every_rule_says_what_it_is() -> None:
    assert all(rule.label and rule.unit for rule in Rule)
    effects = [rule.effect for rule in Rule]
    assert effects == sorted(effects)
    assert set(effects) == set(Effect)


def test_nothing_at_all() -> None:
    assert not len(found(Moves.empty(), KLIPPER))
    assert not len(found(Pen().plain().barrier().dwell(1.0).moves(), KLIPPER))


@settings(max_examples=25, deadline=None)
@given(pens(), st.sampled_from([1, 3]), st.sampled_from([KLIPPER, dataclasses.replace(SYRINGE, e_corner_speed=1e-3)]))
def test_any_chunking_finds_the_same(pen: Pen, size: int, machine: Machine) -> None:
    moves = pen.moves()
    same(found(moves, machine), found(moves, machine, size))


@settings(max_examples=25, deadline=None)
@given(pens())
def test_wider_limits_find_less(pen: Pen) -> None:
    moves = pen.moves()
    wide: dict[str, Any] = dict.fromkeys(("e_corner_speed", "e_max_speed", "e_max_accel", "e_longest", "max_bead"), 1e9)
    narrow, loose = found(moves, KLIPPER), found(moves, dataclasses.replace(KLIPPER, **wide, e_accel=7.2))
    assert not (loose.rule == Rule.BEAD).any()
    assert not (loose.rule == Rule.E_STEP).any()
    left = set(zip(loose.row.tolist(), loose.rule.tolist(), strict=True))
    assert left <= set(zip(narrow.row.tolist(), narrow.rule.tolist(), strict=True)) | {
        (int(row), int(Rule.E_ACCEL)) for row in np.unique(loose.row)
    }
