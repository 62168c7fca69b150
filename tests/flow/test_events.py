"""When signals are due and how much of each: margins share their gap, a Start puts back what the Stop took out."""

import dataclasses

import numpy as np
import pytest

from gcodectl.flow.bank import added_volume, signal_bank, softened
from gcodectl.flow.events import due_share, flow_events, moments, unused_margin
from gcodectl.flow.library import BasisSet, BasisSignal, open_library
from gcodectl.records import TaskKind, Tasks

START, STOP, CORNER, STEADY = TaskKind.START, TaskKind.STOP, TaskKind.CORNER, TaskKind.STEADY
DT = 0.01


def paste(start: float = 9.0, stop: float = -8.0) -> BasisSet:
    """A Start of 0.5 s from 0.2 s before the road, a Stop of 0.4 s that ends 0.1 s after it; gain 1, nominal flow 5."""
    signals = {
        START: BasisSignal(np.full(50, start), lead=0.3, margin=0.1),
        STOP: BasisSignal(np.full(40, stop), lead=0.25, margin=0.05),
        CORNER: BasisSignal(np.full(30, 5.0), lead=0.15, dip=0.2),
        STEADY: BasisSignal(np.array([5.0])),
        TaskKind.NO_FLOW: BasisSignal(np.zeros(1)),
    }
    return BasisSet("m", 0.84, DT, 5.0, signals)


def tasks(*rows: tuple[TaskKind, float, float, float, float]) -> Tasks:
    """Rows of kind, t0, t1, gap, flow after (flow 5)."""
    columns = Tasks.allocate(len(rows))
    for row, (kind, t0, t1, gap, after) in enumerate(rows):
        columns["kind"][row], columns["t0"][row], columns["t1"][row] = kind, t0, t1
        columns["gap"][row], columns["flow"][row], columns["flow_after"][row] = gap, 5.0, after
        columns["dip"][row] = 0.05 if kind == CORNER else 0.0
    return Tasks(**columns)


def test_a_long_gap_leaves_margins_as_they_were_learned() -> None:
    found = unused_margin(
        tasks((START, 1, 1, 1.0, 5), (STOP, 2, 3, 0.2, 0), (CORNER, 1, 2, 0, 5)), signal_bank([paste()])
    )
    assert found.tolist() == [0, 0, 0]


def test_a_short_gap_is_shared_in_proportion() -> None:
    found = unused_margin(tasks((START, 1, 1, 0.03, 5), (STOP, 2, 3, 0.03, 0)), signal_bank([paste()]))
    assert found == pytest.approx([0.1 * 0.8, -0.05 * 0.8])  # 0.03 s of 0.15 s: a fifth is left, the rest is given up


def test_what_is_left_of_two_margins_fills_the_gap_exactly() -> None:
    bank = signal_bank([paste()])
    for gap in (0.0, 0.01, 0.07, 0.15):
        start, stop = unused_margin(tasks((START, 1, 1, gap, 5), (STOP, 2, 3, gap, 0)), bank)
        assert (0.1 - start) + (0.05 + stop) == pytest.approx(gap)


def test_added_volume_is_what_the_signal_has_beyond_the_feed_forward() -> None:
    one = paste()
    assert added_volume(one, START) == pytest.approx(9 * 0.5 - 5 * 0.3)  # the road has 0.3 s of it, margin aside
    assert added_volume(one, STOP) == pytest.approx(-8 * 0.4 - 5 * 0.3)


def test_a_start_puts_back_what_the_stop_took_out_but_the_first_charges_a_rested_barrel() -> None:
    one = paste(stop=-3.0)
    bank = signal_bank([one])
    ratio = -added_volume(one, STOP) / added_volume(one, START)
    assert bank.put_back[0] == pytest.approx(ratio)
    some = tasks((START, 1, 1, 1, 5), (STOP, 2, 3, 1, 0), (START, 4, 4, 1, 5), (START, 9, 9, 1, 5))
    passage = np.full(1, -1.0)
    share = due_share(some, np.array([0.0, 0.0, 0.0, 8.0]), bank, passage)
    assert share == pytest.approx([1, 1, ratio, 1])
    assert passage[0] == 8.0
    later = due_share(some[2:3], np.array([8.0]), bank, passage)
    assert later == pytest.approx([ratio])


def test_a_signal_that_takes_nothing_out_scales_nothing() -> None:
    assert signal_bank([paste(stop=4.0)]).put_back[0] == 1.0
    assert signal_bank([None]).put_back[0] == 1.0


def test_corners_count_by_their_dip() -> None:
    share = due_share(tasks((CORNER, 1, 2, 0, 5)), np.zeros(1), signal_bank([paste()]), np.full(1, -1.0))
    assert share == pytest.approx([0.05 / 0.2])


def test_a_lasting_change_of_flow_is_a_start_or_a_stop_of_the_difference_without_margin() -> None:
    some = tasks((STEADY, 1, 2, 0, 7), (STEADY, 2, 3, 0, 5), (CORNER, 3, 4, 0, 4.5))
    events, begin, when = flow_events(some, np.array([0.0, 0.0, 0.5]))
    assert [TaskKind(kind) for kind in events.kind] == [START, CORNER, STOP]
    assert events.flow == pytest.approx([2.0, 5.0, 0.5])
    assert when == pytest.approx([2.0, 3.5, 4.0])
    assert begin == pytest.approx([0.0, 0.5, 0.5])
    bank = signal_bank([paste()])
    assert unused_margin(events, bank)[[0, 2]] == pytest.approx([0.1, -0.05])


def test_moments() -> None:
    found = moments(tasks((START, 1, 1.5, 0, 5), (STOP, 2, 3, 0, 0), (CORNER, 4, 5, 0, 5)))
    assert found == pytest.approx([1, 3, 4.5])


@pytest.mark.parametrize("kind", [START, STOP, CORNER])
def test_signals_are_softened_to_what_is_followed_without_losing_volume_or_time(kind: TaskKind) -> None:
    one = open_library().find("filament-bowden", 0.4)
    assert softened(one, kind, 1e9) is one.signals[kind]
    for slew in (240.0, 1200.0):
        sharp, soft = one.signals[kind], softened(one, kind, slew)
        assert soft.lead > sharp.lead
        added = []
        for signal in (sharp, soft):
            # what is left of the feed-forward, sample by sample, about the task's moment
            after = (np.arange(len(signal.values)) + 0.5) * one.dt - signal.lead
            share = np.clip((after if kind == START else -after) / one.dt + 0.5, 0.0, 1.0)
            base = share if kind != CORNER else np.abs(after) >= 0.5 * sharp.dip
            added.append((after, signal.values - one.steady * one.flow * base))
        (_, hard), (_, mild) = added
        assert mild.sum() == pytest.approx(hard.sum(), abs=1e-9)
        moments_ = [(after * u).sum() * one.dt for after, u in added]
        assert moments_[1] == pytest.approx(moments_[0], abs=1e-9)
        steps = np.abs(np.diff(mild, prepend=0.0, append=0.0))
        assert steps.max() <= slew * one.dt * (1 + 1e-9)
    bank, loose = signal_bank([one], slew=240.0), signal_bank([one])
    assert bank.longest_lead > loose.longest_lead
    assert bank.put_back == pytest.approx(loose.put_back)


def test_margins_survive_the_library(tmp_path) -> None:  # type: ignore[no-untyped-def]
    from gcodectl.flow.exchange import from_csv, from_json, to_csv, to_json
    from gcodectl.flow.library import Library, load_library, save_library

    library = Library((dataclasses.replace(paste(), training={"plant": "x"}),))
    save_library(library, tmp_path / "one.npz")
    for copy in (load_library(tmp_path / "one.npz"), from_json(to_json(library)), from_csv(to_csv(library))):
        assert [copy.sets[0].signals[kind].margin for kind in (START, STOP, CORNER)] == [0.1, 0.05, 0.0]
