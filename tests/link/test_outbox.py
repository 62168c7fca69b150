from gcodectl.link.flight import Flight
from gcodectl.link.job import BASE, Line
from gcodectl.link.outbox import HOLD, SETTLE, SLACK, Again, Outbox
from gcodectl.link.replies import read_replies
from gcodectl.link.settings import AUTO, Settings
from gcodectl.link.wire import numbered

FIRST = BASE + 1
(OK,) = read_replies(b"ok")
(TEMPERATURES,) = read_replies(b"ok T:20 /0")


class Source:
    """Commands G1 X0, G1 X1 ... from lines 1, 2 ..."""

    def __init__(self) -> None:
        self.given = 0

    def __call__(self) -> Line | None:
        self.given += 1
        return Line(self.given, b"G1 X%d" % self.given)


def sent(outbox: Outbox, source: Source, now: float = 0.0) -> list[int]:
    data = outbox.transmit(source, now)
    return [int(line[1:].split(b" ")[0]) for line in data.splitlines()]


def test_the_window_bounds_what_is_on_its_way_and_the_buffer_too() -> None:
    source = Source()
    assert sent(Outbox(Settings()), source) == [FIRST]
    assert len(sent(Outbox(Settings(window=4)), Source())) == 4
    size = len(numbered(FIRST, b"G1 X1"))
    assert len(sent(Outbox(Settings(window=9, rx_bytes=2 * size + 1)), Source())) == 3
    tight, source = Outbox(Settings(window=9, rx_bytes=1)), Source()
    assert sent(tight, source) == [FIRST]
    assert source.given == 2, "it was looked at for its size, and is kept"
    tight.answered(OK, 0.0)
    assert tight.transmit(source, 0.0) == numbered(FIRST + 1, b"G1 X2")


def test_auto_begins_with_one_and_takes_the_places_that_the_printer_tells_of() -> None:
    outbox, source = Outbox(Settings(window=AUTO)), Source()
    assert len(sent(outbox, source)) == 1
    (reply,) = read_replies(b"ok N%d P15 B3" % FIRST)
    assert outbox.answered(reply, 0.0)
    assert len(sent(outbox, source)) == 3


def test_a_number_stands_for_the_same_bytes_for_ever() -> None:
    outbox, source = Outbox(Settings(window=3)), Source()
    first = outbox.transmit(source, 0.0)
    assert outbox.again(FIRST, 0.0) is Again.FOLLOWED
    outbox.advance(SETTLE)
    again = outbox.transmit(source, SETTLE)
    assert first.startswith(again)
    assert source.given == 3, "nothing new was numbered meanwhile"
    assert outbox.resent == 1


def test_a_burst_of_requests_is_followed_once_and_its_oks_are_nobodys() -> None:
    outbox, source = Outbox(Settings(window=3)), Source()
    sent(outbox, source)
    for _ in range(3):
        assert outbox.again(FIRST, 0.0) is Again.FOLLOWED
        assert outbox.transmit(source, 0.0) == b""
    assert not outbox.answered(OK, 0.01)
    assert outbox.resent == 1
    assert sent(outbox, source, 0.02) == [FIRST]
    assert sent(outbox, source, 0.02) == [], "one at a time, while lines are sent again"
    assert outbox.acked == BASE


def test_what_the_printer_had_taken_is_waited_for_before_going_back() -> None:
    outbox, source = Outbox(Settings(window=3)), Source()
    sent(outbox, source)
    assert outbox.again(FIRST + 2, 0.0) is Again.FOLLOWED
    assert sent(outbox, source, 0.5) == []
    assert outbox.answered(OK, 1.0)
    outbox.alive(1.0)
    assert outbox.answered(OK, 2.0)
    assert outbox.acked == FIRST + 1
    outbox.advance(2.0 + SETTLE)
    assert sent(outbox, source, 2.0 + SETTLE)[0] == FIRST + 2


def test_oks_that_never_come_are_not_waited_for_for_ever() -> None:
    outbox, source = Outbox(Settings(window=3)), Source()
    sent(outbox, source)
    outbox.again(FIRST + 2, 0.0)
    outbox.advance(HOLD - 0.1)
    assert outbox.holding
    outbox.advance(HOLD)
    assert sent(outbox, source, HOLD)[0] == FIRST + 2


def test_requests_out_of_reason_are_not_followed_and_an_ok_behind_one_is_no_answer() -> None:
    outbox, source = Outbox(Settings()), Source()
    for _ in range(20):
        sent(outbox, source)
        outbox.answered(OK, 0.0)
    sent(outbox, source)
    assert outbox.acked == FIRST + 19
    for number in (0, 1, BASE, FIRST, FIRST + 19 - SLACK, FIRST + 19, FIRST + 22):
        assert outbox.again(number, 0.0) is Again.ODD
    assert not outbox.answered(OK, 0.01), "it came with the request"
    assert outbox.answered(OK, 0.02)
    assert outbox.again(FIRST + 19 - SLACK, 1.0, insists=True) is Again.ODD
    assert outbox.again(FIRST + 19, 1.0, insists=True) is Again.FOLLOWED


def test_a_line_is_sent_again_ten_times_at_most() -> None:
    outbox, source = Outbox(Settings(resends=10)), Source()
    sent(outbox, source)
    for k in range(10):
        assert outbox.again(FIRST, float(k)) is Again.FOLLOWED
        outbox.advance(k + SETTLE)
        assert sent(outbox, source, k + SETTLE) == [FIRST]
    assert outbox.again(FIRST, 11.0) is Again.TOO_OFTEN


def test_a_probe_has_the_next_number_and_is_sent_again_in_its_turn() -> None:
    outbox, source = Outbox(Settings()), Source()
    sent(outbox, source)
    assert outbox.probe(5.0) == numbered(FIRST + 1, b"M105")
    outbox.again(FIRST, 5.1)
    outbox.answered(OK, 5.1)
    assert sent(outbox, source, 5.2) == [FIRST]
    outbox.answered(OK, 5.3)
    assert sent(outbox, source, 5.3) == [FIRST + 1]
    assert outbox.flight
    assert outbox.answered(TEMPERATURES, 5.4)
    assert not outbox.flight


def test_the_answer_to_a_probe_answers_what_stands_before_it() -> None:
    outbox, source = Outbox(Settings()), Source()
    sent(outbox, source)
    outbox.probe(5.0)
    outbox.probe(10.0)
    assert outbox.answered(TEMPERATURES, 10.1)
    assert outbox.acked == FIRST + 2
    assert not outbox.flight


def test_an_answer_to_an_m105_is_told_from_others_once_that_is_known() -> None:
    flight = Flight()
    flight.add(1, 10, b"M105")
    assert flight.answered(TEMPERATURES, probing=False) == 1
    flight.add(2, 10, b"M105")
    assert flight.answered(OK, probing=False) is None, "only an ok with temperatures answers it"
    flight.add(3, 10, b"G1 X1")
    assert flight.answered(OK, probing=False) == 3
    flight.add(4, 10, b"G1 X2")
    assert flight.answered(TEMPERATURES, probing=False) is None, "nobody asked"
    assert (flight.size, len(flight)) == (10, 1)


def test_an_old_printer_that_answers_m105_plainly_is_understood() -> None:
    flight = Flight()
    flight.add(1, 10, b"M105")
    assert flight.answered(OK, probing=False) == 1


def test_oks_with_numbers_answer_what_they_say() -> None:
    flight = Flight()
    for number in range(1, 5):
        flight.add(number, 10, b"G1")
    assert flight.answered(read_replies(b"ok N2 P1 B1")[0], probing=False) == 2
    assert flight.answered(read_replies(b"ok N2 P1 B1")[0], probing=False) is None
    assert flight.answered(read_replies(b"ok N9 P1 B1")[0], probing=False) == 3, "beyond what was sent: a plain ok"


def test_oks_with_the_last_16_bits_of_a_number_are_understood() -> None:
    flight = Flight()
    for number in range(65_535, 65_539):
        flight.add(number, 10, b"G1")
    for told, number in ((65_535, 65_535), (0, 65_536), (2, 65_538)):
        (reply,) = read_replies(b"ok %d" % told)
        assert flight.answered(reply, probing=False) == number
    flight.add(65_540, 10, b"G1")
    assert flight.answered(read_replies(b"ok 3")[0], probing=False) is None, "of a line that was answered"
