"""Every fault of the virtual printer against the host: each line once and in order, or the right end, made safe."""

import math

import pytest
from duels import ADVANCED, HOT, OLD, STANDARD, print_job
from hypothesis import given, settings
from hypothesis import strategies as st

from gcodectl.errors import CancelledError, DisconnectedError, FirmwareError, NoAnswerError
from gcodectl.link.dialect import Dialect
from gcodectl.link.settings import AUTO, Settings

SURVIVED = (
    "lost-line", "checksum", "checksum-ok", "checksum-no-ok", "missing-checksum", "duplicate-resend", "garble-in",
    "bogus-resend", "bogus-resend=1100", "bogus-resend=1052", "future-resend", "busy", "silence", "noise", "lost-ok",
    "garble-out", "split-ok", "join-ok", "slow-ok", "slow-ok=7", "silence=14", "busy=100",
)  # fmt: skip
ENDS = {
    "dead": NoAnswerError, "reset": FirmwareError, "kill": FirmwareError, "thermal": FirmwareError,
    "close": DisconnectedError, "close=100": DisconnectedError, "cancel": CancelledError,
}  # fmt: skip
DIALECTS = {"standard": STANDARD, "old": OLD, "advanced": ADVANCED, "wait": Dialect(wait=1.0)}


def byte_by_byte(data: bytes) -> list[bytes]:
    return [data[k : k + 1] for k in range(len(data))]


@pytest.mark.parametrize("window", [1, 4, AUTO])
@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("fault", SURVIVED)
def test_what_a_printer_survives_costs_no_line(fault: str, dialect: str, window: int) -> None:
    outcome = print_job(120, f"{fault}@60", dialect=DIALECTS[dialect], settings=Settings(window=window))
    assert outcome.exact
    assert outcome.host.failure is None
    assert outcome.took < 130


@pytest.mark.parametrize("window", [1, 4])
@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("fault", ENDS)
def test_what_ends_a_job_ends_it_rightly(fault: str, dialect: str, window: int) -> None:
    outcome = print_job(120, f"{fault}@60", dialect=DIALECTS[dialect], settings=Settings(window=window))
    assert type(outcome.host.failure) is ENDS[fault]
    assert outcome.laid == outcome.sent[: len(outcome.laid)]
    assert 55 <= len(outcome.laid) <= 66
    assert outcome.took < 60
    if fault != "close=100":
        assert outcome.cold
    assert outcome.host.safe == (fault in ("reset", "close", "cancel"))


@pytest.mark.parametrize("fault", ["", "checksum@30,lost-ok@31", "duplicate-resend@30,join-ok@33", "noise@30"])
@pytest.mark.parametrize("window", [1, 4])
def test_the_split_of_bytes_changes_nothing(fault: str, window: int) -> None:
    options = {"settings": Settings(window=window)}
    whole = print_job(60, fault, **options)
    cut = print_job(60, fault, cut=byte_by_byte, **options)
    assert cut.exact
    assert [one.text for one in cut.printer.executed] == [one.text for one in whole.printer.executed]


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_several_faults_at_once_cost_no_line(data: st.DataObject) -> None:
    names = data.draw(st.lists(st.sampled_from([one for one in SURVIVED if "=" not in one]), min_size=1, max_size=4))
    faults = ",".join(f"{name}%{data.draw(st.sampled_from([0.005, 0.02]))}" for name in names if name != "silence")
    dialect = Dialect(
        drop_repeats=data.draw(st.booleans()), ok_after_resend=data.draw(st.booleans()),
        emergency_parser=data.draw(st.booleans()), advanced_ok=data.draw(st.booleans()),
        flush_on_error=data.draw(st.booleans()),
    )  # fmt: skip
    window = data.draw(st.sampled_from([1, 1, 4, AUTO]))
    outcome = print_job(
        150, faults, dialect=dialect, seed=data.draw(st.integers(0, 99)), settings=Settings(window=window)
    )
    assert outcome.took < math.inf
    if outcome.host.failure is None:
        assert outcome.exact
    else:
        assert outcome.laid == outcome.sent[: len(outcome.laid)]
        assert outcome.cold


def test_a_line_that_never_gets_through_ends_the_job_and_the_heat() -> None:
    outcome = print_job(60, "checksum%1.0")
    assert isinstance(outcome.host.failure, FirmwareError | NoAnswerError)
    assert outcome.laid == []
    assert HOT not in [one.text for one in outcome.printer.executed]


def test_a_reset_whose_start_is_lost_is_known_by_the_line_it_asks_for() -> None:
    dialect = Dialect(greeting=False)
    outcome = print_job(120, "reset@60", dialect=dialect)
    assert isinstance(outcome.host.failure, FirmwareError)
    assert outcome.laid == outcome.sent[: len(outcome.laid)]
    assert outcome.cold


def test_a_window_never_overruns_the_printers_buffer() -> None:
    outcome = print_job(300, "checksum%0.01", dialect=Dialect(rx_bytes=127), settings=Settings(window=8, rx_bytes=127))
    assert outcome.exact
    assert outcome.printer.receiver.lost == 0
