"""The filter with flow models: bytes by any chunking, tools, barriers, volume, quality, and what falls back to what."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from filtering import DATA, HEAD, OWN, body, composed, filtered, moves_of, options, syringe
from flow_models import LINEAR, MODELS, PLUNGER, SCREW, modelled
from moves import plain_python

from gcodectl.errors import UsageError
from gcodectl.flow.flow_model import FlowModel
from gcodectl.flow.library import BasisSet
from gcodectl.motion.follow import Follow, seconds_kernel, share_of
from gcodectl.pipeline import LEVELS, Options, compose_moves, filter_stream, follow_of, read_moves
from gcodectl.records import Kind
from gcodectl.summary import Summary
from plant_models.firmware import execute

MIXED = (
    HEAD + "T0\nG1 X20 E0.02831\nG1 Y12 E0.01699\nG1 X40 Y12 F2400\nG1 Y0 E0.01699 F600\nT1\nG1 X60 F2400\n"
    "G1 X80 E0.02831 F600\nM400\nG4 P300\nG1 X90 E0.01415\nG2 X90 Y6 J3 E0.01334\nT0\nG1 X70 Y30 F2400\n"
    "G1 X50 E0.02831 F600\nG28\nG1 X0 Y0 Z1 F600\nG1 X10 E0.01415\nG1 X10.5 E0.0007\nG1 X30 F2400\n"
)


def how(*models: FlowModel | None, **changes: object) -> Options:
    """Options for tools of these models."""
    sets = tuple(modelled(one, "paste-a" if k == 0 else "paste-b") if one else None for k, one in enumerate(models))
    return Options(syringe(), sets=sets, **changes)  # type: ignore[arg-type]


TWO = how(PLUNGER, LINEAR)


@pytest.mark.parametrize("size", [7, 60, 900])
@pytest.mark.parametrize("options_", [TWO, how(PLUNGER, None), how(SCREW)], ids=["two", "one obeys", "screw"])
def test_any_chunking_gives_the_same_bytes_across_tools_and_barriers(size: int, options_: Options) -> None:
    whole = filtered(MIXED, options_)
    assert b"; gcodectl: changed from" in whole
    assert filtered(MIXED, options_, size=size) == whole


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
def test_any_chunking_of_our_files_gives_the_same_bytes(path) -> None:  # type: ignore[no-untyped-def]
    data = path.read_bytes()
    assert filtered(data, TWO, size=900) == filtered(data, TWO)


def test_plain_python_writes_the_same() -> None:
    wanted = filtered(MIXED[: MIXED.index("M400")], TWO)
    with plain_python("gcodectl.flow", "gcodectl.gcode", "gcodectl.motion", "gcodectl.path"), np.errstate(all="ignore"):
        assert filtered(MIXED[: MIXED.index("M400")], TWO) == wanted


@pytest.mark.parametrize("structure", MODELS)
@pytest.mark.parametrize("name", ["star_rel", "box_abs", "arcs_rel"])
def test_the_volume_composed_is_the_volume_that_e_moves(structure: str, name: str) -> None:
    data = (DATA / f"{name}.gcode").read_bytes()
    options_ = how(MODELS[structure])
    plan, after = composed(data, options_), moves_of(filtered(data, options_), options_)
    added = (plan.command.u - plan.command.reference).sum() * plan.command.dt
    before = plan.moves
    kept = (before.end > before.start) | before.deposits
    own = float((before.e * before.area)[kept].sum())
    digit = float(after.area[0]) * 10.0 ** -int(after.decimals[:, 1].max())
    assert float((after.e * after.area).sum()) == pytest.approx(own + added, abs=0.1 + 5 * digit)


@pytest.mark.parametrize("structure", MODELS)
def test_printed_on_its_own_model_it_lays_what_was_asked_for(structure: str) -> None:
    model = MODELS[structure]
    data = (DATA / "star_rel.gcode").read_bytes()

    options_ = how(model, quality=1.0)
    plan = composed(data, options_)
    run = execute([moves_of(filtered(data, options_), options_)], syringe())
    q = model.predict(run.command(0.01, 2.0).values[0], 0.01)
    assert q.sum() == pytest.approx(plan.command.reference.sum(), rel=0.06)


def test_a_model_is_used_by_default_and_only_where_every_material_has_one() -> None:
    assert Options(syringe()).sequencer == "model"
    assert len(TWO.inversions) == 2
    assert TWO.inversions[0] is not None
    assert TWO.inversions[0].model == PLUNGER
    assert how(PLUNGER, None).inversions[1] is None
    assert how(None).inversions == ()
    assert how(PLUNGER, sequencer="superpose").inversions == how(PLUNGER, sequencer="basis").inversions == ()
    without = dataclasses.replace(TWO, sets=(modelled(PLUNGER), modelled(None, "paste-b")))
    assert without.inversions == ()
    by_signals = dataclasses.replace(without, sequencer="superpose")
    assert body(filtered(MIXED, without)) == body(filtered(MIXED, by_signals))
    assert body(filtered(MIXED, TWO)) != body(filtered(MIXED, by_signals))


@pytest.mark.parametrize("absolute", [False, True])
def test_a_wipe_keeps_its_path_and_loses_its_e_where_the_signal_is_silent(absolute: bool) -> None:
    wipes = "G1 X19 E-0.005 F1920\nG1 X12 E-0.008\nG1 E-0.001 F120\nG1 X5 Y20 F2400\nG1 E0.014 F120\n"
    if absolute:
        text = (
            HEAD.replace("M83", "M82\nG92 E0")
            + "G1 X20 E0.02831\n"
            + (
                "G1 X19 E0.02331 F1920\nG1 X12 E0.01531\nG1 E0.01431 F120\nG1 X5 Y20 F2400\nG1 E0.02831 F120\n"
                "G1 X25 E0.05662 F600\nG4 P2000\n"
            )
        )
    else:
        text = HEAD + "G1 X20 E0.02831\n" + wipes + "G1 X25 E0.02831 F600\nG4 P2000\n"
    fast = how(FlowModel("plunger", K=1.0, flow=5.0, store=0.2, threshold=0.0))
    after = moves_of(filtered(text, fast), fast)
    plan = composed(text.encode(), fast).command
    added = (plan.u - plan.reference).sum() * plan.dt
    assert after.e.sum() * after.area[0] == pytest.approx(2 * 0.02831 * after.area[0] + added, abs=0.02)
    far = (after.p1[:, 0] == 12) & (after.p0[:, 0] > 12)
    assert far.any()
    assert after.e[far].sum() == pytest.approx(0.0, abs=1e-4)


def test_sequencers_differ_and_each_says_who_made_it() -> None:
    outs = {one: filtered(MIXED, dataclasses.replace(TWO, sequencer=one)) for one in ("model", "superpose", "basis")}
    assert len(set(outs.values())) == 3
    for out in outs.values():
        assert out.splitlines()[-1].startswith(b"; gcodectl ")
        assert filtered(out, TWO) == out


def test_what_the_extruder_can_follow_comes_from_the_model() -> None:
    follow = follow_of(TWO)
    assert isinstance(follow, Follow)
    assert follow.flow == pytest.approx(np.outer([PLUNGER.flow, LINEAR.flow], LEVELS))
    assert follow.rise.shape == follow.fall.shape == follow.flow.shape
    one = TWO.inversions[0]
    assert one is not None
    assert seconds_kernel(follow.flow, follow.rise, 0, 5.0) == pytest.approx(one.transit(5.0)[0])
    assert seconds_kernel(follow.flow, follow.fall, 0, 5.0) == pytest.approx(one.transit(5.0)[1])
    assert (follow.start, follow.stop) == (share_of(0.5), share_of(0.5))
    assert follow_of(dataclasses.replace(TWO, quality=0.0)) is None
    assert follow_of(options()) is None or options().inversions
    assert follow_of(dataclasses.replace(TWO, sequencer="basis")) is None
    obeys = follow_of(how(PLUNGER, None))
    assert obeys is not None
    assert not obeys.rise[1].any()
    assert not obeys.fall[1].any()


def test_quality_trades_time_for_the_bead() -> None:
    data = (DATA / "star_rel.gcode").read_bytes()
    times, slowed = [], []
    for quality in (0.0, 0.25, 0.5, 1.0):
        summary = Summary()
        assert list(filter_stream([data], how(LINEAR, quality=quality), summary))
        times.append(summary.time_s)
        slowed.append(summary.slowed_starts + summary.slowed_stops)
    assert times == sorted(times)
    assert times[-1] > times[0] + 0.5
    assert slowed[0] == 0
    assert min(slowed[1:]) > 0


def test_libraries_of_different_sample_times_do_not_mix() -> None:
    other: BasisSet = dataclasses.replace(modelled(LINEAR, "paste-b"), dt=0.02)
    with pytest.raises(UsageError, match="sample times"):
        filtered(MIXED, Options(syringe(), sets=(modelled(PLUNGER), other)))


def test_a_tool_that_obeys_at_once_keeps_its_bytes() -> None:
    # of a part printed with tool 1 alone nothing changes, whatever tool 0 has learned
    text = HEAD + "T1\nG1 X20 E0.02831\nG1 Y12 E0.01699\nG1 X40 Y12 F2400\n"
    out = body(filtered(text, how(PLUNGER, None, keep_retracts=True)))
    assert [line for line in out if line] == text.splitlines()


def test_every_line_of_the_file_is_still_there_in_order() -> None:
    rows = [piece.moves for piece in compose_moves(read_moves([MIXED.encode()], TWO), TWO)]
    seen = np.concatenate([one.line for one in rows])
    assert (np.diff(seen) >= 0).all()
    assert set(range(1, MIXED.count("\n") + 1)) <= set(seen.tolist())
    kinds = np.concatenate([one.kind for one in rows])
    assert (kinds == Kind.TOOL).sum() == 3


def test_the_plunger_keeps_its_cap_through_the_whole_filter() -> None:
    for one in (TWO, how(SCREW), how(MODELS["pressure"])):
        assert np.abs(composed(MIXED.encode(), one).command.u).max() <= syringe().max_flow * (1 + 1e-9)
