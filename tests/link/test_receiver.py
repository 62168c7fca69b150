"""The printer role: what Marlin's queue does with bytes, whole, byte by byte and in every split."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcodectl.errors import UsageError
from gcodectl.link.dialect import Dialect, cleaned
from gcodectl.link.receiver import Queued, Receiver, Resend
from gcodectl.link.transitions import EMERGENCY, IGNORE, LINES, SAID, START, Deed, Place, Sum
from gcodectl.link.wire import checksum, numbered

KEEPING = Dialect(flush_on_error=False)
"""Answers do not depend on what had come when an error was found."""


def drained(receiver: Receiver, chunks: list[bytes]) -> tuple[list[Queued], bytes, list[str]]:
    """Feed chunks; carry out every command at once. Returns commands, answers and what was urgent."""
    commands, said = [], b""
    for chunk in chunks:
        receiver.receive(chunk)
        said += receiver.transmit()
        while (command := receiver.take()) is not None:
            commands.append(command)
            said += receiver.done(15) + receiver.transmit()
        receiver.spill()
    return commands, said, receiver.urgent


def answers(data: bytes, dialect: Dialect = KEEPING) -> tuple[list[Queued], bytes]:
    commands, said, _ = drained(Receiver(dialect), [data])
    return commands, said


def refused(deed: Deed, last: int, ok: bool = True) -> bytes:
    return b"Error:%s%d\nResend: %d\n%s" % (SAID[deed], last, last + 1, b"ok\n" if ok else b"")


# Lines


def test_a_line_in_its_place_is_queued_without_its_number_and_answered_with_ok():
    assert answers(numbered(1, b"G1 X5")) == ([Queued(1, b"G1 X5")], b"ok\n")


@pytest.mark.parametrize("data", [b"\n", b"\r\n\r\n", b"; a comment\n", b";\r\n"])
def test_an_empty_line_has_no_answer(data: bytes):
    assert answers(data) == ([], b"")


def test_the_number_is_looked_at_before_the_checksum():
    assert answers(b"N7 G1*1\n") == ([], refused(Deed.NUMBER, 0))
    assert answers(b"N1 G1*1\n") == ([], refused(Deed.CHECKSUM, 0))
    assert answers(b"N1 G1\n") == ([], refused(Deed.MISSING, 0))


def test_a_comment_after_the_checksum_does_no_harm_and_one_before_it_takes_it_away():
    line = numbered(1, b"G28").strip()
    assert answers(line + b" ; home\n")[1] == b"ok\n"
    assert answers(b"N1 G28 ; home*33\n") == ([], refused(Deed.MISSING, 0))


@pytest.mark.parametrize("ok", [True, False])
def test_resend_comes_with_or_without_ok(ok: bool):
    assert answers(b"N3 G1*1\n", Dialect(ok_after_resend=ok))[1] == refused(Deed.NUMBER, 0, ok)


def test_the_last_two_lines_again_are_dropped_silently_or_answered():
    sent = b"".join(numbered(k, b"G1 X%d" % k) for k in (1, 2, 3))
    for again in (2, 3):
        commands, said = answers(sent + numbered(again, b"G1 X%d" % again))
        assert ([c.number for c in commands], said) == ([1, 2, 3], b"ok\n" * 3)
    for dialect, again in ((Dialect(), 1), (Dialect(drop_repeats=False), 3)):
        _, said, _ = drained(Receiver(dialect), [sent, numbered(again, b"G1 X%d" % again)])
        assert said == b"ok\n" * 3 + refused(Deed.NUMBER, 3)


def test_a_repeated_line_is_dropped_even_where_its_checksum_is_wrong():
    assert answers(numbered(1, b"G28") + b"N1 G28*0\n")[1] == b"ok\n"


def test_bare_lines_are_taken_and_carry_no_number():
    assert answers(b" G28 X \nM105*12\n")[0] == [Queued(None, b"G28 X"), Queued(None, b"M105")]


@pytest.mark.parametrize(
    ("line", "last"),
    [
        (numbered(5, b"M110"), 5),
        (numbered(0, b"M110 N5"), 5),
        (numbered(-1, b"M110"), -1),
        (numbered(9, b"M110 N-1"), -1),
    ],
)
def test_m110_sets_the_last_number(line: bytes, last: int):
    receiver = Receiver()
    assert drained(receiver, [line])[1] == b"ok\n"
    assert receiver.last == last


def test_m110_needs_its_checksum_all_the_same():
    assert answers(b"N5 M110*1\n") == ([], refused(Deed.CHECKSUM, 0))


def test_a_line_is_cut_at_95_bytes():
    assert answers(b"M117 " + b"x" * 200 + b"\n")[0] == [Queued(None, b"M117 " + b"x" * 90)]
    long = numbered(1, b"M117 " + b"x" * 100)
    assert answers(long) == ([], refused(Deed.MISSING, 0))


def test_escapes_backspaces_quotes_and_parentheses():
    assert cleaned(rb"M117 a\;b;c", Dialect()) == b"M117 a;b"
    assert cleaned(b"G1 X1\x08\x08Y2", Dialect()) == b"G1 Y2"
    assert cleaned(b"\x08G1", Dialect()) == b"G1"
    assert cleaned(b'M117 "a;b";c', Dialect(quoted_strings=True)) == b'M117 "a;b"'
    assert cleaned(rb'M117 "a\";b"', Dialect(quoted_strings=True)) == rb'M117 "a\";b"'
    assert cleaned(b"G1 (fast) X1", Dialect(paren_comments=True)) == b"G1  X1"
    assert cleaned(b"G1 (fast) X1", Dialect()) == b"G1 (fast) X1"


def test_every_place_and_sum_leads_somewhere():
    assert set(LINES) == {(place, sum_) for place in Place for sum_ in Sum}


# Queue and buffer


def test_the_queue_has_four_places_and_a_command_keeps_its_own_until_it_is_done():
    receiver = Receiver()
    receiver.receive(b"".join(numbered(k, b"G4 P%d" % k) for k in range(1, 7)))
    assert receiver.free == 0
    assert receiver.take() == Queued(1, b"G4 P1")
    assert (receiver.free, receiver.last) == (0, 4)
    assert receiver.done(3) == b"ok\n"
    assert receiver.last == 5


def test_advanced_ok_counts_places_as_marlin_does():
    receiver = Receiver(Dialect(advanced_ok=True))
    receiver.receive(numbered(1, b"G28") + numbered(2, b"G28") + b"M105\n")
    said = b""
    while receiver.take() is not None:
        said += receiver.done(15)
    assert said == b"ok N1 P15 B1\nok N2 P15 B2\nok P15 B3\n"


def test_a_full_rx_buffer_loses_what_comes_last():
    receiver = Receiver(Dialect(places=1, rx_bytes=8))
    receiver.receive(b"M105\nM114\nM115\nM119\n")
    assert receiver.lost == 0
    receiver.spill()
    assert receiver.lost == 7
    commands, _, _ = drained(receiver, [b"", b"9\n"])
    assert [c.text for c in commands] == [b"M105", b"M114", b"M119"]


def test_an_error_throws_away_what_has_come_unless_told_otherwise():
    data = b"N1 G1*0\n" + numbered(2, b"G28") + b"N3 G"
    assert answers(data, Dialect())[1] == refused(Deed.CHECKSUM, 0)
    assert answers(data)[1] == refused(Deed.CHECKSUM, 0) + refused(Deed.NUMBER, 0)


def test_one_request_may_be_made_in_another_way():
    receiver = Receiver(KEEPING)
    receiver.resends[1] = Resend(ok=False, times=2)
    _, said, _ = drained(receiver, [b"N1 G1*0\n", b"N1 G1*0\n"])
    head, once = refused(Deed.CHECKSUM, 0).split(b"\n", 1)
    assert said == head + b"\nResend: 1\nResend: 1\n" + head + b"\n" + once


def test_reset_forgets_everything_but_what_was_lost():
    receiver = Receiver()
    receiver.receive(numbered(1, b"G28") + b"N2 G")
    receiver.reset()
    assert (receiver.last, receiver.idle, receiver.take()) == (0, True, None)


def test_a_dialect_that_cannot_be_is_refused():
    with pytest.raises(UsageError, match="places"):
        Dialect(places=0)


# The emergency parser


def urgent(data: bytes, dialect: Dialect | None = None) -> list[str]:
    receiver = Receiver(dialect)
    for k in range(len(data)):
        receiver.receive(data[k : k + 1])
    whole = Receiver(dialect)
    whole.receive(data)
    assert whole.urgent == receiver.urgent
    return receiver.urgent


@pytest.mark.parametrize("word", [b"M108", b"M112", b"M410", b"M524"])
def test_urgent_words_act_bare_or_numbered_though_the_queue_is_full(word: bytes):
    full = b"G4 S9\n" * 9
    assert urgent(full + word + b"\n") == [word.decode()]
    assert urgent(full + numbered(7, word)) == [word.decode()]
    assert urgent(full + b" N-3" + word + b" ; now\r\n") == [word.decode()]


def test_a_prompt_is_answered_with_its_digit():
    assert urgent(b"M876 P1\nM876 S1\nM876S\nM876 S 0*4\n") == ["M876S1", "M876S0"]


@pytest.mark.parametrize("data", [b"M117 M112\n", b"G1 M112\n", b";M112\n", b"M11 2\n", b"5M112\n", b"m112\n", b"M112"])
def test_what_only_looks_urgent_is_not(data: bytes):
    assert urgent(data) == []


def test_without_it_only_bare_lines_act_and_only_when_they_are_read():
    without = Dialect(emergency_parser=False)
    assert urgent(b"M108\nM112\n" + numbered(1, b"M410"), without) == ["M108", "M112"]
    assert urgent(b"G4 S9\n" * 4 + b"M112\n", without) == []


@given(st.lists(st.sampled_from([b"N", b"M", b"1", b"0", b"8", b"2", b"G", b" ", b"\n", b";", b"876", b"S", b"M112"])))
def test_the_quick_way_over_dull_lines_is_the_table_byte_by_byte(parts: list[bytes]):
    data, state, found = b"".join(parts), START, []
    for byte in data:
        if byte in b"\r\n" and state != START:
            found += [state] if state in ("M108", "M112") or (state[:5] == "M876S" and state[5:]) else []
            state = START
        elif state != IGNORE:
            state = EMERGENCY.get((state, byte), IGNORE)
    assert urgent(data) == found


# Any bytes, any split

LINE = st.one_of(
    st.builds(numbered, st.integers(-2, 6), st.sampled_from([b"G1 X1", b"M110", b"M110 N3", b"G4 P1 ; c", b"M108"])),
    st.builds(numbered, st.integers(1, 3), st.text("G1 -N*\\t", max_size=6).map(str.encode)),
    st.sampled_from(
        [b"M105\n", b"\n", b"; c\r\n", b"N2 G1*3\n", b"N3 G1\n", b"M110 N2\n", b"x" * 99 + b"\n", b"\\;\n"]
    ),
    st.binary(max_size=12),
)


@given(st.lists(LINE, max_size=6), st.sampled_from([KEEPING, Dialect(flush_on_error=False, drop_repeats=False)]))
def test_every_split_gives_the_same_commands_and_answers(lines: list[bytes], dialect: Dialect):
    """Their order aside: an error is said as soon as it is found, whatever still waits in the queue."""

    def outcome(chunks: list[bytes]) -> tuple[list[Queued], list[bytes], list[str]]:
        commands, said, found = drained(Receiver(dialect), chunks)
        return commands, sorted(said.split(b"\n")), found

    data = b"".join(lines)
    wanted = outcome([data])
    assert outcome([data[k : k + 1] for k in range(len(data))]) == wanted
    for cut in range(len(data)):
        assert outcome([data[:cut], data[cut:]]) == wanted


@given(st.lists(LINE, max_size=12))
def test_the_usual_way_is_the_long_way(lines: list[bytes]):
    class Long(Receiver):
        def _usual(self, raw: bytes) -> bool:  # noqa: ARG002  the same call, never taken
            return False

    assert drained(Receiver(KEEPING), lines) == drained(Long(KEEPING), lines)


@given(st.lists(LINE, max_size=12), st.integers(1, 9), st.booleans())
def test_no_numbered_line_is_taken_out_of_order_or_with_a_wrong_checksum(lines: list[bytes], size: int, flush: bool):
    data = b"".join(lines)
    sums = set()
    for piece in data.replace(b"\r", b"\n").split(b"\n"):
        head, star, told = cleaned(piece, KEEPING).lstrip(b" ").rpartition(b"*")
        if star and told.strip().isdigit() and int(told) == checksum(head):
            sums.add(head)
    receiver = Receiver(Dialect(flush_on_error=flush))
    commands, _, _ = drained(receiver, [data[k : k + size] for k in range(0, len(data), size)])
    last = 0
    for number, text in commands:
        if number is None:
            continue
        assert b"M110" in text or number == last + 1
        assert flush or any(text in head for head in sums)
        last = number


@given(st.binary(max_size=400))
def test_garbage_never_raises(data: bytes):
    for dialect in (Dialect(), Dialect(rx_bytes=4, places=1, emergency_parser=False, advanced_ok=True)):
        drained(Receiver(dialect), [data[k : k + 7] for k in range(0, len(data), 7)])
