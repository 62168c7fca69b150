import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcodectl.columns import Floats
from gcodectl.flow import sequencer
from gcodectl.flow.sequencer import BLEND, TRANSITIONS, concatenate_kernel, sample_kernel, superpose_kernel
from gcodectl.records import TaskKind
from plant_models.linear import Linear

STOP, START, CORNER, STEADY, NO_FLOW = range(5)
DT = 0.01
Event = tuple[int, int, float, float, float, float]
"""kind, tool, when, flow, dip, start of the passage"""


def bank(longest: int = 60, steady: float = 0.9) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
    """Two tools: one with signals of 60, 50 and 40 samples, one that has learned nothing."""
    count = np.array([[60, 50, 40], [0, 0, 0]])
    values = np.zeros((2, 3, longest))
    values[0, STOP, :60] = np.concatenate([np.full(20, 0.9), np.linspace(0.5, -0.5, 40)])
    values[0, START, :50] = np.concatenate([np.linspace(0, 4, 25), np.linspace(4, 0.9, 25)])
    values[0, CORNER, :40] = 0.9 * np.abs(np.linspace(-1, 1, 40))
    lead = np.array([[0.3, 0.25, 0.2], [0.0, 0.0, 0.0]])
    return {
        "values": values,
        "count": count,
        "lead": lead,
        "dip": np.array([0.1, 0.0]),
        "steady": np.array([steady, 1.0]),
    }


def columns(events: list[Event]) -> tuple[np.ndarray, ...]:  # type: ignore[type-arg]
    kind, tool, when, flow, dip, start = (np.array(column) for column in zip(*events, strict=True))
    return kind.astype(np.int64), tool.astype(np.int64), *(np.asarray(c, dtype=float) for c in (when, flow, dip, start))


def superposed(events: list[Event], samples: int, first: int = 0, kernel=superpose_kernel) -> Floats:  # type: ignore[no-untyped-def]
    b = bank()
    out = np.zeros(samples)
    if events:
        kind, tool, when, flow, dip, start = columns(events)
        scale = flow * np.where(kind == CORNER, dip / b["dip"][tool], 1.0)
        kernel(
            kind,
            tool,
            when,
            np.zeros(len(kind)),
            scale,
            start,
            first,
            DT,
            b["values"],
            b["count"],
            b["lead"],
            b["dip"],
            b["steady"],
            out,
        )
    return out


def concatenated(
    events: list[Event],
    reference: Floats,
    size: int = 100_000,
    kernel=concatenate_kernel,  # type: ignore[no-untyped-def]
) -> tuple[Floats, np.ndarray]:  # type: ignore[type-arg]
    """u and the chosen task of every sample, `size` samples at a call."""
    b = bank()
    kind, tool, when, flow, dip, start = columns(events)
    stops = np.where(kind == STOP, when, np.inf)
    road_end = np.minimum.accumulate(stops[::-1])[::-1]
    begun, state = np.zeros(len(kind), dtype=np.int64), np.array([float(NO_FLOW), -1.0, 0.0, 0.0, 1e9, 0.0])
    out, chosen = np.zeros(len(reference)), np.zeros(len(reference), dtype=np.int64)
    for first in range(0, len(reference), size):
        upto = min(first + size, len(reference))
        part = slice(first, upto)
        kernel(
            kind, tool, when, flow, dip, start, road_end, first, upto, DT, reference[part],
            b["values"], b["count"], b["lead"], b["dip"], b["steady"], TRANSITIONS, begun, state,
            np.empty((2, len(kind))), out[part], chosen[part],
        )  # fmt: skip
    return out, chosen


def test_the_table_is_the_papers_figure_8() -> None:
    allowed = {
        ("No-Flow", "No-Flow"), ("No-Flow", "Start"), ("Start", "Steady-State"), ("Start", "Corner"), ("Start", "Stop"),
        ("Steady-State", "Steady-State"), ("Steady-State", "Corner"), ("Steady-State", "Stop"),
        ("Corner", "Steady-State"), ("Corner", "Corner"), ("Corner", "Stop"), ("Stop", "No-Flow"), ("Stop", "Start"),
    }  # fmt: skip
    found = {(a.label, b.label) for a in TaskKind for b in TaskKind if TRANSITIONS[a, b]}
    assert found == allowed
    assert [kind.label for kind in TaskKind] == ["Stop", "Start", "Corner", "Steady-State", "No-Flow"]


def test_samples_between_samples() -> None:
    signal = np.array([2.0, 4.0, 8.0])
    for kernel in (sample_kernel, sample_kernel.py_func):
        found = [kernel(signal, 3, position) for position in (-1.0, -0.4, 0.0, 0.5, 2.0, 2.4, 3.0)]
        assert found == pytest.approx([0, 2, 2, 3, 8, 8, 0])
        assert kernel(signal, 0, 0.0) == 0.0


def plain_superpose(events: list[Event], samples: int) -> Floats:
    """What superpose means: signal minus what the feed-forward does then, over the span of the signal."""
    b = bank()
    middles = (np.arange(samples) + 0.5) * DT
    total = np.zeros(samples)
    for kind, tool, when, flow, dip, start in events:
        count, begin = b["count"][tool, kind], when - b["lead"][tool, kind]
        if not count:
            continue
        position = (middles - begin) / DT - 0.5
        signal = np.interp(position, np.arange(count), b["values"][tool, kind, :count])
        base = np.full(samples, b["steady"][tool])
        if kind == START:
            base *= np.clip((middles - when) / DT + 0.5, 0, 1)
        elif kind == STOP:
            base *= np.clip((when - middles) / DT + 0.5, 0, 1)
        else:
            base[np.abs(middles - when) < 0.5 * b["dip"][tool]] = 0.0
        share = dip / b["dip"][tool] if kind == CORNER else 1.0
        inside = (middles >= max(begin, start)) & (middles <= begin + count * DT)
        total += np.where(inside, share * flow * (signal - base), 0.0)
    return total


moments = st.integers(0, 3000).map(lambda k: k / 1000 + 0.00037)
events = st.lists(
    st.tuples(
        st.integers(0, 2), st.integers(0, 1), moments, st.sampled_from([1.0, 5.0]), st.sampled_from([0.0, 0.05, 0.2]),
        st.sampled_from([0.0, 0.5037]),
    ),
    min_size=1, max_size=8,
)  # fmt: skip


@given(events)
def test_superpose_against_numpy(some: list[Event]) -> None:
    learned = [event for event in some if event[1] == 0]
    found = superposed(learned, 400)
    assert found == pytest.approx(plain_superpose(learned, 400), abs=1e-9)
    later = superposed(learned, 300, first=100)
    assert np.array_equal(later, found[100:])


def test_superpose_with_the_jit_off() -> None:
    some: list[Event] = [(START, 0, 0.503, 5, 0, 0), (CORNER, 0, 1.2, 5, 0.2, 0), (STOP, 0, 2.0, 5, 0, 1.9)]
    assert superposed(some, 300) == pytest.approx(superposed(some, 300, kernel=superpose_kernel.py_func), abs=1e-12)


@pytest.mark.parametrize("offset", [0.0, 0.001, 0.004, 0.0049, 0.0051, 0.009])
def test_a_stop_that_begins_as_steady_state_begins_without_a_step(offset: float) -> None:
    added = superposed([(STOP, 0, 1.0 + offset, 5.0, 0.0, 0.0)], 100)
    assert np.abs(added[:88]).max() < 1e-9


@pytest.mark.parametrize("gap", [0.0, 0.013, 0.1, 0.25, 0.4, 0.9])
def test_on_a_linear_extruder_superposed_flows_add_up(gap: float) -> None:
    plant = Linear(K=1 / 0.9, tau=2.7)
    stop: list[Event] = [(STOP, 0, 1.5, 5.0, 0.0, 0.0)]
    start: list[Event] = [(START, 0, 1.5 + gap, 5.0, 0.0, 0.0)]
    flows = [plant.run(plant.initial(), superposed(some, 800), DT)[1] for some in (stop, start, stop + start)]
    assert flows[2] == pytest.approx(flows[0] + flows[1], abs=1e-9)


def road(begin: float, end: float, samples: int) -> Floats:
    middles = (np.arange(samples) + 0.5) * DT
    return np.where((middles > begin) & (middles < end), 4.5, 0.0)


def runs(chosen: np.ndarray) -> list[int]:  # type: ignore[type-arg]
    return [int(kind) for k, kind in enumerate(chosen) if k == 0 or kind != chosen[k - 1]]


def test_one_road_in_sequence() -> None:
    some: list[Event] = [(START, 0, 1.0, 5, 0, 0), (CORNER, 0, 2.0, 5, 0.1, 0), (STOP, 0, 3.0, 5, 0, 0)]
    u, chosen = concatenated(some, road(1, 3, 450))
    assert runs(chosen) == [NO_FLOW, START, STEADY, CORNER, STEADY, STOP, NO_FLOW]
    assert np.flatnonzero(chosen == START)[[0, -1]].tolist() == [75, 123]
    assert np.flatnonzero(chosen == STOP)[[0, -1]].tolist() == [270, 329]
    assert u[150] == pytest.approx(4.5)
    assert u[99] == pytest.approx(5 * bank()["values"][0, START, 24])


def test_stop_wins_and_cuts_short() -> None:
    some: list[Event] = [(START, 0, 1.0, 5, 0, 0), (STOP, 0, 1.2, 5, 0, 0)]
    u, chosen = concatenated(some, road(1, 1.2, 300))
    assert runs(chosen) == [NO_FLOW, START, STOP, NO_FLOW]
    assert np.flatnonzero(chosen == START)[[0, -1]].tolist() == [75, 89]
    blended = 5 * bank()["values"][0, STOP, 0]
    assert np.abs(np.diff(u[70:110])).max() <= (u[89] - blended) * DT / BLEND + 1e-9
    assert u[90] == pytest.approx(u[89])
    assert u[90 + round(BLEND / DT)] == pytest.approx(blended)


def test_a_late_start_still_counts_as_one() -> None:
    some: list[Event] = [(START, 0, 0.1, 5, 0, 0.6), (STOP, 0, 2.0, 5, 0, 0)]
    u, chosen = concatenated(some, road(0.1, 2.0, 300))
    assert runs(chosen) == [NO_FLOW, START, STEADY, STOP, NO_FLOW]
    assert u[120] == pytest.approx(4.5)


def test_a_tool_without_signals_follows_its_reference() -> None:
    some: list[Event] = [(START, 1, 0.5, 5, 0, 0), (CORNER, 1, 0.8, 5, 0.1, 0), (STOP, 1, 1.5, 5, 0, 0)]
    reference = road(0.5, 1.5, 300)
    u, chosen = concatenated(some, reference)
    assert runs(chosen) == [NO_FLOW, START, STEADY, STOP, NO_FLOW]
    assert u == pytest.approx(reference)


@given(events, st.sampled_from([1, 7, 37]))
def test_whatever_comes_the_table_holds_and_chunks_do_not_matter(some: list[Event], size: int) -> None:
    ordered = sorted(some, key=lambda event: event[2])
    reference = np.maximum(0.0, np.sin(np.arange(400) / 40.0)).round(1)
    u, chosen = concatenated(ordered, reference)
    steps = [(a, b) for a, b in itertools.pairwise(chosen) if a != b]
    assert all(TRANSITIONS[a, b] for a, b in steps)
    assert TRANSITIONS[NO_FLOW, chosen[0]]
    assert np.isfinite(u).all()
    again, same = concatenated(ordered, reference, size)
    assert np.array_equal(u, again)
    assert np.array_equal(chosen, same)


def test_concatenate_with_the_jit_off(monkeypatch: pytest.MonkeyPatch) -> None:
    some: list[Event] = [(START, 0, 1.0, 5, 0, 0), (CORNER, 0, 1.5, 5, 0.1, 0), (STOP, 0, 2.0, 5, 0, 0)]
    expected = concatenated(some, road(1, 2, 300))
    for name in ("sample_kernel", "choose_kernel"):
        monkeypatch.setattr(sequencer, name, getattr(sequencer, name).py_func)
    found = concatenated(some, road(1, 2, 300), kernel=concatenate_kernel.py_func)
    assert found[0] == pytest.approx(expected[0], abs=1e-12)
    assert np.array_equal(found[1], expected[1])
